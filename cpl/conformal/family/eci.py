r"""Error-quantified conformal inference: how far off a score was counts, not only on which side."""

import math
from dataclasses import dataclass

import numpy as np

from cpl.conformal import _window
from cpl.conformal._validate import as_choice, as_integer, as_positive, as_share
from cpl.conformal.family._member import Member
from cpl.conformal.state import FloatArray, StateRule, feedback

__all__ = ["ECI", "FORMS", "MEMBER"]

FORMS = ("shown", "accumulated")
"""Where the error term goes: to the threshold that is shown only, or into the state as well."""

_P, _SUM, _WEIGHT, _WINDOW = 1, 2, 3, 4  # where things stand in the state


@feedback
def _update(state: FloatArray, numbers: FloatArray, score: float, met: float) -> None:
    alpha, eta, window, slope = numbers[0], numbers[1], int(numbers[2]), numbers[3]
    step, spread = eta, math.inf
    if window > 0 and _window.count(state, _WINDOW) > 0:
        most, least = (
            _window.greatest(state, _WINDOW, window),
            _window.least(state, _WINDOW, window),
        )
        spread = most - least
        step = eta * spread
    off = score - met
    # An infinite threshold would have been off by everything: the term tends to 0.
    bend = math.exp(-slope * abs(off)) if abs(off) < math.inf else 0.0
    term = off * slope * bend / ((1.0 + bend) * (1.0 + bend)) if bend > 0.0 else 0.0
    if numbers[5] > 0.0 and abs(off) < spread:
        term = 0.0
    if numbers[6] > 0.0:
        shown = state[_SUM] / state[_WEIGHT] if state[_WEIGHT] > 0.0 else 0.0
        state[_SUM] = numbers[6] * state[_SUM] + term
        state[_WEIGHT] = numbers[6] * state[_WEIGHT] + 1.0
        term = shown
    p = state[_P] + step * ((1.0 if score > met else 0.0) - alpha)
    state[0] = p + step * term
    state[_P] = state[0] if numbers[4] > 0.0 else p
    if window > 0:
        _window.push(state, _WINDOW, window, score)


@dataclass(frozen=True, kw_only=True, slots=True)
class ECI(StateRule):
    r"""Add to the feedback a smooth term that grows with how far off a score was.

    $$ q_{t+1} = q_t + \eta_t\bigl[\mathrm{err}_t - \alpha + (s_t - q_t) f'(s_t - q_t)\bigr],
       \qquad f(x) = \frac{1}{1 + e^{-c x}} $$

    Wu, Hu, Bao, Xia and Zou (2025), eq. (5), with $\eta_t = \eta$ times the range of the last
    ``window`` scores before this one (the first step is ``eta`` itself, and the second is 0), or
    ``eta`` alone for ``window=0``.

    Two readings differ more than their names: the update as printed takes the term into the state
    (``accumulated``); the public code adds it to the threshold that is shown and forgets it
    (``shown``). Only the second keeps the mean error near alpha. In the first, with a fixed step,
    the telescoped sum says that the mean error tends to alpha *minus the mean of the term*, and the
    term is negative wherever a score is covered: see the chapter "The family".

    Args:
        eta: The step: a share of the range [-], or [score] for ``window=0``; > 0.
        window: Scores whose range counts [steps], >= 0.
        slope: c [1 / score], > 0.
        form: One of ``FORMS``.
        cutoff: Whether the term counts only where a score is off by at least the range.
        decay: Weight of a step ago in the integrated form of the term [-], in [0, 1): 0.95 in the
            public code, whose newest term is left out; 0 for the newest term alone.

    Examples:
        A miss by 2: the term is 2 f'(2) with f'(2) = 0.105.

        >>> from cpl.conformal import track
        >>> track([2.0, 2.0], ECI(eta=1.0, window=0), alpha=0.5).q.round(3)
        array([0.  , 0.71])
    """

    eta: float
    window: int
    slope: float = 1.0
    form: str = "shown"
    cutoff: bool = False
    decay: float = 0.0

    update = _update

    def __post_init__(self) -> None:
        object.__setattr__(self, "eta", as_positive("eta", self.eta))
        object.__setattr__(self, "window", as_integer("window", self.window, minimum=0))
        object.__setattr__(self, "slope", as_positive("slope", self.slope))
        object.__setattr__(self, "decay", as_share("decay", self.decay, below=1.0))
        as_choice("form", self.form, FORMS)
        if self.cutoff and not self.window:
            raise ValueError(f"window must be >= 1 where there is a cutoff, got {self.window!r}")

    def begin(self, alpha: float, q0: float) -> FloatArray:
        """Return the state: threshold, p, the integrated term and its weight, the window."""
        state = np.zeros(_WINDOW + _window.size(self.window))
        state[0] = state[_P] = q0
        return state

    def numbers(self, alpha: float) -> FloatArray:
        """Return the settings."""
        form = FORMS.index(self.form)
        settings = [alpha, self.eta, self.window, self.slope, form, self.cutoff, self.decay]
        return np.array(settings, np.float64)


MEMBER = Member(
    name="eci",
    title="ECI",
    year=2025,
    paper="wu2025error",
    make=lambda scale: ECI(eta=0.1, window=100, slope=1.0 / scale),
    guarantee="long-run error in the form shown, if the step does not vanish; none accumulated",
    tuning="step, window, slope",
    memory="2 window + 6",
    vectors="the authors' code",
)
