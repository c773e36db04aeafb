"""What the window bounds mean over time: when they begin to say something, and what resets cost."""

# pyright: reportMissingTypeStubs=false
from __future__ import annotations

import math
from collections.abc import Iterable
from fractions import Fraction
from typing import TYPE_CHECKING

from cpl.conformal.bounds.window import (
    error_rate_bound,
    max_errors,
    max_errors_from_start,
    min_errors,
)
from cpl.conformal.rational import Number, count, level, like, positive

if TYPE_CHECKING:
    import pandas as pd

__all__ = [
    "error_rate_bound_with_resets",
    "interleaved_deviation_bound",
    "latch_ratio",
    "longest_miss_run",
    "smallest_informative_window",
    "smallest_two_sided_window",
    "unscored_predictions",
    "window_table",
]


def smallest_informative_window(alpha: Number, eta: Number, B: Number, *, delay: int = 1) -> int:
    r"""Return the smallest `W` for which anything at all is promised: `max_errors < W`.

    $$W \ge \frac{B/\eta + h}{1-\alpha}$$

    In every shorter window all predictions may be wrong.

    Paper: against "for all possible windows in time, the coverage will be met" (erratum 12).

    Examples:
        By hand: 11 / 0.9 = 12.2, so windows of 12 steps and fewer promise nothing.

        >>> smallest_informative_window(0.1, 0.1, 1), smallest_informative_window(0.2, 0.1, 1)
        (13, 14)
    """
    a, ratio = level(alpha), positive(B, "B") / positive(eta, "eta")
    return math.ceil((ratio + count(delay, "delay")) / (1 - a))


def smallest_two_sided_window(alpha: Number, eta: Number, B: Number, *, delay: int = 1) -> int:
    r"""Return the smallest `W` for which at least one miss is certain: `min_errors > 0`.

    $$W \ge \frac{B/\eta + h}{\alpha}$$

    Examples:
        By hand: 11 / 0.1 = 110 steps.

        >>> smallest_two_sided_window(0.1, 0.1, 1), smallest_two_sided_window(0.2, 0.1, 1)
        (110, 55)
    """
    a, ratio = level(alpha), positive(B, "B") / positive(eta, "eta")
    return math.ceil((ratio + count(delay, "delay")) / a)


def longest_miss_run(alpha: Number, eta: Number, B: Number, *, delay: int = 1) -> int:
    r"""Return the length of the longest possible run of consecutive misses, for $q_1=0$.

    $$\Bigl\lceil \frac{B/\eta + h}{1-\alpha} \Bigr\rceil - 1$$

    One less than the smallest informative window. Attained for every delay: keep the score at 0
    until the feedback has pushed the quantile down, then show `B`.

    Examples:
        By hand: from -0.01, twelve steps of +0.09 lead to 1.07; the twelfth starts at 0.98 < 1.

        >>> longest_miss_run(0.1, 0.1, 1), longest_miss_run(0.1, 0.1, 1, delay=3)
        (12, 14)
    """
    return smallest_informative_window(alpha, eta, B, delay=delay) - 1


def interleaved_deviation_bound(
    alpha: Number, eta: Number, B: Number, *, trackers: int
) -> float | Fraction:
    r"""Return the strict two-sided bound for `h` interleaved trackers, each with prompt feedback.

    $$|N_W - \alpha W| < h\,(B/\eta + 1)$$

    Tracker `j` handles the times `t = j mod h`, so a feedback delay `h` never bites; but each
    tracker has to climb from 0 to `B` by itself. One tracker that simply waits has the smaller
    `B/eta + h` (`deviation_bound`).

    Examples:
        By hand: 3 * 11 = 33, where one tracker with delay 3 is held to 10 + 3 = 13.

        >>> interleaved_deviation_bound(0.1, 0.1, 1, trackers=3)
        33.0
    """
    level(alpha)
    ratio = positive(B, "B") / positive(eta, "eta")
    return like(count(trackers, "trackers") * (ratio + 1), alpha, eta, B)


def unscored_predictions(T: int, *, delay: int = 1) -> int:
    """Return how many of an episode's `T` predictions never influence a threshold of that episode.

    The score of time `t` is known when `q[t + delay]` is formed, so the last `delay` scores come
    too late. A tracker that is reset at the end of each episode never learns from them.

    Examples:
        >>> unscored_predictions(40, delay=3)
        3
    """
    return min(count(T, "T"), count(delay, "delay"))


def error_rate_bound_with_resets(
    alpha: Number, eta: Number, B: Number, *, episode_length: int, delay: int = 1
) -> float | Fraction:
    r"""Return the largest long-run error rate if `q` is reset to 0 at the start of each episode.

    $$\frac{1}{L}\min\bigl(L, \lceil B/\eta + \alpha(L-h)\rceil + h - 1\bigr)$$

    The guarantee restarts with the quantile: it does not average out over episodes. Carried over,
    the same tracker is held to `alpha` in the long run.

    Examples:
        By hand: ceil(10 + 0.1 * 39) = 14 of 40.

        >>> error_rate_bound_with_resets(0.1, 0.1, 1, episode_length=40)
        0.35
    """
    length = count(episode_length, "episode_length")
    errors = max_errors_from_start(alpha, eta, B, length, delay=delay)
    return like(Fraction(errors, length), alpha, eta, B)


def latch_ratio(alpha: Number) -> float | Fraction:
    r"""Return how many covered steps it takes to undo one miss: $(1-\alpha)/\alpha$.

    The quantile climbs in steps of $(1-\alpha)\eta$ and falls in steps of
    $\alpha\eta$: a fast attack and a slow release, like a latched alarm.

    Examples:
        >>> latch_ratio(0.1)
        9.0
    """
    a = level(alpha)
    return like((1 - a) / a, alpha)


def window_table(
    alpha: Number, eta: Number, B: Number, windows: Iterable[int], *, delay: int = 1
) -> pd.DataFrame:
    """Return the bounds side by side, one row a window length.

    Returns:
        Columns `W` [steps], `theorem_rate` (the paper's bound), `max_errors`, `min_errors`,
        `max_rate` and `min_rate` (the exact extremes), and `informative`.

    Examples:
        >>> window_table(0.1, 0.1, 1, [5, 40])[["W", "theorem_rate", "max_rate", "informative"]]
            W  theorem_rate  max_rate  informative
        0   5         2.300      1.00        False
        1  40         0.375      0.35         True
    """
    import pandas as pd

    rows = [
        {
            "W": W,
            "theorem_rate": float(error_rate_bound(alpha, eta, B, W, delay=delay)),
            "max_errors": (most := max_errors(alpha, eta, B, W, delay=delay)),
            "min_errors": (least := min_errors(alpha, eta, B, W, delay=delay)),
            "max_rate": most / W,
            "min_rate": least / W,
            "informative": most < W,
        }
        for W in windows
    ]
    return pd.DataFrame(rows)
