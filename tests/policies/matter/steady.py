"""The toy without fog: a constant distance is all that is needed."""

from tests.policies.matter import lanes
from tests.policies.matter.lanes import act, harm, pace, score

__all__ = ["act", "harm", "make", "pace", "score"]


class Steady(lanes.Lane):
    """The noise is always the same."""

    def reset(self, *, seed=None, options=None):
        observation, info = super().reset(seed=seed)
        self.noise = 1.0
        return observation, info


def make():
    return Steady()
