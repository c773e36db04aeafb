r"""Bounds for scores without an upper limit: the eventually safe policy (Assumption 1, Corollary).

The assumption, with the quantifiers that the paper leaves out (erratum 15): there are
$\alpha^{safe}<\alpha$, a floor $q^{floor}\ge 0$ and a block length `K` such that **from
every start time and for every sequence that can happen**, `K` steps in a row with
$q\ge q^{floor}$ contain at most $\alpha^{safe}K$ misses. Scores are `>= 0` and may be
arbitrarily large.

The paper's $q^{safe}$ of this assumption is called `q_floor` here; the threshold of the
switching policy, which has the same symbol, is another thing.
"""

from __future__ import annotations

import math
from fractions import Fraction

from cpl.conformal.bounds.window import QuantileRange
from cpl.conformal.rational import Number, count, level, like, positive, rational

__all__ = [
    "eventually_safe_deviation_bound",
    "eventually_safe_overshoot",
    "eventually_safe_range",
    "eventually_safe_range_sharp",
]


def eventually_safe_overshoot(alpha: Number, K: int) -> int:
    r"""Return how many misses `q` can overshoot the floor by, if the run goes on: `ceil(alpha K)`.

    One miss lifts `q` from below the floor to above it. From there, `n` further misses within `K`
    steps are possible only if $n < \alpha K$: with $n \ge \alpha K$ the quantile would
    still be above the floor when the block ends, and the block would have too many misses.

    The block must end, though. The assumption says nothing about a block that the end of a run
    cuts short, so in the last `K - 1` steps of a finite run there may be `K` misses.

    Examples:
        >>> [eventually_safe_overshoot(0.1, K) for K in (1, 4, 10, 11, 30)]
        [1, 1, 1, 2, 3]
    """
    return math.ceil(level(alpha) * count(K, "K"))


def eventually_safe_range(
    alpha: Number, eta: Number, q_floor: Number, *, K: int = 1
) -> QuantileRange:
    r"""Return the range of the quantile under an eventually safe policy, for $q_1=0$.

    $$-\alpha\eta \;\le\; q_t \;<\; q^{floor} + K(1-\alpha)\eta$$

    Paper: Corollary 1 (which claims `alpha + o(1)` and cites a proof elsewhere).

    Args:
        alpha: miscoverage level in (0, 1).
        eta: step size > 0 [score].
        q_floor: the paper's q^safe of Assumption 1, >= 0 [score].
        K: block length of the assumption [steps].

    Examples:
        By hand: 0.5 + 4 * 0.09 = 0.86.

        >>> print(eventually_safe_range(0.1, 0.1, 0.5, K=4))
        [-0.01, 0.86)
    """
    return _range(alpha, eta, q_floor, misses=count(K, "K"))


def eventually_safe_range_sharp(
    alpha: Number, eta: Number, q_floor: Number, *, K: int = 1
) -> QuantileRange:
    r"""Return a smaller range, for a run that goes on for `K` steps more: `ceil(alpha K)` for `K`.

    $$-\alpha\eta \;\le\; q_t \;<\; q^{floor} + \lceil\alpha K\rceil(1-\alpha)\eta$$

    Paper: not in it; see `eventually_safe_overshoot` for the reason.

    Examples:
        >>> print(eventually_safe_range_sharp(0.1, 0.1, 0.5, K=4))
        [-0.01, 0.59)
    """
    return _range(alpha, eta, q_floor, misses=eventually_safe_overshoot(alpha, K))


def eventually_safe_deviation_bound(
    alpha: Number, eta: Number, q_floor: Number, *, K: int = 1
) -> float | Fraction:
    r"""Return the strict two-sided bound on the misses under an eventually safe policy.

    $$|N_W-\alpha W| < \frac{q^{floor}}{\eta} + K(1-\alpha) + \alpha$$

    It does not grow with `W`, so the error rate tends to `alpha` at rate `1/W`, and from both
    sides. With `K = 1` and `q_floor = B` it is Theorem 1: bounded scores need no assumption
    (erratum 13).

    Paper: Corollary 1, with its `o(1)` made explicit.

    Examples:
        By hand: 0.5 / 0.1 + 4 * 0.9 + 0.1 = 8.7.

        >>> eventually_safe_deviation_bound(0.1, 0.1, 0.5, K=4)
        8.7
        >>> eventually_safe_deviation_bound(0.1, 0.1, 1, K=1)
        11.0
    """
    a, step, floor = level(alpha), positive(eta, "eta"), _floor(q_floor)
    return like(floor / step + count(K, "K") * (1 - a) + a, alpha, eta, q_floor)


def _range(alpha: Number, eta: Number, q_floor: Number, *, misses: int) -> QuantileRange:
    a, step, floor = level(alpha), positive(eta, "eta"), _floor(q_floor)
    return QuantileRange(
        low=like(-a * step, alpha, eta, q_floor),
        high=like(floor + misses * (1 - a) * step, alpha, eta, q_floor),
    )


def _floor(q_floor: Number) -> Fraction:
    floor = rational(q_floor, "q_floor")
    if floor < 0:
        msg = f"q_floor must be >= 0, got {q_floor!r}"
        raise ValueError(msg)
    return floor
