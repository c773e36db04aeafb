r"""Conformal decision theory: the threshold answers to a loss, not to an error."""

from dataclasses import dataclass

import numpy as np

from cpl.conformal._validate import as_positive
from cpl.conformal.family._member import Member
from cpl.conformal.state import FloatArray, StateRule, feedback

__all__ = ["MEMBER", "DecisionTheory"]


@feedback
def _update(state: FloatArray, numbers: FloatArray, score: float, met: float) -> None:
    alpha, eta, ramp = numbers[0], numbers[1], numbers[2]
    loss = min(max((score - met) / ramp, 0.0), 1.0)
    state[0] += eta * (loss - alpha)


@dataclass(frozen=True, kw_only=True, slots=True)
class DecisionTheory(StateRule):
    r"""Move by a loss in [0, 1] that any caution makes smaller.

    $$ q_{t+1} = q_t + \eta\,(\ell_t - \alpha), \qquad
       \ell_t = \min\Bigl(\max\Bigl(\frac{s_t - q_t}{R}, 0\Bigr), 1\Bigr) $$

    Lekeufack, Angelopoulos, Bajcsy, Jordan and Malik (2024), eq. (2), with caution for their
    boldness (the sign is turned). The loss is any number the world hands back: here how far the
    score went beyond the threshold, as a share of the reach. For scores in [0, B] no loss is left
    from B on, so the mean *loss* is within (B + eta) / (eta T) of alpha. Errors are not counted:
    many small ones may pass.

    Args:
        eta: The step [score], > 0.
        reach: R, the excess of a whole loss [score], > 0.

    Examples:
        >>> from cpl.conformal import track
        >>> track([1.0, 0.0], DecisionTheory(eta=1.0, reach=2.0), alpha=0.25).q
        array([0.  , 0.25])
    """

    eta: float
    reach: float

    update = _update

    def __post_init__(self) -> None:
        object.__setattr__(self, "eta", as_positive("eta", self.eta))
        object.__setattr__(self, "reach", as_positive("reach", self.reach))

    def begin(self, alpha: float, q0: float) -> FloatArray:
        """Return the state: the threshold."""
        return np.array([q0])

    def numbers(self, alpha: float) -> FloatArray:
        """Return the settings."""
        return np.array([alpha, self.eta, self.reach])


MEMBER = Member(
    name="decision",
    title="Decision theory",
    year=2024,
    paper="lekeufack2024decision",
    make=lambda scale: DecisionTheory(eta=0.1 * scale, reach=0.5 * scale),
    guarantee="mean loss within (B + eta) / (eta T) of alpha; no count of errors",
    tuning="step, loss",
    memory="1",
    vectors="conformal-decision",
)
