"""The compiled inner loops: arrays in, arrays filled, no checks and no choices of meaning.

Every sum is formed in the same order and with the same operations as in the online tracker
(``p + step * (1 - alpha)`` after a miss, ``p - step * alpha`` after a covered score), so that the
two give the same bits. A kernel fills ``q`` only: ``err`` is ``scores > q``, by definition.
"""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

__all__ = [
    "LANES",
    "decay",
    "follow",
    "follow_counts",
    "follow_lanes",
    "follow_pi",
    "rolling_max",
]

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

LANES = 4  # streams that follow_lanes advances side by side


@njit(cache=True)
def follow(
    scores: FloatArray,
    steps: FloatArray,
    stride: int,
    ends: IntArray,
    delay: int,
    alpha: float,
    q0: float,
    q: FloatArray,
) -> float:
    """Fill ``q`` with the thresholds of one stream and return the state after its last event.

    ``steps[stride * t]`` is the step of event t (stride 0: one step for all). ``ends`` are the
    episodes' ends; what is still under way when an episode ends is never fed back.
    """
    p = q0
    beta = 1.0 - alpha
    start = 0
    for end in ends:
        if delay == 1:
            for t in range(start, end):
                q[t] = p
                step = steps[stride * t]
                # Both outcomes are formed before the comparison is known: it is the latter that
                # the next round waits for. (Writing err here as well would cost 2 ns a step.)
                above = p + step * beta
                below = p - step * alpha
                p = above if scores[t] > p else below
        else:
            for t in range(start, end):
                q[t] = p
                i = t - delay + 1
                if i >= start:
                    step = steps[stride * i]
                    p = p + step * beta if scores[i] > q[i] else p - step * alpha
        start = end
    return p


@njit(cache=True)
def follow_lanes(
    scores: FloatArray,
    steps: FloatArray,
    row_stride: int,
    stride: int,
    delay: int,
    alpha: float,
    q0: float,
    q: FloatArray,
    last: FloatArray,
) -> None:
    """Do ``follow`` for four streams at a time, one episode each.

    One stream waits for its own last sum in every step; four of them fill each other's waits.
    The number of streams is a multiple of four.
    """
    beta = 1.0 - alpha
    streams, length = scores.shape
    for n in range(0, streams, LANES):
        a = b = c = d = q0
        for t in range(length):
            q[n, t] = a
            q[n + 1, t] = b
            q[n + 2, t] = c
            q[n + 3, t] = d
            i = t - delay + 1
            if i >= 0:
                k = stride * i
                step = steps[row_stride * n, k]
                a = a + step * beta if scores[n, i] > q[n, i] else a - step * alpha
                step = steps[row_stride * (n + 1), k]
                b = b + step * beta if scores[n + 1, i] > q[n + 1, i] else b - step * alpha
                step = steps[row_stride * (n + 2), k]
                c = c + step * beta if scores[n + 2, i] > q[n + 2, i] else c - step * alpha
                step = steps[row_stride * (n + 3), k]
                d = d + step * beta if scores[n + 3, i] > q[n + 3, i] else d - step * alpha
        last[n] = a
        last[n + 1] = b
        last[n + 2] = c
        last[n + 3] = d


@njit(cache=True)
def follow_pi(
    scores: FloatArray,
    steps: FloatArray,
    stride: int,
    ends: IntArray,
    delay: int,
    alpha: float,
    q0: float,
    K_I: float,
    C_sat: float,
    lag: int,
    q: FloatArray,
) -> float:
    """Do ``follow`` with the saturated integral of the errors added to each threshold."""
    p = q0
    shown = q0
    beta = 1.0 - alpha
    misses = 0
    events = 0
    start = 0
    for end in ends:
        for t in range(start, end):
            q[t] = shown
            i = t - delay + 1
            if i >= start:
                step = steps[stride * i]
                missed = scores[i] > q[i]
                p = p + step * beta if missed else p - step * alpha
                known = misses
                misses += 1 if missed else 0
                events += 1
                if lag == 0:
                    known = misses
                x = known - (events - lag) * alpha
                z = x * math.log(events) / (C_sat * events)
                if K_I == 0.0:
                    shown = p
                elif z >= 0.5 * math.pi:
                    shown = math.inf
                elif z <= -0.5 * math.pi:
                    shown = -math.inf
                else:
                    shown = p + K_I * math.tan(z)
        start = end
    return p


@njit(cache=True)
def follow_counts(
    scores: FloatArray,
    eta: float,
    numerator: int,
    denominator: int,
    delay: int,
    q0: float,
    q: FloatArray,
    known: IntArray,
) -> None:
    """Fill ``q`` and ``known`` misses for a fixed step; nothing is accumulated but integers."""
    misses = 0
    balance = 0  # denominator * misses - numerator * events
    for t in range(scores.size):
        known[t] = misses
        q[t] = q0 + eta * (balance / denominator)
        i = t - delay + 1
        if i >= 0:
            if scores[i] > q[i]:
                misses += 1
                balance += denominator
            balance -= numerator


@njit(cache=True)
def rolling_max(rows: FloatArray, window: int, out: FloatArray) -> None:
    """Fill ``out[n, t]`` with the maximum of ``rows[n, max(t - window + 1, 0) : t + 1]``.

    Van Herk's and Gil and Werman's way: cut a row into blocks of one window; any window is the
    tail of one block and the head of the next, and both have running maxima. About three
    comparisons an entry whatever the window.
    """
    streams, length = rows.shape
    tail = np.empty(min(window, length))
    for n in range(streams):
        for begin in range(0, length, window):
            end = min(begin + window, length)
            head = -math.inf
            for t in range(begin, end):
                head = max(head, rows[n, t])
                out[n, t] = head
                # tail[j] is the maximum of the block before from its j-th entry on.
                if begin > 0 and t - begin + 1 < window:
                    out[n, t] = max(head, tail[t - begin + 1])
            if end < length:
                rest = -math.inf
                for j in range(window - 1, -1, -1):
                    rest = max(rest, rows[n, begin + j])
                    tail[j] = rest


@njit(cache=True)
def decay(c: float, power: float, steps: FloatArray) -> None:
    """Fill ``steps[t]`` with ``c * (t + 1) ** -power``."""
    for t in range(steps.size):
        steps[t] = c * math.pow(t + 1.0, -power)
