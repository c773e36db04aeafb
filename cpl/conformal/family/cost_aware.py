r"""Cost-aware tracking: an error counts for as much as it costs."""

import math
from dataclasses import dataclass

import numpy as np

from cpl.conformal._validate import as_positive
from cpl.conformal.family._member import Member
from cpl.conformal.state import FloatArray, StateRule, feedback

__all__ = ["MEMBER", "CostAware"]


@feedback
def _update(state: FloatArray, numbers: FloatArray, score: float, met: float) -> None:
    alpha, eta, cost, reach = numbers[0], numbers[1], numbers[2], numbers[3]
    loss = 1.0 + cost * min((score - met) / reach, 1.0) if score > met else 0.0
    state[0] += eta * (loss - alpha)


@dataclass(frozen=True, kw_only=True, slots=True)
class CostAware(StateRule):
    r"""Move by the cost of an error in place of the error.

    $$ q_{t+1} = q_t + \eta\,(c_t\,\mathrm{err}_t - \alpha), \qquad
       c_t = 1 + C \min\Bigl(\frac{s_t - q_t}{R}, 1\Bigr) $$

    After Xue, Pan, Ong and Wu (2026), whose loss is the miss times its realised cost and whose
    update is that of ACI; here the threshold itself moves, and the cost is how far the score went
    beyond it. For scores in [0, B]

    $$ \frac1T \sum_t c_t\,\mathrm{err}_t \le \alpha + \frac{B + (1 + C - \alpha)\eta}{\eta T} $$

    and since no cost is below 1 the same bound holds for the share of errors: frequency and harm
    are bounded together. The price is that fewer errors than alpha are made.

    Args:
        eta: The step [score], > 0.
        cost: C, what the worst miss costs more than the least one [-], >= 0; 0 is ``Fixed``.
        reach: R, how far beyond the threshold a score is at its most costly [score], > 0.

    Examples:
        A miss by half the reach costs 1 + 2 / 2.

        >>> from cpl.conformal import track
        >>> track([1.0, 0.0], CostAware(eta=1.0, cost=2.0, reach=2.0), alpha=0.5).q
        array([0. , 1.5])
    """

    eta: float
    cost: float
    reach: float

    update = _update

    def __post_init__(self) -> None:
        object.__setattr__(self, "eta", as_positive("eta", self.eta))
        object.__setattr__(self, "cost", as_positive("cost", self.cost, or_zero=True))
        object.__setattr__(self, "reach", as_positive("reach", self.reach))

    def begin(self, alpha: float, q0: float) -> FloatArray:
        """Return the state: the threshold."""
        return np.array([q0])

    def numbers(self, alpha: float) -> FloatArray:
        """Return the settings."""
        return np.array([alpha, self.eta, self.cost, self.reach])

    def most_errors(self, *, alpha: float, B: float, T: int) -> int | None:
        """Return the bound: no error costs less than 1."""
        return min(T, math.floor(alpha * T + B / self.eta + 1.0 + self.cost - alpha))


MEMBER = Member(
    name="cost_aware",
    title="Cost-aware",
    year=2026,
    paper="xue2026cost",
    make=lambda scale: CostAware(eta=0.1 * scale, cost=2.0, reach=scale),
    guarantee="mean cost and share of errors, each within (B / eta + 1 + C) / T above alpha",
    tuning="step, cost, reach",
    memory="1",
)
