r"""The quantile of the last scores: the plain rival that knows no feedback."""

from dataclasses import dataclass

import numpy as np

from cpl.conformal import _window
from cpl.conformal._validate import as_choice, as_integer
from cpl.conformal.family._member import Member
from cpl.conformal.state import FloatArray, StateRule, feedback

__all__ = ["MEMBER", "Rolling"]


@feedback
def _update(state: FloatArray, numbers: FloatArray, score: float, met: float) -> None:
    window = int(numbers[1])
    _window.push(state, 1, window, score)
    state[0] = _window.quantile(state, 1, window, 1.0 - numbers[0], numbers[2])


@dataclass(frozen=True, kw_only=True, slots=True)
class Rolling(StateRule):
    r"""Read the threshold off the last scores, whatever it missed.

    $$ q_{t+1} = \hat Q(s_{t-w+1}, \dots, s_t;\ 1 - \alpha) $$

    Right for scores that are exchangeable within the window, at any time and without a step; on
    others it may miss every score: whatever grows by more than a window holds is never covered.
    With the convention ``corrected`` the threshold is infinite until there are 1 / alpha scores.

    Args:
        window: Scores that count [steps], >= 1.
        quantile: How a quantile is read off them, one of ``CONVENTIONS``.

    Examples:
        >>> from cpl.conformal import track
        >>> track([3.0, 1.0, 2.0, 5.0], Rolling(window=2), alpha=0.5).q
        array([0., 3., 1., 1.])
    """

    window: int
    quantile: str = "inverted_cdf"

    update = _update

    def __post_init__(self) -> None:
        object.__setattr__(self, "window", as_integer("window", self.window, minimum=1))
        as_choice("quantile", self.quantile, _window.CONVENTIONS)

    def begin(self, alpha: float, q0: float) -> FloatArray:
        """Return the state: threshold and window."""
        state = np.zeros(1 + _window.size(self.window))
        state[0] = q0
        return state

    def numbers(self, alpha: float) -> FloatArray:
        """Return the settings."""
        convention = _window.CONVENTIONS.index(self.quantile)
        return np.array([alpha, self.window, convention], np.float64)


MEMBER = Member(
    name="rolling",
    title="Rolling quantile",
    year=2023,
    paper="angelopoulos2023pid",
    make=lambda scale: Rolling(window=100),
    guarantee="none; right for exchangeable scores",
    tuning="window",
    memory="2 window + 3",
    vectors="numpy",
)
