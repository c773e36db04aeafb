r"""Betting: the threshold is a share of what a gambler on errors has won. Nothing to tune."""

from dataclasses import dataclass

import numpy as np

from cpl.conformal._validate import as_positive
from cpl.conformal.family._member import Member
from cpl.conformal.state import FloatArray, StateRule, feedback

__all__ = ["KT", "MEMBER"]


@feedback
def _update(state: FloatArray, numbers: FloatArray, score: float, met: float) -> None:
    gradient = (1.0 if score > met else 0.0) - numbers[0]
    state[1] += gradient * (state[2] / (state[3] + 1.0) * state[1])
    state[2] += gradient
    state[3] += 1.0
    state[0] = state[4] + state[2] / (state[3] + 1.0) * state[1]


@dataclass(frozen=True, kw_only=True, slots=True)
class KT(StateRule):
    r"""Bet on the next error with the share that the errors so far suggest.

    $$ q_t = q_0 + \lambda_t W_{t-1}, \qquad W_t = W_{t-1} + (\mathrm{err}_t - \alpha)(q_t - q_0),
       \qquad \lambda_t = \frac1t \sum_{i<t} (\mathrm{err}_i - \alpha) $$

    Podkopaev, Xu and Lee (2024), with the bettor of Krichevsky and Trofimov. There is no step: the
    wealth W grows exponentially while errors keep to one side and so reaches scores of any size.
    For bounded scores the mean error tends to alpha; no rate is given. The wealth begins with
    ``wealth``, the only thing with a unit.

    Late feedback is bet on as if it were prompt: the wealth is that of somebody who bets on the
    errors in the order in which they become known. To settle each at the odds of its own time would
    leave several large bets open at once, and the wealth below 0 when they are lost together.

    Args:
        wealth: The first wealth [score], > 0.

    Examples:
        The first miss: sum of g 0.9, no bet was open, so q is 0.9 / 2 of the wealth.

        >>> from cpl.conformal import track
        >>> track([2.0, 2.0, 2.0], KT(wealth=1.0), alpha=0.1).q.round(4)
        array([0.   , 0.45 , 0.843])
    """

    wealth: float

    update = _update

    def __post_init__(self) -> None:
        object.__setattr__(self, "wealth", as_positive("wealth", self.wealth))

    def begin(self, alpha: float, q0: float) -> FloatArray:
        """Return the state: threshold, wealth, sum of feedback, events, first threshold."""
        return np.array([q0, self.wealth, 0.0, 0.0, q0])

    def numbers(self, alpha: float) -> FloatArray:
        """Return the settings."""
        return np.array([alpha])


MEMBER = Member(
    name="kt",
    title="KT betting",
    year=2024,
    paper="podkopaev2024adaptive",
    make=lambda scale: KT(wealth=scale),
    guarantee="the error tends to alpha on bounded scores; no rate",
    tuning="nothing (the first wealth)",
    memory="5",
)
