r"""Bounds when feedback is late by varying amounts, out of order, lost, or wrong.

At any time at most `outstanding` thresholds have been issued whose feedback is still to come, the
newest included. Of the W scores of a window M are never fed back, F are reported as misses though
they were covered (false misses), G as covered though they were missed (false covers).

$$ -\Bigl(\frac B\eta + h + \alpha M + F + c\Bigr) < N_W - \alpha W <
   \frac B\eta + h + (1 - \alpha) M + G + d $$

c and d are what wrong feedback *before* the window may have left behind: at most the bursts in
excess of rates alpha (false misses) and 1 - alpha (false covers) that the tracker works off by
itself. With fixed delay h and no trouble this is `deviation_bound(..., delay=h)`. Proofs: the
certificates of `cpl.conformal.certificates.trouble`; every small case: `cpl.conformal.search`.
"""

from __future__ import annotations

import math
from fractions import Fraction

from cpl.conformal.bounds.window import QuantileRange
from cpl.conformal.rational import Number, count, level, like, positive

__all__ = ["max_errors_in_trouble", "min_errors_in_trouble", "troubled_range"]


def troubled_range(
    alpha: Number,
    eta: Number,
    B: Number,
    *,
    outstanding: int,
    burst_false_misses: int = 0,
    burst_false_covers: int = 0,
) -> QuantileRange:
    r"""Return the range of the virtual quantile.

    $$ -(h\alpha + d)\,\eta \le p_t < B + (h(1-\alpha) + c)\,\eta $$

    Args:
        alpha: miscoverage level in (0, 1).
        eta: step size > 0 [score].
        B: largest score > 0 [score].
        outstanding: h, thresholds whose feedback is still to come, the newest included [steps].
        burst_false_misses: c: among any n feedbacks at most c + alpha n are false misses.
        burst_false_covers: d: among any n feedbacks at most d + (1 - alpha) n are false covers.

    Examples:
        >>> troubled_range(0.1, 0.1, 1, outstanding=3, burst_false_misses=2).high
        1.47
    """
    a, step = level(alpha), positive(eta, "eta")
    h = count(outstanding, "outstanding")
    up = count(burst_false_misses, "burst_false_misses", least=0)
    down = count(burst_false_covers, "burst_false_covers", least=0)
    low, high = -(h * a + down) * step, positive(B, "B") + (h * (1 - a) + up) * step
    return QuantileRange(low=like(low, alpha, eta, B), high=like(high, alpha, eta, B))


def max_errors_in_trouble(
    alpha: Number,
    eta: Number,
    B: Number,
    W: int,
    *,
    outstanding: int,
    lost: int = 0,
    false_covers: int = 0,
    burst_false_covers: int = 0,
) -> int:
    """Return the most misses that W scores in a row can have.

    Args:
        alpha: miscoverage level in (0, 1).
        eta: step size > 0 [score].
        B: largest score > 0 [score].
        W: window length [steps].
        outstanding: thresholds whose feedback is still to come, the newest included [steps].
        lost: scores of the window that are never fed back.
        false_covers: misses of the window that are reported as covered.
        burst_false_covers: what false covers before the window may have left behind.

    Examples:
        A tenth of the feedback of 40 steps gets lost:

        >>> max_errors_in_trouble(0.1, 0.1, 1, 40, outstanding=1)
        14
        >>> max_errors_in_trouble(0.1, 0.1, 1, 40, outstanding=1, lost=4)
        18
    """
    a, length = level(alpha), count(W, "W")
    more = (
        _half(eta, B, outstanding)
        + (1 - a) * _within(lost, length, "lost")
        + _within(false_covers, length, "false_covers")
        + count(burst_false_covers, "burst_false_covers", least=0)
    )
    return min(length, math.ceil(a * length + more) - 1)


def min_errors_in_trouble(
    alpha: Number,
    eta: Number,
    B: Number,
    W: int,
    *,
    outstanding: int,
    lost: int = 0,
    false_misses: int = 0,
    burst_false_misses: int = 0,
) -> int:
    """Return the fewest misses that W scores in a row can have; see `max_errors_in_trouble`.

    Examples:
        >>> min_errors_in_trouble(0.1, 0.1, 1, 200, outstanding=3, lost=20)
        6
    """
    a, length = level(alpha), count(W, "W")
    less = (
        _half(eta, B, outstanding)
        + a * _within(lost, length, "lost")
        + _within(false_misses, length, "false_misses")
        + count(burst_false_misses, "burst_false_misses", least=0)
    )
    return max(0, math.floor(a * length - less) + 1)


def _half(eta: Number, B: Number, outstanding: int) -> Fraction:
    return positive(B, "B") / positive(eta, "eta") + count(outstanding, "outstanding")


def _within(value: int, length: int, name: str) -> int:
    if count(value, name, least=0) > length:
        msg = f"{name} must be at most W = {length}, got {value!r}"
        raise ValueError(msg)
    return value
