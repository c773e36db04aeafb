r"""A moving average of the scores and some deviations: the plain rival."""

import math
from dataclasses import dataclass

import numpy as np

from cpl.conformal._validate import as_positive
from cpl.conformal.family._member import Member
from cpl.conformal.state import FloatArray, StateRule, feedback

__all__ = ["EWMA", "MEMBER"]


@feedback
def _update(state: FloatArray, numbers: FloatArray, score: float, met: float) -> None:
    rate = numbers[1]
    if state[3] == 0.0:
        state[1], state[2], state[3] = score, 0.0, 1.0
    else:
        off = score - state[1]
        state[1] += rate * off
        state[2] = (1.0 - rate) * (state[2] + rate * off * off)
    state[0] = state[1] + numbers[2] * math.sqrt(state[2])


@dataclass(frozen=True, kw_only=True, slots=True)
class EWMA(StateRule):
    r"""Mean and variance, exponentially weighted; no feedback, no guarantee.

    $$ m \leftarrow m + \rho (s - m), \quad v \leftarrow (1 - \rho)(v + \rho (s - m)^2), \quad
       q = m + k \sqrt v, \qquad \rho = 1 / \text{memory} $$

    It does not look at errors: alpha plays no part, and ``deviations`` has to be tuned to it. What
    a tracker with a guarantee is worth is what it does better than this.

    Args:
        memory: Scores that are remembered [steps], >= 1.
        deviations: k [-], >= 0.

    Examples:
        >>> from cpl.conformal import track
        >>> track([1.0, 3.0, 0.0], EWMA(memory=2.0, deviations=1.0), alpha=0.1).q
        array([0., 1., 3.])
    """

    memory: float
    deviations: float

    update = _update

    def __post_init__(self) -> None:
        object.__setattr__(self, "memory", as_positive("memory", self.memory))
        object.__setattr__(
            self, "deviations", as_positive("deviations", self.deviations, or_zero=True)
        )
        if self.memory < 1.0:
            raise ValueError(f"memory must be >= 1, got {self.memory!r}")

    def begin(self, alpha: float, q0: float) -> FloatArray:
        """Return the state: threshold, mean, variance, whether there was a score."""
        return np.array([q0, 0.0, 0.0, 0.0])

    def numbers(self, alpha: float) -> FloatArray:
        """Return the settings."""
        return np.array([alpha, 1.0 / self.memory, self.deviations])


MEMBER = Member(
    name="ewma",
    title="EWMA",
    year=1959,
    paper="roberts1959control",
    make=lambda scale: EWMA(memory=20.0, deviations=1.3),
    guarantee="none",
    tuning="memory, deviations",
    memory="4",
    vectors="pandas",
)
