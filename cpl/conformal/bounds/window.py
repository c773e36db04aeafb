r"""How often the fixed-step tracker can miss in a window: Theorem 1, corrected and made exact.

Scores $s_t\in[0,B]$, misses $\mathrm{err}_t = 1\{s_t > q_t\}$, and

$$q_{t+1} = q_t + \eta\,(\mathrm{err}_t - \alpha),\qquad q_1 = 0.$$

With feedback delay `h` (the score of time `t` is known when `q[t+h]` is formed) the update uses
$\mathrm{err}_{t+1-h}$, and nothing happens before the first score is known; `h = 1` is
ordinary feedback. $N_W$ is the number of misses in the `W` terms
$t = T_0,\dots,T_0+W-1$.

Everything follows from one identity. The *virtual quantile* $p_t = q_1 + \eta\sum_{i<t}
(\mathrm{err}_i-\alpha)$ has already swallowed the feedback that is still under way (without delay
$p_t = q_t$), so $N_W = \alpha W + (p_{T_0+W} - p_{T_0})/\eta$, and `p` stays in the
half-open interval that `quantile_range` returns.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction

from cpl.conformal.rational import Number, count, level, like, positive, rational

__all__ = [
    "QuantileRange",
    "attained_for_certain",
    "deviation_bound",
    "error_rate_bound",
    "max_errors",
    "max_errors_from_start",
    "min_errors",
    "min_errors_from_start",
    "quantile_range",
    "quantile_range_as_printed",
    "window_errors",
    "window_errors_as_printed",
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

    $$-h\alpha\eta \;\le\; q_t \;<\; B + h(1-\alpha)\eta$$

    Above `B` no score can miss and `q` falls; below 0 every score misses and `q` rises; the
    overshoot is one step for each score still under way. The paper prints the two end points
    swapped (errata 4 and 5) and no condition on $q_1$ (erratum 6): a start value outside widens
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

    Examples:
        By hand: just below 1 a miss lifts it by 0.09; at 0 a cover takes it down by 0.01.

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
    r"""Return the range that the paper prints: $-(1-\alpha)\eta \le q \le B+\alpha\eta$.

    False above for $\alpha<1/2$ and false below for $\alpha>1/2$; its width happens to
    be right, and that is why the constant of Theorem 1 survives.

    Paper: proof of Theorem 1, last line, as printed (errata 4 and 5).

    Examples:
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

    Examples:
        >>> window_errors([False, True, True], start=1, W=1)
        1
    """
    return _errors_between(err, start, count(W, "W"), extra=0)


def window_errors_as_printed(err: Sequence[bool] | Iterable[bool], start: int, W: int) -> int:
    """Count the misses in the `W + 1` terms `start, ..., start + W` that the paper's sum runs over.

    Paper: the sum of Theorem 1 as printed (erratum 3).

    Raises:
        ValueError: if the window does not fit into the sequence.

    Examples:
        >>> window_errors_as_printed([False, True, True], start=1, W=1)
        2
    """
    return _errors_between(err, start, count(W, "W"), extra=1)


def error_rate_bound(
    alpha: Number, eta: Number, B: Number, W: int, *, delay: int = 1
) -> float | Fraction:
    r"""Return the bound of Theorem 1 on the error rate of any window.

    $$\frac{N_W}{W} < \alpha + \frac{B + h\eta}{\eta W}$$

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

    Examples:
        By hand: 0.1 + (1 + 0.1) / (0.1 * 40) = 0.1 + 11 / 40.

        >>> error_rate_bound(0.1, 0.1, 1, W=40)
        0.375
    """
    a, ratio, length, h = *_settings(alpha, eta, B), count(W, "W"), count(delay, "delay")
    return like(a + (ratio + h) / length, alpha, eta, B)


def deviation_bound(alpha: Number, eta: Number, B: Number, *, delay: int = 1) -> float | Fraction:
    r"""Return the strict two-sided bound on the number of misses, for every window at once.

    $$|N_W - \alpha W| < \frac{B}{\eta} + h$$

    Paper: "a two-sided guarantee is available by a similar proof strategy", with delay added.

    Examples:
        >>> deviation_bound(0.1, 0.1, 1), deviation_bound(0.1, 0.1, 1, delay=3)
        (11.0, 13.0)
    """
    _, ratio = _settings(alpha, eta, B)
    return like(ratio + count(delay, "delay"), alpha, eta, B)


def max_errors(alpha: Number, eta: Number, B: Number, W: int, *, delay: int = 1) -> int:
    r"""Return the largest number of misses in any `W` consecutive steps, for $q_1=0$.

    $$\max_{T_0, s} N_W = \min\bigl(W,\; \lceil \alpha W + B/\eta \rceil + h - 1\bigr)$$

    An integer strictly below $\alpha W+B/\eta+h$ is at most this. Without delay it is
    attained in every setting: start with one zero score, then show `B` for ever. With delay it is
    attained at least when $B\ge h(1-\alpha)\eta$ (`cpl.conformal.adversary` builds the
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

    Examples:
        By hand: 0.1 * 40 + 1 / 0.1 = 14 of 40, a rate of .35; with delay 3, two more.

        >>> max_errors(0.1, 0.1, 1, W=40), max_errors(0.1, 0.1, 1, W=40, delay=3)
        (14, 16)
        >>> max_errors(0.2, 0.1, 1, W=40), max_errors(0.2, 0.1, 1, W=40, delay=2)
        (18, 19)
    """
    a, ratio, length, h = *_settings(alpha, eta, B), count(W, "W"), count(delay, "delay")
    return min(length, math.ceil(a * length + ratio) + h - 1)


def min_errors(alpha: Number, eta: Number, B: Number, W: int, *, delay: int = 1) -> int:
    r"""Return the smallest number of misses in any `W` consecutive steps, for $q_1=0$.

    $$\min_{T_0, s} N_W = \max\bigl(0,\; \lfloor \alpha W - B/\eta \rfloor - h + 1\bigr)$$

    Without delay it is attained in every setting: drive the quantile to the right point of its top
    band, then show zeros. With delay it is attained at least when $B \ge h\max(\alpha,
    1-\alpha)\eta$, and it is a lower bound always.

    Paper: the "two-sided guarantee" after Theorem 1, made exact.

    Examples:
        By hand: 0.1 * 120 - 10 = 2.

        >>> min_errors(0.1, 0.1, 1, W=120), min_errors(0.1, 0.1, 1, W=40)
        (2, 0)
    """
    a, ratio, length, h = *_settings(alpha, eta, B), count(W, "W"), count(delay, "delay")
    return max(0, math.floor(a * length - ratio) - h + 1)


def max_errors_from_start(alpha: Number, eta: Number, B: Number, W: int, *, delay: int = 1) -> int:
    r"""Return the largest number of misses in the first `W` steps, for $q_1=0$.

    $$\max_s N_W = \min\bigl(W,\; \lceil B/\eta + \alpha(W-h) \rceil + h - 1\bigr)$$

    The start at 0 saves what the overshoot below 0 would cost.

    Paper: Theorem 1 with `T0 = 1`, made exact.

    Examples:
        By hand: 10 + 0.1 * 30 = 13 of the first 31.

        >>> max_errors_from_start(0.1, 0.1, 1, W=31), max_errors(0.1, 0.1, 1, W=31)
        (13, 14)
    """
    a, ratio, length, h = *_settings(alpha, eta, B), count(W, "W"), count(delay, "delay")
    return min(length, math.ceil(ratio + a * (length - h)) + h - 1)


def min_errors_from_start(alpha: Number, eta: Number, B: Number, W: int, *, delay: int = 1) -> int:
    r"""Return the smallest number of misses in the first `W` steps, for $q_1=0$.

    $$\min_s N_W = \max\bigl(0,\; \lceil \alpha(W-h) \rceil\bigr)$$

    Even scores that are all zero are missed at this rate: below 0 nothing is covered.

    Paper: the lower side of Theorem 1 with `T0 = 1`, made exact.

    Examples:
        By hand: 0.1 * (41 - 1) = 4.

        >>> min_errors_from_start(0.1, 0.1, 1, W=41)
        4
    """
    a, _, length, h = *_settings(alpha, eta, B), count(W, "W"), count(delay, "delay")
    return max(0, math.ceil(a * (length - h)))


def attained_for_certain(alpha: Number, eta: Number, B: Number, *, delay: int = 1) -> bool:
    r"""Say whether `max_errors` and `min_errors` are known to be attained for this delay.

    True without delay, and with delay whenever $B \ge h\max(\alpha,1-\alpha)\,\eta$: then an
    adversary can steer the quantile although each of its moves takes effect `h` steps later. If
    False, the two are bounds that may be loose (`cpl.conformal.search` decides single cases).

    Examples:
        >>> attained_for_certain(0.1, 0.1, 1, delay=3), attained_for_certain(0.1, 1, 1, delay=3)
        (True, False)
    """
    a, ratio, h = *_settings(alpha, eta, B), count(delay, "delay")
    return h == 1 or ratio >= h * max(a, 1 - a)


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
