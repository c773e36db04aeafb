r"""How often the fixed-step tracker can miss in a window: Theorem 1, corrected and made exact.

Scores :math:`s_t\in[0,B]`, misses :math:`\mathrm{err}_t = 1\{s_t > q_t\}`, and

.. math:: q_{t+1} = q_t + \eta\,(\mathrm{err}_t - \alpha),\qquad q_1 = 0.

With feedback delay `h` (the score of time `t` is known when `q[t+h]` is formed) the update uses
:math:`\mathrm{err}_{t+1-h}`, and nothing happens before the first score is known; `h = 1` is
ordinary feedback. :math:`N_W` is the number of misses in the `W` terms
:math:`t = T_0,\dots,T_0+W-1`.

Everything follows from one identity. The *virtual quantile* :math:`p_t = q_1 + \eta\sum_{i<t}
(\mathrm{err}_i-\alpha)` has already swallowed the feedback that is still under way (without delay
:math:`p_t = q_t`), so :math:`N_W = \alpha W + (p_{T_0+W} - p_{T_0})/\eta`, and `p` stays in the
half-open interval that `quantile_range` returns.
"""

# pyright: reportMissingTypeStubs=false
from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import TYPE_CHECKING

from cpl.conformal.rational import Number, count, level, like, positive, rational

if TYPE_CHECKING:
    import pandas as pd

__all__ = [
    "QuantileRange",
    "attained_for_certain",
    "deviation_bound",
    "error_rate_bound",
    "error_rate_bound_with_resets",
    "interleaved_deviation_bound",
    "latch_ratio",
    "longest_miss_run",
    "max_errors",
    "max_errors_from_start",
    "min_errors",
    "min_errors_from_start",
    "quantile_range",
    "quantile_range_as_printed",
    "smallest_informative_window",
    "smallest_two_sided_window",
    "unscored_predictions",
    "window_errors",
    "window_errors_as_printed",
    "window_table",
]


@dataclass(frozen=True, kw_only=True)
class QuantileRange:
    """Where a quantile lives: `low <= q < high`, or `low <= q <= high` if `high` is attained."""

    low: float | Fraction
    """Least value [score]."""
    high: float | Fraction
    """Least upper bound [score]."""
    high_attained: bool = False
    """Whether `q = high` can happen (only if the start value itself lies on or above the range)."""

    @property
    def width(self) -> float | Fraction:
        """`high - low` [score]."""
        return self.high - self.low

    def __contains__(self, q: Number) -> bool:
        """Whether a value lies in the range."""
        return bool(self.low <= q <= self.high if self.high_attained else self.low <= q < self.high)

    def __str__(self) -> str:
        """Return the interval as it is written by hand, such as `[-1/100, 109/100)`."""
        return f"[{self.low}, {self.high}{']' if self.high_attained else ')'}"


def quantile_range(
    alpha: Number, eta: Number, B: Number, *, delay: int = 1, q1: Number = 0
) -> QuantileRange:
    r"""Return the range that the quantile never leaves, whatever the scores.

    .. math:: -h\alpha\eta \;\le\; q_t \;<\; B + h(1-\alpha)\eta

    Above `B` no score can miss and `q` falls; below 0 every score misses and `q` rises; the
    overshoot is one step for each score still under way. The paper prints the two end points
    swapped (erratum 5) and no condition on :math:`q_1` (erratum 6): a start value outside widens
    the range to include it.

    Paper: proof of Theorem 1, last line, corrected.

    Args:
        alpha: miscoverage level in (0, 1).
        eta: step size > 0 [score].
        B: largest score > 0 [score].
        delay: feedback delay `h >= 1` [steps].
        q1: start value [score].

    Returns:
        The half-open range, of width `B + h * eta` if `q1` lies in it.

    Raises:
        ValueError: naming the argument that is out of its range.

    By hand: the quantile stands just below 1, misses, and rises by 0.09; it stands at 0, covers,
    and falls by 0.01.

    >>> print(quantile_range(0.1, 0.1, 1))
    [-0.01, 1.09)
    >>> print(quantile_range(0.1, 0.1, 1, delay=3))
    [-0.03, 1.27)
    >>> print(quantile_range(0.1, 0.1, 1, q1=2))
    [-0.01, 2.0]
    """
    a, step, top, start = level(alpha), positive(eta, "eta"), positive(B, "B"), rational(q1, "q1")
    h = count(delay, "delay")
    low, high = -h * a * step, top + h * (1 - a) * step
    return QuantileRange(
        low=like(min(low, start), alpha, eta, B, q1),
        high=like(max(high, start), alpha, eta, B, q1),
        high_attained=start >= high,
    )


