r"""Bounds when the step size varies: Abel summation instead of telescoping.

$$q_{t+1} = q_t + \eta_t(\mathrm{err}_t-\alpha)
  \quad\Longrightarrow\quad
  \sum_{t=T_0}^{T_0+W-1}(\mathrm{err}_t-\alpha) = \sum_t \frac{q_{t+1}-q_t}{\eta_t}$$

The paper uses $\eta_t = 0.1\hat B_t$ and calls a guarantee trivial. It depends on what
$\hat B_t$ is, which the paper does not say (erratum 11): true for a running maximum, false
for a trailing one (`cpl.conformal.traps` has the sequences).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction
from itertools import pairwise
from numbers import Rational

from cpl.conformal.rational import Number, like, positive

__all__ = [
    "decreasing_step_bound",
    "increasing_step_bound",
    "inverse_step_variation",
    "running_maximum_bound",
    "variable_step_bound",
]


def inverse_step_variation(etas: Sequence[Number]) -> float | Fraction:
    r"""Return what a window's step sizes cost in Abel's summation.

    $$V = \frac{1}{\eta_{T_0}}
      + \sum_{t=T_0+1}^{T_0+W-1}\Bigl(\frac{1}{\eta_t}-\frac{1}{\eta_{t-1}}\Bigr)_+$$

    Only shrinking steps cost; growing ones are free.

    Args:
        etas: the step sizes used inside the window, each > 0 [score].

    Raises:
        ValueError: if there is no step, or one is not > 0.

    Examples:
        By hand: 1/1 + (1/0.5 - 1/1) + 0 = 2.

        >>> inverse_step_variation([1, 0.5, 1])
        2.0
    """
    least = min(etas, default=None)
    if least is None:
        msg = f"etas must hold at least one step, got {etas!r}"
        raise ValueError(msg)
    positive(least, "etas")
    if all(isinstance(eta, Rational) for eta in etas):
        steps = [Fraction(eta) for eta in etas]
        falls = (1 / b - 1 / a for a, b in pairwise(steps) if b < a)
        return sum(falls, 1 / steps[0])
    # A sum of thousands of exact decimals has a denominator of thousands of digits: round here.
    rough = [float(eta) for eta in etas]
    return math.fsum((1 / rough[0], *(1 / b - 1 / a for a, b in pairwise(rough) if b < a)))


def variable_step_bound(
    etas: Sequence[Number], B: Number, *, largest_eta: Number | None = None
) -> float | Fraction:
    r"""Bound the deviation of the misses of one window for any positive step sizes.

    $$\Bigl|\sum_{t=T_0}^{T_0+W-1}(\mathrm{err}_t-\alpha)\Bigr| \le (B+H)\,V$$

    `H` is the largest step up to the end of the window (it fixes the range of `q`) and `V` is
    `inverse_step_variation`. The steps may depend on the past in any way.

    Args:
        etas: the step sizes used inside the window [score].
        B: largest score > 0 [score].
        largest_eta: the largest step since time 1, if larger than those of the window [score].

    Returns:
        A number of misses.

    Examples:
        By hand: (1 + 1) * 2 = 4. With all steps equal it is (B + eta) / eta, as in Theorem 1.

        >>> variable_step_bound([1, 0.5, 1], B=1)
        4.0
        >>> variable_step_bound([0.1] * 40, B=1)
        11.0
    """
    variation = inverse_step_variation(etas)
    used = max(etas)
    largest = used if largest_eta is None else max(used, largest_eta)
    return like(positive(B, "B") + positive(largest, "etas"), B, largest, *etas) * variation


def increasing_step_bound(eta_first: Number, eta_last: Number, B: Number) -> float | Fraction:
    r"""Bound the deviation if steps never shrink: $(B+\eta_{last})/\eta_{first}$.

    Args:
        eta_first: step size at the window's first time [score].
        eta_last: step size at its last time [score].
        B: largest score > 0 [score].

    Raises:
        ValueError: if `eta_last < eta_first`.

    Examples:
        >>> increasing_step_bound(0.05, 0.1, B=1)
        22.0
    """
    first, last = positive(eta_first, "eta_first"), positive(eta_last, "eta_last")
    if last < first:
        msg = f"eta_last must be >= eta_first = {eta_first!r}, got {eta_last!r}"
        raise ValueError(msg)
    return like((positive(B, "B") + last) / first, eta_first, eta_last, B)


def decreasing_step_bound(eta_first: Number, eta_last: Number, B: Number) -> float | Fraction:
    r"""Bound the deviation if steps never grow: $(B+\eta_{1})/\eta_{last}$.

    Args:
        eta_first: the largest step since time 1 [score].
        eta_last: step size at the window's last time [score].
        B: largest score > 0 [score].

    Raises:
        ValueError: if `eta_last > eta_first`.

    Examples:
        By hand: steps 1/sqrt(t) at t = 100 give (1 + 1) / 0.1 = 20 misses, a rate of 20 / 100.

        >>> decreasing_step_bound(1, 0.1, B=1)
        20.0
    """
    first, last = positive(eta_first, "eta_first"), positive(eta_last, "eta_last")
    if last > first:
        msg = f"eta_last must be <= eta_first = {eta_first!r}, got {eta_last!r}"
        raise ValueError(msg)
    return like((positive(B, "B") + first) / last, eta_first, eta_last, B)


def running_maximum_bound(c: Number, maximum_at_start: Number, B: Number) -> float | Fraction:
    r"""Bound the deviation for $\eta_t = c\max(s_1,\dots,s_t)$, the reading that is safe.

    $$\Bigl|\sum_{t=T_0}^{T_0+W-1}(\mathrm{err}_t-\alpha)\Bigr|
      \le \frac{(1+c)\,B}{c\,\hat B_{T_0}}$$

    The steps never shrink, so $V = 1/\eta_{T_0}$. The window must start after the first
    positive score; before that the step is zero and nothing moves.

    Paper: "eta_t = 0.1 B_hat_t ... trivial to get a guarantee", for the reading that is true.

    Args:
        c: the factor, 0.1 in the paper [-].
        maximum_at_start: the maximum that sets the step at the window's first time [score].
        B: the largest score of the whole sequence [score].

    Raises:
        ValueError: if `maximum_at_start > B`.

    Examples:
        By hand: once the largest score has been seen, 1.1 / 0.1 = 11, as with a fixed step.

        >>> running_maximum_bound(0.1, 1, B=1), running_maximum_bound(0.1, 0.5, B=1)
        (11.0, 22.0)
    """
    factor, top = positive(c, "c"), positive(B, "B")
    seen = positive(maximum_at_start, "maximum_at_start")
    if seen > top:
        msg = f"maximum_at_start must be <= B = {B!r}, got {maximum_at_start!r}"
        raise ValueError(msg)
    return like((1 + factor) * top / (factor * seen), c, maximum_at_start, B)
