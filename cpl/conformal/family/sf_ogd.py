r"""Scale-free gradient descent: a fixed step divided by the size of all feedback so far."""

import math
from dataclasses import dataclass

import numpy as np

from cpl.conformal._validate import as_positive
from cpl.conformal.family._member import Member
from cpl.conformal.state import FloatArray, StateRule, feedback

__all__ = ["MEMBER", "SFOGD"]


@feedback
def _update(state: FloatArray, numbers: FloatArray, score: float, met: float) -> None:
    alpha, step = numbers[0], numbers[1]
    gradient = 1.0 - alpha if score > met else -alpha
    state[1] += gradient * gradient
    moved = state[0] + step / math.sqrt(state[1]) * gradient
    state[0] = max(moved, 0.0) if numbers[2] > 0.0 else moved


@dataclass(frozen=True, kw_only=True, slots=True)
class SFOGD(StateRule):
    r"""Divide the step by the root of the sum of squared feedback.

    $$ q_{t+1} = q_t + \frac{D}{\sqrt 3}\,\frac{\mathrm{err}_t - \alpha}
       {\sqrt{\sum_{i \le t} (\mathrm{err}_i - \alpha)^2}} $$

    Bhatnagar, Wang, Xiong and Bai (2023), algorithm 2, after Orabona and Pal (2018). The step falls
    like 1 / sqrt(t): regret is small at any time without knowing how long it will last, but a shift
    that comes late is followed slowly. On scores in [0, D] the mean error tends to alpha; ours
    follows from Abel's summation, as for any falling step.

    The public code keeps the threshold at or above 0 (``clip``) and does not move it where a score
    meets it exactly; here a tie is covered, as everywhere in this package.

    Args:
        scale: D, the size of the scores [score], > 0.
        clip: Whether the threshold is kept at or above 0.

    Examples:
        The first miss moves the threshold by D / sqrt(3), whatever alpha is.

        >>> from cpl.conformal import track
        >>> track([1.0, 1.0], SFOGD(scale=3.0**0.5), alpha=0.1).q.round(9)
        array([0., 1.])
    """

    scale: float
    clip: bool = False

    update = _update

    def __post_init__(self) -> None:
        object.__setattr__(self, "scale", as_positive("scale", self.scale))

    def begin(self, alpha: float, q0: float) -> FloatArray:
        """Return the state: threshold and sum of squares."""
        return np.array([q0, 0.0])

    def numbers(self, alpha: float) -> FloatArray:
        """Return the settings."""
        return np.array([alpha, self.scale / math.sqrt(3.0), float(self.clip)])


MEMBER = Member(
    name="sf_ogd",
    title="SF-OGD",
    year=2023,
    paper="bhatnagar2023improved",
    make=lambda scale: SFOGD(scale=scale),
    guarantee="anytime regret; error within O(1 / sqrt(T)) for scores in [0, D]",
    tuning="the scale D",
    memory="2",
    vectors="online-conformal 1.0.2",
)
