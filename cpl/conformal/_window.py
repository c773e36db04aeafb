"""The last scores of a state rule, in order of time and of size, within its array of state.

A window of w scores takes 2 w + 2 numbers from ``at`` on: how many there are, where the oldest
stands, the scores in a ring, the same sorted. A score is put in by moving at most w numbers: for
the windows in use that is faster than any tree.

Numba compiles these functions into the updates that call them and does not see, when it looks for
a compiled update on disk, that they have changed: delete ``__pycache__`` after a change here.
"""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

__all__ = [
    "CONVENTIONS",
    "at_most",
    "below",
    "count",
    "greatest",
    "least",
    "push",
    "quantile",
    "size",
]

FloatArray = NDArray[np.float64]

CONVENTIONS = ("inverted_cdf", "corrected", "higher", "linear")
"""How a quantile is read off n sorted scores.

- ``inverted_cdf``: the ceil(p n)-th, the definition of most papers;
- ``corrected``: the ceil(p (n + 1))-th, infinite beyond the n-th: split conformal's;
- ``higher``: the first at or above the place p (n - 1), counted from 0 (numpy's "higher");
- ``linear``: between the two about that place (numpy's default).
"""


def size(window: int) -> int:
    """Return how many numbers a window takes."""
    return 2 * window + 2


@njit(cache=True)
def count(state: FloatArray, at: int) -> int:
    """Return how many scores there are."""
    return int(state[at])


@njit(cache=True)
def least(state: FloatArray, at: int, window: int) -> float:
    """Return the least score; there must be one."""
    return state[at + 2 + window]


@njit(cache=True)
def greatest(state: FloatArray, at: int, window: int) -> float:
    """Return the greatest score; there must be one."""
    return state[at + 1 + window + int(state[at])]


@njit(cache=True)
def at_most(state: FloatArray, at: int, window: int, value: float) -> int:
    """Return how many scores are at most ``value``."""
    first, n = at + 2 + window, int(state[at])
    # Halving without a branch: a wrong guess of the processor costs more than the search.
    while n > 1:
        half = n >> 1
        first += half * int(state[first + half - 1] <= value)
        n -= half
    last = 1 if n == 1 and state[first] <= value else 0
    return first - (at + 2 + window) + last


@njit(cache=True)
def below(state: FloatArray, at: int, window: int, value: float) -> int:
    """Return how many scores are below ``value``."""
    first, n = at + 2 + window, int(state[at])
    while n > 1:
        half = n >> 1
        first += half * int(state[first + half - 1] < value)
        n -= half
    last = 1 if n == 1 and state[first] < value else 0
    return first - (at + 2 + window) + last


@njit(cache=True)
def _down(state: FloatArray, start: int, stop: int) -> None:
    """Move what stands in (start, stop] down by one, four at a time, which go in one register."""
    k = start
    while k + 4 <= stop:
        a, b, c, d = state[k + 1], state[k + 2], state[k + 3], state[k + 4]
        state[k], state[k + 1], state[k + 2], state[k + 3] = a, b, c, d
        k += 4
    while k < stop:
        state[k] = state[k + 1]
        k += 1


@njit(cache=True)
def _up(state: FloatArray, start: int, stop: int) -> None:
    """Move what stands in [stop, start) up by one."""
    k = start
    while k - 4 >= stop:
        a, b, c, d = state[k - 4], state[k - 3], state[k - 2], state[k - 1]
        state[k - 3], state[k - 2], state[k - 1], state[k] = a, b, c, d
        k -= 4
    while k > stop:
        state[k] = state[k - 1]
        k -= 1


@njit(cache=True)
def push(state: FloatArray, at: int, window: int, score: float) -> None:
    """Take a score in; of a full window the oldest goes."""
    n, head = int(state[at]), int(state[at + 1])
    ring, base = at + 2, at + 2 + window
    old = state[ring + head] if n == window else score
    # To count all is faster than to search: the processor compares several at a time.
    to, gap = 0, 0
    for k in range(base, base + n):
        to += int(state[k] < score)
        gap += int(state[k] < old)
    if n == window:
        state[ring + head] = score
        state[at + 1] = head + 1 if head + 1 < window else 0
        # What lies between the gap of the old one and the new one's place moves into the gap.
        if to > gap:
            to -= 1
            _down(state, base + gap, base + to)
        else:
            _up(state, base + gap, base + to)
        state[base + to] = score
        return
    state[ring + n] = score  # the ring is not full, so its oldest stands at its beginning
    _up(state, base + n, base + to)
    state[base + to] = score
    state[at] = n + 1


@njit(cache=True)
def quantile(state: FloatArray, at: int, window: int, p: float, convention: float) -> float:
    """Return the p-quantile of at least one score; infinite where the level leaves [0, 1]."""
    n, base = int(state[at]), at + 2 + window
    if p > 1.0:
        return math.inf
    if p < 0.0:
        return -math.inf
    if convention == 3.0:
        place = p * (n - 1)
        k = math.floor(place)
        if k >= n - 1:
            return state[base + n - 1]
        return state[base + k] + (place - k) * (state[base + k + 1] - state[base + k])
    if convention == 2.0:
        k = math.ceil(p * (n - 1)) + 1
    elif convention == 1.0:
        k = math.ceil(p * (n + 1))
        if k > n:
            return math.inf
    else:
        k = math.ceil(p * n)
    return state[base + min(max(k, 1), n) - 1]
