r"""Adaptive conformal inference: the level moves, the threshold is a quantile of past scores."""

import math
from dataclasses import dataclass

import numpy as np

from cpl.conformal import _window
from cpl.conformal._validate import as_choice, as_integer, as_positive
from cpl.conformal.family._member import Member
from cpl.conformal.state import FloatArray, StateRule, feedback

__all__ = ["ACI", "MEMBER"]

_LEVEL, _WINDOW = 1, 2  # where things stand in the state


@feedback
def _update(state: FloatArray, numbers: FloatArray, score: float, met: float) -> None:
    alpha, gamma, window = numbers[0], numbers[1], int(numbers[2])
    error = 1.0 if score > met else 0.0
    level = state[_LEVEL] + gamma * (alpha - error)
    if numbers[4] > 0.0:
        level = min(max(level, 0.0), 1.0)
    state[_LEVEL] = level
    _window.push(state, _WINDOW, window, score)
    state[0] = _window.quantile(state, _WINDOW, window, 1.0 - level, numbers[3])


@dataclass(frozen=True, kw_only=True, slots=True)
class ACI(StateRule):
    r"""Let the level pay for errors, and read the threshold off the last scores.

    $$ \alpha_{t+1} = \alpha_t + \gamma (\alpha - \mathrm{err}_t), \qquad
       q_{t+1} = \hat Q_t(1 - \alpha_{t+1}) $$

    Gibbs and Candes (2021), eq. (2), with a window in place of all past scores. A level below 0
    gives an infinite threshold, one above 1 minus infinity: that is part of the rule, and it is
    what bounds the error, for any scores and without a bound on them:

    $$ \Bigl|\tfrac1T \sum_t \mathrm{err}_t - \alpha\Bigr|
       \le \frac{\max(\alpha, 1 - \alpha) + \gamma}{\gamma T} . $$

    Public code departs in two places: in how a quantile is read off a sample (``quantile``), and in
    keeping the level within [0, 1] (``clip``), after which the greatest score may be missed for
    ever and the bound is gone.

    Args:
        gamma: The step of the level [-], > 0.
        window: Scores that count [steps], >= 1.
        quantile: How a quantile is read off the window, one of ``CONVENTIONS``.
        clip: Whether the level is kept within [0, 1].

    Examples:
        The first score is all that is known of the scores: it is the next threshold.

        >>> from cpl.conformal import track
        >>> track([3.0, 1.0, 2.0], ACI(gamma=0.05, window=10), alpha=0.5).q
        array([0., 3., 1.])
    """

    gamma: float
    window: int
    quantile: str = "inverted_cdf"
    clip: bool = False

    update = _update

    def __post_init__(self) -> None:
        object.__setattr__(self, "gamma", as_positive("gamma", self.gamma))
        object.__setattr__(self, "window", as_integer("window", self.window, minimum=1))
        as_choice("quantile", self.quantile, _window.CONVENTIONS)

    def begin(self, alpha: float, q0: float) -> FloatArray:
        """Return the state: threshold, level, and the window."""
        state = np.zeros(_WINDOW + _window.size(self.window))
        state[0], state[_LEVEL] = q0, alpha
        return state

    def numbers(self, alpha: float) -> FloatArray:
        """Return the settings."""
        convention = _window.CONVENTIONS.index(self.quantile)
        return np.array([alpha, self.gamma, self.window, convention, self.clip], np.float64)

    def most_errors(self, *, alpha: float, B: float, T: int) -> int | None:
        """Return the published bound, whatever the scores; none where the level is clipped."""
        if self.clip:
            return None
        more = (max(alpha, 1.0 - alpha) + self.gamma) / self.gamma
        return min(T, math.floor(alpha * T + more))


MEMBER = Member(
    name="aci",
    title="ACI",
    year=2021,
    paper="gibbs2021adaptive",
    make=lambda scale: ACI(gamma=0.02, window=100),
    guarantee="error within (max(alpha, 1 - alpha) + gamma) / (gamma T), any scores",
    tuning="gamma, window",
    memory="2 window + 4",
    vectors="adaptive-conformal-inference 1.0.1",
)