def quantile_range_as_printed(alpha: Number, eta: Number, B: Number) -> QuantileRange:
    r"""Return the range that the paper prints: :math:`-(1-\alpha)\eta \le q \le B+\alpha\eta`.

    False above for :math:`\alpha<1/2` and false below for :math:`\alpha>1/2`; its width happens to
    be right, and that is why the constant of Theorem 1 survives.

    Paper: proof of Theorem 1, last line, as printed (errata 4 and 5).

    >>> print(quantile_range_as_printed(0.1, 0.1, 1))
    [-0.09, 1.01]
    """
    a, step, top = level(alpha), positive(eta, "eta"), positive(B, "B")
    return QuantileRange(
        low=like(-(1 - a) * step, alpha, eta, B),
        high=like(top + a * step, alpha, eta, B),
        high_attained=True,
    )


def window_errors(err: Sequence[bool] | Iterable[bool], start: int, W: int) -> int:
    """Count the misses in the `W` terms `start, ..., start + W - 1` (0-based).

    Paper: the sum of Theorem 1 with its upper limit corrected to `T0 + W - 1` (erratum 3).

    Raises:
        ValueError: if the window does not fit into the sequence.

    >>> window_errors([False, True, True], start=1, W=1)
    1
    """
    return _errors_between(err, start, count(W, "W"), extra=0)


def window_errors_as_printed(err: Sequence[bool] | Iterable[bool], start: int, W: int) -> int:
    """Count the misses in the `W + 1` terms `start, ..., start + W` that the paper's sum runs over.

    Paper: the sum of Theorem 1 as printed (erratum 3).

    Raises:
        ValueError: if the window does not fit into the sequence.

    >>> window_errors_as_printed([False, True, True], start=1, W=1)
    2
    """
    return _errors_between(err, start, count(W, "W"), extra=1)


def error_rate_bound(
    alpha: Number, eta: Number, B: Number, W: int, *, delay: int = 1
) -> float | Fraction:
    r"""Return the bound of Theorem 1 on the error rate of any window.

    .. math:: \frac{N_W}{W} < \alpha + \frac{B + h\eta}{\eta W}

    The right-hand side (`h = 1`) is the paper's. What needs correcting is the left: `N_W` counts
    `W` terms, the printed sum has `W + 1`; and the inequality is strict.

    Paper: Theorem 1.

    Args:
        alpha: miscoverage level in (0, 1).
        eta: step size > 0 [score].
        B: largest score > 0 [score].
        W: window length [steps].
        delay: feedback delay `h >= 1` [steps].

    Returns:
        The bound, which may exceed 1 (then it says nothing).

    By hand: 0.1 + (1 + 0.1) / (0.1 * 40) = 0.1 + 11 / 40.

    >>> error_rate_bound(0.1, 0.1, 1, W=40)
    0.375
    """
    a, ratio, length, h = *_settings(alpha, eta, B), count(W, "W"), count(delay, "delay")
    return like(a + (ratio + h) / length, alpha, eta, B)


def deviation_bound(alpha: Number, eta: Number, B: Number, *, delay: int = 1) -> float | Fraction:
    r"""Return the strict two-sided bound on the number of misses, for every window at once.

    .. math:: |N_W - \alpha W| < \frac{B}{\eta} + h

    Paper: "a two-sided guarantee is available by a similar proof strategy", with delay added.

    >>> deviation_bound(0.1, 0.1, 1), deviation_bound(0.1, 0.1, 1, delay=3)
    (11.0, 13.0)
    """
    _, ratio = _settings(alpha, eta, B)
    return like(ratio + count(delay, "delay"), alpha, eta, B)


def max_errors(alpha: Number, eta: Number, B: Number, W: int, *, delay: int = 1) -> int:
    r"""Return the largest number of misses in any `W` consecutive steps, for :math:`q_1=0`.

    .. math:: \max_{T_0, s} N_W = \min\bigl(W,\; \lceil \alpha W + B/\eta \rceil + h - 1\bigr)

    An integer strictly below :math:`\alpha W+B/\eta+h` is at most this. Without delay it is
    attained in every setting: start with one zero score, then show `B` for ever. With delay it is
    attained at least when :math:`B\ge h(1-\alpha)\eta` (`cpl.conformal.adversary` builds the
    sequence), and it is an upper bound always.

    Paper: sharper than Theorem 1, whose `alpha W + B/eta + 1` is never attained.

    Args:
        alpha: miscoverage level in (0, 1).
        eta: step size > 0 [score].
        B: largest score > 0 [score].
        W: window length [steps].
        delay: feedback delay `h >= 1` [steps].

    Returns:
        A number of misses between 1 and `W`.

    By hand: 0.1 * 40 + 1 / 0.1 = 14 of 40, a rate of .35; with delay 3, two more.

    >>> max_errors(0.1, 0.1, 1, W=40), max_errors(0.1, 0.1, 1, W=40, delay=3)
    (14, 16)
    >>> max_errors(0.2, 0.1, 1, W=40), max_errors(0.2, 0.1, 1, W=40, delay=2)
    (18, 19)
    """
    a, ratio, length, h = *_settings(alpha, eta, B), count(W, "W"), count(delay, "delay")
    return min(length, math.ceil(a * length + ratio) + h - 1)


