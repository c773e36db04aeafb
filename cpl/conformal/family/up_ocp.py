r"""A universal portfolio of two assets: one pays after a miss, one after a covered score."""

from dataclasses import dataclass

import numpy as np

from cpl.conformal._validate import as_positive
from cpl.conformal.family._member import Member
from cpl.conformal.state import FloatArray, StateRule, feedback

__all__ = ["MEMBER", "UPOCP"]


@feedback
def _update(state: FloatArray, numbers: FloatArray, score: float, met: float) -> None:
    alpha = numbers[0]
    share = (state[2] + 0.5) / (state[3] + 1.0)
    if score > met:
        state[1] *= share / alpha
        state[2] += 1.0
    else:
        state[1] *= (1.0 - share) / (1.0 - alpha)
    state[3] += 1.0
    share = (state[2] + 0.5) / (state[3] + 1.0)
    state[0] = state[4] + (share - alpha) / (alpha * (1.0 - alpha)) * state[1]


@dataclass(frozen=True, kw_only=True, slots=True)
class UPOCP(StateRule):
    r"""Hold two assets in the proportion that a universal portfolio holds them in.

    A bet $\lambda$ on the next error multiplies the wealth by $1 + \lambda(\mathrm{err} - \alpha)$.
    The largest bets of both signs, $1/\alpha$ and $-1/(1-\alpha)$, are two assets of which exactly
    one pays: the first $1/\alpha$ after a miss, the second $1/(1-\alpha)$ after a covered score. A
    portfolio with the share b in the first is the bet

    $$ \lambda = \frac{b}{\alpha} - \frac{1-b}{1-\alpha} = \frac{b - \alpha}{\alpha(1-\alpha)},
       \qquad q_t = q_0 + \lambda_t W_{t-1}, \qquad b_t = \frac{N_{t-1} + 1/2}{t} $$

    and Cover's universal portfolio under the prior Dirichlet(1/2, 1/2) has that closed form, N
    being the number of misses, because no mixture of payments occurs.

    After Liu, Dobriban and Orabona (2026), who reduce the problem to two assets. The reduction
    above is ours: of the paper the abstract could be read, not the algorithm's constants. Against
    ``KT`` the share is measured in units of what alpha makes possible, so that the threshold
    answers a rare error alpha (1 - alpha) times as fast; and the first bet is not nothing.

    Late feedback is bet on as if it were prompt, as in ``KT``; the wealth then depends on the
    counts of misses and events alone.

    Args:
        wealth: The first wealth [score], > 0.

    Examples:
        The first share is 1/2 whatever alpha, but the first threshold is q0; after a miss b = 3/4.

        >>> from cpl.conformal import track
        >>> track([2.0, 2.0], UPOCP(wealth=1.0), alpha=0.5).q
        array([0., 1.])
    """

    wealth: float

    update = _update

    def __post_init__(self) -> None:
        object.__setattr__(self, "wealth", as_positive("wealth", self.wealth))

    def begin(self, alpha: float, q0: float) -> FloatArray:
        """Return the state: threshold, wealth, misses, events, first threshold."""
        return np.array([q0, self.wealth, 0.0, 0.0, q0])

    def numbers(self, alpha: float) -> FloatArray:
        """Return the settings."""
        return np.array([alpha])


MEMBER = Member(
    name="up_ocp",
    title="UP-OCP",
    year=2026,
    paper="liu2026online",
    make=lambda scale: UPOCP(wealth=scale),
    guarantee="finite-time error, growing scores too",
    tuning="nothing (the first wealth)",
    memory="5",
)
