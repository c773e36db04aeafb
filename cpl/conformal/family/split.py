r"""Split conformal: a threshold from the first scores, frozen."""

from dataclasses import dataclass

import numpy as np

from cpl.conformal import _window
from cpl.conformal._validate import as_integer
from cpl.conformal.family._member import Member
from cpl.conformal.state import FloatArray, StateRule, feedback

__all__ = ["MEMBER", "Split"]

_CORRECTED = float(_window.CONVENTIONS.index("corrected"))


@feedback
def _update(state: FloatArray, numbers: FloatArray, score: float, met: float) -> None:
    window = int(numbers[1])
    if _window.count(state, 1) < window:
        _window.push(state, 1, window, score)
        if _window.count(state, 1) == window:
            state[0] = _window.quantile(state, 1, window, 1.0 - numbers[0], _CORRECTED)


@dataclass(frozen=True, kw_only=True, slots=True)
class Split(StateRule):
    r"""Wait for n scores, take their corrected quantile, and never move again.

    $$ q = s_{(\lceil (1 - \alpha)(n + 1) \rceil)} $$

    Papadopoulos et al. (2002). A new score that is exchangeable with the first n is covered with a
    probability of at least 1 - alpha; once the world has changed, nothing is promised. Until the
    n-th score the threshold is q0; too small an n gives an infinite one.

    Args:
        calibration: n [steps], >= 1.

    Examples:
        >>> from cpl.conformal import track
        >>> track([3.0, 1.0, 2.0, 9.0, 9.0], Split(calibration=3), alpha=0.5).q
        array([0., 0., 0., 2., 2.])
    """

    calibration: int

    update = _update

    def __post_init__(self) -> None:
        count = as_integer("calibration", self.calibration, minimum=1)
        object.__setattr__(self, "calibration", count)

    def begin(self, alpha: float, q0: float) -> FloatArray:
        """Return the state: threshold and the scores waited for."""
        state = np.zeros(1 + _window.size(self.calibration))
        state[0] = q0
        return state

    def numbers(self, alpha: float) -> FloatArray:
        """Return the settings."""
        return np.array([alpha, self.calibration], np.float64)


MEMBER = Member(
    name="split",
    title="Split conformal",
    year=2002,
    paper="papadopoulos2002inductive",
    make=lambda scale: Split(calibration=100),
    guarantee="coverage of exchangeable scores; none after a shift",
    tuning="calibration scores",
    memory="2 calibration + 3",
    vectors="dracp 0.2.0",
)