def min_errors(alpha: Number, eta: Number, B: Number, W: int, *, delay: int = 1) -> int:
    r"""Return the smallest number of misses in any `W` consecutive steps, for :math:`q_1=0`.

    .. math:: \min_{T_0, s} N_W = \max\bigl(0,\; \lfloor \alpha W - B/\eta \rfloor - h + 1\bigr)

    Without delay it is attained in every setting: drive the quantile to the right point of its top
    band, then show zeros. With delay it is attained at least when :math:`B \ge h\max(\alpha,
    1-\alpha)\eta`, and it is a lower bound always.

    Paper: the "two-sided guarantee" after Theorem 1, made exact.

    By hand: 0.1 * 120 - 10 = 2.

    >>> min_errors(0.1, 0.1, 1, W=120), min_errors(0.1, 0.1, 1, W=40)
    (2, 0)
    """
    a, ratio, length, h = *_settings(alpha, eta, B), count(W, "W"), count(delay, "delay")
    return max(0, math.floor(a * length - ratio) - h + 1)


def max_errors_from_start(alpha: Number, eta: Number, B: Number, W: int, *, delay: int = 1) -> int:
    r"""Return the largest number of misses in the first `W` steps, for :math:`q_1=0`.

    .. math:: \max_s N_W = \min\bigl(W,\; \lceil B/\eta + \alpha(W-h) \rceil + h - 1\bigr)

    The start at 0 saves what the overshoot below 0 would cost.

    Paper: Theorem 1 with `T0 = 1`, made exact.

    By hand: 10 + 0.1 * 30 = 13 of the first 31.

    >>> max_errors_from_start(0.1, 0.1, 1, W=31), max_errors(0.1, 0.1, 1, W=31)
    (13, 14)
    """
    a, ratio, length, h = *_settings(alpha, eta, B), count(W, "W"), count(delay, "delay")
    return min(length, math.ceil(ratio + a * (length - h)) + h - 1)


def min_errors_from_start(alpha: Number, eta: Number, B: Number, W: int, *, delay: int = 1) -> int:
    r"""Return the smallest number of misses in the first `W` steps, for :math:`q_1=0`.

    .. math:: \min_s N_W = \max\bigl(0,\; \lceil \alpha(W-h) \rceil\bigr)

    Even scores that are all zero are missed at this rate: below 0 nothing is covered.

    Paper: the lower side of Theorem 1 with `T0 = 1`, made exact.

    By hand: 0.1 * (41 - 1) = 4.

    >>> min_errors_from_start(0.1, 0.1, 1, W=41)
    4
    """
    a, _, length, h = *_settings(alpha, eta, B), count(W, "W"), count(delay, "delay")
    return max(0, math.ceil(a * (length - h)))


def attained_for_certain(alpha: Number, eta: Number, B: Number, *, delay: int = 1) -> bool:
    r"""Say whether `max_errors` and `min_errors` are known to be attained for this delay.

    True without delay, and with delay whenever :math:`B \ge h\max(\alpha,1-\alpha)\,\eta`: then an
    adversary can steer the quantile although each of its moves takes effect `h` steps later. If
    False, the two are bounds that may be loose (`cpl.conformal.search` decides single cases).

    >>> attained_for_certain(0.1, 0.1, 1, delay=3), attained_for_certain(0.1, 1, 1, delay=3)
    (True, False)
    """
    a, ratio, h = *_settings(alpha, eta, B), count(delay, "delay")
    return h == 1 or ratio >= h * max(a, 1 - a)


def smallest_informative_window(alpha: Number, eta: Number, B: Number, *, delay: int = 1) -> int:
    r"""Return the smallest `W` for which anything at all is promised: `max_errors < W`.

    .. math:: W \ge \frac{B/\eta + h}{1-\alpha}

    In every shorter window all predictions may be wrong.

    Paper: against "for all possible windows in time, the coverage will be met" (erratum 12).

    By hand: 11 / 0.9 = 12.2, so windows of 12 steps and fewer promise nothing.

    >>> smallest_informative_window(0.1, 0.1, 1), smallest_informative_window(0.2, 0.1, 1)
    (13, 14)
    """
    a, ratio = _settings(alpha, eta, B)
    return math.ceil((ratio + count(delay, "delay")) / (1 - a))


