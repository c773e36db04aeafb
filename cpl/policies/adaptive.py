"""A switch whose threshold follows the risk it ran: conformal decision theory, nothing trained.

The tracked quantile promises how often the *forecast* errs. Conformal decision theory (Lekeufack,
Angelopoulos, Bajcsy, Jordan, Malik 2024) controls what the car does instead: the threshold itself
is moved by the losses that it led to.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cpl.policies.switch import Bools, Floats, Moment

__all__ = ["RiskControl", "near_miss"]

_X_M, _Y_M, _V_MPS = 200.0, 16.0, 80.0  # what 1 in an observation stands for, on four lanes
_LANE_M, _CAR_M = 4.0, 5.0


def near_miss(obs: NDArray[np.float32], within_s: float) -> Bools:
    """Say whether the ego car closes in on a car in its lane so fast that little time is left.

    Args:
        obs: Observations of the paper's road, (n, rows, 5): presence, x, y, vx, vy, normalised.
        within_s: Less time to the collision than this is a near miss [s].

    Returns:
        Shape (n,).

    Examples:
        A car 15 m ahead leaves a gap of 10 m, and the ego car comes nearer by 8 m/s:

        >>> obs = np.zeros((1, 2, 5), np.float32)
        >>> obs[0, 1] = 1, 15 / 200, 0, -8 / 80, 0
        >>> near_miss(obs, 2.0).tolist(), near_miss(obs, 1.0).tolist()
        ([True], [False])
    """
    there = obs[:, 1:, 0] > 0.5
    gap = obs[:, 1:, 1] * _X_M - _CAR_M
    beside = np.abs(obs[:, 1:, 2]) * _Y_M >= _LANE_M / 2
    closing = -obs[:, 1:, 3] * _V_MPS
    close = there & ~beside & (gap > -_CAR_M) & (gap < within_s * closing)
    return np.asarray(close.any(axis=1))


class RiskControl:
    r"""The switch with a threshold that each road's own losses move.

    $$ \lambda \leftarrow \lambda + \eta\,(\varepsilon - \ell), \qquad
       \text{safe if } \hat l + u \ge \lambda $$

    The loss is 1 after a near miss or a crash, else 0. The threshold stays with its road from one
    episode to the next, so it is to be driven with `Tracking(carry=True)`, which keeps roads and
    settings together. Summing up the rule gives, for every stretch of T losses and whatever the
    traffic, mean loss = epsilon - (change of lambda) / (eta T).

    Args:
        epsilon: Losses aimed at [-], a setting each.
        eta: Step [-].
        start: First threshold [-].
        within_s: What counts as a near miss [s].
        decisions: Of an episode that ends by the clock; a shorter one was a crash.

    Raises:
        ValueError: If a loss aimed at is not in [0, 1], or the step not positive.
    """

    def __init__(
        self,
        epsilon: ArrayLike,
        *,
        eta: float = 0.05,
        start: float = 0.5,
        within_s: float = 2.0,
        decisions: int = 40,
    ) -> None:
        self.epsilon = np.atleast_1d(np.asarray(epsilon, np.float64))
        if not ((self.epsilon >= 0) & (self.epsilon <= 1)).all():
            raise ValueError(f"epsilon must lie in [0, 1], got {epsilon!r}")
        if not eta > 0:
            raise ValueError(f"eta must be positive, got {eta!r}")
        self.eta, self.start, self.within_s, self.decisions = eta, start, within_s, decisions
        self.threshold: Floats = np.empty(0)
        self._before = np.empty(0, np.int64)

    def __call__(self, moment: Moment) -> Bools:
        """Take the loss of the decision before, and say where the safe policy drives."""
        if len(self.threshold) != len(moment.step):
            self.threshold = np.full(len(moment.step), self.start)
            self._before = np.full(len(moment.step), -1)
        begun = moment.step == 0
        loss = np.where(
            begun, self._before + 1 < self.decisions, near_miss(moment.obs, self.within_s)
        )
        # Nothing happened before a road's first decision, or on a road that stands still.
        known = (self._before >= 0) & (begun | (moment.step != self._before))
        move = self.eta * (self.epsilon[moment.setting] - loss)
        self.threshold = self.threshold + np.where(known, move, 0.0)
        self._before = moment.step.copy()
        return (moment.l_hat + moment.u >= self.threshold) | ~moment.ready
