r"""Conformal PID: a fixed step, the saturated sum of the errors, and a forecast of the score."""

import math
from dataclasses import dataclass

import numpy as np

from cpl.conformal._validate import as_positive, as_share
from cpl.conformal.family._member import Member
from cpl.conformal.state import FloatArray, StateRule, feedback

__all__ = ["MEMBER", "PID"]


@feedback
def _update(state: FloatArray, numbers: FloatArray, score: float, met: float) -> None:
    alpha, eta, gain, saturation = numbers[0], numbers[1], numbers[2], numbers[3]
    missed = 1.0 if score > met else 0.0
    state[1] += eta * (missed - alpha)
    known = state[2]
    state[2] += missed
    state[3] += 1.0
    events = state[3]
    lift = 0.0
    if gain > 0.0:
        z = (known - (events - 1.0) * alpha) * math.log(events) / (saturation * events)
        if z >= 0.5 * math.pi:
            lift = math.inf
        elif z <= -0.5 * math.pi:
            lift = -math.inf
        else:
            lift = gain * math.tan(z)
    if events == 1.0:
        state[4] = score
    else:
        before = state[4]
        state[4] = numbers[4] * score + (1.0 - numbers[4]) * (before + state[5])
        state[5] = numbers[5] * (state[4] - before) + (1.0 - numbers[5]) * state[5]
    state[0] = state[1] + lift + state[4] + state[5]


@dataclass(frozen=True, kw_only=True, slots=True)
class PID(StateRule):
    r"""Add three answers: to the errors, to their sum, and to where the scores are going.

    $$ p_{t+1} = p_t + \eta(\mathrm{err}_t - \alpha), \qquad
       q_{t+1} = p_{t+1} + K_I \tan\Bigl(\frac{x_t \log(t+1)}{C_{sat}(t+1)}\Bigr) + g_{t+1} $$

    Angelopoulos, Candes and Tibshirani (2023), eq. (6), with the integral as in ``PI(lag=1)``. The
    scorecaster g is Holt's: a level and a trend, each exponentially smoothed. Their code takes
    statsmodels' Theta model, refitted at every step (O(t) a step; a level with drift in the end);
    ours costs O(1). The guarantee needs the scorecaster's error to be bounded, and comes from the
    integral.

    Args:
        eta: The step [score], > 0.
        K_I: The gain of the integral [score], >= 0.
        C_sat: Its saturation [-], > 0.
        level: The smoothing of the level [-], in (0, 1].
        trend: The smoothing of the trend [-], in [0, 1]; 0 for no trend.

    Examples:
        After the first score, 2.0: a miss moves p to 0.5, the level is the score, no trend yet.

        >>> from cpl.conformal import track
        >>> rule = PID(eta=1.0, K_I=0.0, C_sat=1.0, level=0.5, trend=0.0)
        >>> track([2.0, 2.0], rule, alpha=0.5).q
        array([0. , 2.5])
    """

    eta: float
    K_I: float
    C_sat: float
    level: float
    trend: float

    update = _update

    def __post_init__(self) -> None:
        object.__setattr__(self, "eta", as_positive("eta", self.eta))
        object.__setattr__(self, "K_I", as_positive("K_I", self.K_I, or_zero=True))
        object.__setattr__(self, "C_sat", as_positive("C_sat", self.C_sat))
        object.__setattr__(self, "level", as_share("level", self.level))
        object.__setattr__(self, "trend", as_share("trend", self.trend))

    def begin(self, alpha: float, q0: float) -> FloatArray:
        """Return the state: threshold, p, misses, events, level, trend."""
        return np.array([q0, q0, 0.0, 0.0, 0.0, 0.0])

    def numbers(self, alpha: float) -> FloatArray:
        """Return the settings."""
        return np.array([alpha, self.eta, self.K_I, self.C_sat, self.level, self.trend])


MEMBER = Member(
    name="pid",
    title="PID with a scorecaster",
    year=2023,
    paper="angelopoulos2023pid",
    make=lambda scale: PID(eta=0.1 * scale, K_I=0.5 * scale, C_sat=5.0, level=0.1, trend=0.0),
    guarantee="long-run error, where the scorecaster's error is bounded",
    tuning="step, gain, saturation, smoothing",
    memory="6",
    vectors="conformal-time-series, as kept by the code of ECI",
)
