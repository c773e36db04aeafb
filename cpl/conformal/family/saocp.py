r"""SAOCP: an SF-OGD expert born every step, each for a while, paid by betting on them."""

import math
from dataclasses import dataclass

import numpy as np
from numba import njit

from cpl.conformal._validate import as_integer, as_positive
from cpl.conformal.family._member import Member
from cpl.conformal.state import FloatArray, StateRule, feedback

__all__ = ["MEMBER", "SAOCP"]

_FIRST = 3  # threshold, time, number of experts; then the experts:
_PRIOR, _LIVES, _Q, _SQUARES, _WON, _BET, _AGE, _WIDE = range(8)
_OCTAVES = 40  # for 2**40 scores
_NOISE = 1e-12  # a gain below is the rounding of a gain of nothing


@njit(cache=True)
def _weight(state: FloatArray, e: int) -> float:
    return state[e + _WON] / state[e + _AGE] * (1.0 + state[e + _BET]) if state[e + _AGE] else 0.0


@njit(cache=True)
def _played(state: FloatArray, count: int) -> float:
    """Return the experts' weighted mean; the prior's where nobody has earned a weight."""
    total, mean, plain, plain_mean = 0.0, 0.0, 0.0, 0.0
    for k in range(count):
        e = _FIRST + _WIDE * k
        prior, weight = state[e + _PRIOR], max(_weight(state, e), 0.0)
        total += prior * weight
        mean += prior * weight * state[e + _Q]
        plain += prior
        plain_mean += prior * state[e + _Q]
    return mean / total if total > 0.0 else plain_mean / plain


@njit(cache=True)
def _turnover(state: FloatArray, lifetime: float) -> int:
    """Let the old go and one be born; return how many there are."""
    count = 0
    for k in range(int(state[2])):
        source, target = _FIRST + _WIDE * k, _FIRST + _WIDE * count
        if state[source + _AGE] <= state[source + _LIVES]:
            for j in range(_WIDE if k > count else 0):
                state[target + j] = state[source + j]
            count += 1
    time, born = state[1], _FIRST + _WIDE * count
    lives, part = lifetime, time
    while part % 2.0 == 0.0:
        part, lives = part / 2.0, lives * 2.0
    for j in range(_WIDE):
        state[born + j] = 0.0
    state[born + _PRIOR] = 1.0 / (time * time * (1.0 + math.floor(math.log2(time))))
    state[born + _LIVES], state[born + _Q] = lives, state[0]
    return count + 1


@feedback
def _update(state: FloatArray, numbers: FloatArray, score: float, met: float) -> None:
    alpha, scale = numbers[0], numbers[1]
    count = _turnover(state, numbers[2])
    shown, largest = _played(state, count), max(alpha, 1.0 - alpha)
    meta = max((1.0 - alpha) * (score - shown), alpha * (shown - score))
    for k in range(count):
        e = _FIRST + _WIDE * k
        weight, q = _weight(state, e), state[e + _Q]
        own = max((1.0 - alpha) * (score - q), alpha * (q - score))
        won = min((meta - own) / scale / largest, 1.0)
        won = max(won, -1.0 if weight > 0.0 else 0.0) if abs(won) > _NOISE else 0.0
        state[e + _WON] += won
        state[e + _BET] += won * weight
        state[e + _AGE] += 1.0
        gradient = 1.0 - alpha if score > q else -alpha
        state[e + _SQUARES] += gradient * gradient
        q += scale / math.sqrt(3.0 * state[e + _SQUARES]) * gradient
        state[e + _Q] = max(q, 0.0) if numbers[3] > 0.0 else q
    state[1], state[2] = state[1] + 1.0, float(count)
    state[0] = _played(state, count)


@dataclass(frozen=True, kw_only=True, slots=True)
class SAOCP(StateRule):
    r"""Run an SF-OGD expert from every time on, and weigh them by what a bettor on them has won.

    An expert born at time t starts at the threshold of then and lives for

    $$ L\, 2^{u(t)}, \qquad 2^{u(t)} \text{ the largest power of two that divides } t, $$

    so that some expert has always seen about the last n scores only, for every n. Its weight is the
    prior $1 / (t^2 (1 + \lfloor \log_2 t \rfloor))$ times the positive part of its bet
    $\tfrac1n \sum g\,(1 + \sum g w)$, with g by how much its pinball loss was below the mixture's,
    in units of the scale, never above 1, and never negative for one without a positive weight.

    Bhatnagar, Wang, Xiong and Bai (2023), algorithm 1, after Jun et al. (2017). Strongly adaptive:
    small regret on every interval. The number of experts grows like the logarithm of time.

    An expert that is alone in the mixture gains nothing over it. In floats it gains 1e-17 or loses
    as much, and in public code the sign of that then decides about all the weight; here a gain
    below 1e-12 is none.

    The public code keeps every expert at or above 0 (``clip``), which is this book's clipping trap:
    on scores that fall the mixture cannot come down to what the feedback asks for.

    Args:
        scale: The size of the scores [score], > 0.
        lifetime: L [steps], >= 1.
        clip: Whether experts are kept at or above 0.

    Examples:
        >>> from cpl.conformal import track
        >>> track([1.0, 1.0], SAOCP(scale=3.0**0.5), alpha=0.1).q.round(9)
        array([0., 1.])
    """

    scale: float
    lifetime: int = 8
    clip: bool = False

    update = _update

    def __post_init__(self) -> None:
        object.__setattr__(self, "scale", as_positive("scale", self.scale))
        object.__setattr__(self, "lifetime", as_integer("lifetime", self.lifetime, minimum=1))

    def begin(self, alpha: float, q0: float) -> FloatArray:
        """Return the state: threshold, time, and room for the experts."""
        # At most L / 2 + 2 of those whose lifetime is L 2**u live at a time.
        state = np.zeros(_FIRST + _WIDE * _OCTAVES * (self.lifetime // 2 + 3))
        state[0], state[1] = q0, 1.0
        return state

    def numbers(self, alpha: float) -> FloatArray:
        """Return the settings."""
        return np.array([alpha, self.scale, self.lifetime, self.clip], np.float64)


MEMBER = Member(
    name="saocp",
    title="SAOCP",
    year=2023,
    paper="bhatnagar2023improved",
    make=lambda scale: SAOCP(scale=scale),
    guarantee="regret on every interval; of the error only what regret implies",
    tuning="the scale, lifetime",
    memory="O(lifetime log T)",
    vectors="online-conformal 1.0.2",
)