def smallest_two_sided_window(alpha: Number, eta: Number, B: Number, *, delay: int = 1) -> int:
    r"""Return the smallest `W` for which at least one miss is certain: `min_errors > 0`.

    .. math:: W \ge \frac{B/\eta + h}{\alpha}

    By hand: 11 / 0.1 = 110 steps.

    >>> smallest_two_sided_window(0.1, 0.1, 1), smallest_two_sided_window(0.2, 0.1, 1)
    (110, 55)
    """
    a, ratio = _settings(alpha, eta, B)
    return math.ceil((ratio + count(delay, "delay")) / a)


def longest_miss_run(alpha: Number, eta: Number, B: Number, *, delay: int = 1) -> int:
    r"""Return the length of the longest possible run of consecutive misses, for :math:`q_1=0`.

    .. math:: \Bigl\lceil \frac{B/\eta + h}{1-\alpha} \Bigr\rceil - 1

    One less than the smallest informative window. Attained for every delay: keep the score at 0
    until the feedback has pushed the quantile down, then show `B`.

    By hand: from -0.01, twelve steps of +0.09 lead to 1.07; the twelfth starts at 0.98 < 1.

    >>> longest_miss_run(0.1, 0.1, 1), longest_miss_run(0.1, 0.1, 1, delay=3)
    (12, 14)
    """
    return smallest_informative_window(alpha, eta, B, delay=delay) - 1


def interleaved_deviation_bound(
    alpha: Number, eta: Number, B: Number, *, trackers: int
) -> float | Fraction:
    r"""Return the strict two-sided bound for `h` interleaved trackers, each with prompt feedback.

    .. math:: |N_W - \alpha W| < h\,(B/\eta + 1)

    Tracker `j` handles the times `t = j mod h`, so a feedback delay `h` never bites; but each
    tracker has to climb from 0 to `B` by itself. One tracker that simply waits has the smaller
    `B/eta + h` (`deviation_bound`).

    >>> interleaved_deviation_bound(0.1, 0.1, 1, trackers=3), deviation_bound(0.1, 0.1, 1, delay=3)
    (33.0, 13.0)
    """
    _, ratio = _settings(alpha, eta, B)
    return like(count(trackers, "trackers") * (ratio + 1), alpha, eta, B)


def unscored_predictions(T: int, *, delay: int = 1) -> int:
    """Return how many of an episode's `T` predictions never influence a threshold of that episode.

    The score of time `t` is known when `q[t + delay]` is formed, so the last `delay` scores come
    too late. A tracker that is reset at the end of each episode never learns from them.

    >>> unscored_predictions(40, delay=3)
    3
    """
    return min(count(T, "T"), count(delay, "delay"))


def error_rate_bound_with_resets(
    alpha: Number, eta: Number, B: Number, *, episode_length: int, delay: int = 1
) -> float | Fraction:
    r"""Return the largest long-run error rate if `q` is reset to 0 at the start of each episode.

    .. math:: \frac{1}{L}\min\bigl(L, \lceil B/\eta + \alpha(L-h)\rceil + h - 1\bigr)

    The guarantee restarts with the quantile: it does not average out over episodes. Carried over,
    the same tracker is held to `alpha` in the long run.

    By hand: ceil(10 + 0.1 * 39) = 14 of 40.

    >>> error_rate_bound_with_resets(0.1, 0.1, 1, episode_length=40)
    0.35
    """
    length = count(episode_length, "episode_length")
    errors = max_errors_from_start(alpha, eta, B, length, delay=delay)
    return like(Fraction(errors, length), alpha, eta, B)


def latch_ratio(alpha: Number) -> float | Fraction:
    r"""Return how many covered steps it takes to undo one miss: :math:`(1-\alpha)/\alpha`.

    The quantile climbs in steps of :math:`(1-\alpha)\eta` and falls in steps of
    :math:`\alpha\eta`: a fast attack and a slow release, like a latched alarm.

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


def _settings(alpha: Number, eta: Number, B: Number) -> tuple[Fraction, Fraction]:
    """Return `alpha` and `B / eta`, exactly."""
    return level(alpha), positive(B, "B") / positive(eta, "eta")


def _errors_between(err: Iterable[bool], start: int, W: int, *, extra: int) -> int:
    misses = [bool(miss) for miss in err]
    first = count(start, "start", least=0)
    if first + W + extra > len(misses):
        msg = f"W must leave the window inside the {len(misses)} steps from start {start}, got {W}"
        raise ValueError(msg)
    return sum(misses[first : first + W + extra])
