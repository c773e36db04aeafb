r"""Conformal optimistic prediction: step to where the scores seen so far say one will be sent."""

import math
from dataclasses import dataclass

import numpy as np

from cpl.conformal import _window
from cpl.conformal._validate import as_integer, as_positive
from cpl.conformal.family._member import Member
from cpl.conformal.state import FloatArray, StateRule, feedback

__all__ = ["COP", "MEMBER"]


@feedback
def _update(state: FloatArray, numbers: FloatArray, score: float, met: float) -> None:
    alpha, eta, window = numbers[0], numbers[1], int(numbers[2])
    state[1] += eta * ((1.0 if score > met else 0.0) - alpha)
    _window.push(state, 2, window, score)
    share = _window.at_most(state, 2, window, state[1]) / _window.count(state, 2)
    state[0] = state[1] + eta * (1.0 - alpha - share)


@dataclass(frozen=True, kw_only=True, slots=True)
class COP(StateRule):
    r"""Follow the errors, and go ahead by the error that an estimated distribution expects.

    $$ p_{t+1} = p_t + \eta(\mathrm{err}_t - \alpha), \qquad
       q_{t+1} = p_{t+1} + \eta\bigl(1 - \hat F_t(p_{t+1}) - \alpha\bigr) $$

    After Hu, Wu, Xia and Zou (2026): optimistic gradient descent, the next gradient guessed from
    the scores' distribution, here that of the last ``window`` scores. Of the paper the abstract
    could be read, not the exact algorithm: this is its plain form with a fixed step.

    Whatever the guess, it is an error less alpha, in $[-\alpha, 1 - \alpha]$. A miss needs
    $q_t < B$, so $p_t < B + \alpha\eta$; a covered score needs $p_t \ge -(1-\alpha)\eta$. Hence p
    stays in $[-\eta, B + \eta)$, and for scores in [0, B]

    $$ \Bigl|\sum_{t=T_0}^{T_0+W-1} (\mathrm{err}_t - \alpha)\Bigr| < B / \eta + 2 . $$

    Args:
        eta: The step [score], > 0.
        window: Scores that the distribution is estimated from [steps], >= 1.

    Examples:
        One score, 2: p = 0.5 after the miss; none of the scores is at most 0.5, so go on by 0.5.

        >>> from cpl.conformal import track
        >>> track([2.0, 2.0], COP(eta=1.0, window=10), alpha=0.5).q
        array([0., 1.])
    """

    eta: float
    window: int

    update = _update

    def __post_init__(self) -> None:
        object.__setattr__(self, "eta", as_positive("eta", self.eta))
        object.__setattr__(self, "window", as_integer("window", self.window, minimum=1))

    def begin(self, alpha: float, q0: float) -> FloatArray:
        """Return the state: threshold, p, and the window."""
        state = np.zeros(2 + _window.size(self.window))
        state[0] = state[1] = q0
        return state

    def numbers(self, alpha: float) -> FloatArray:
        """Return the settings."""
        return np.array([alpha, self.eta, self.window], np.float64)

    def most_errors(self, *, alpha: float, B: float, T: int) -> int | None:
        """Return the bound of every window, from the walls of p."""
        return min(T, math.floor(alpha * T + B / self.eta + 2.0))


MEMBER = Member(
    name="cop",
    title="COP",
    year=2026,
    paper="hu2026distribution",
    make=lambda scale: COP(eta=0.1 * scale, window=100),
    guarantee="error within (B / eta + 2) / W in every window",
    tuning="step, window",
    memory="2 window + 4",
)
