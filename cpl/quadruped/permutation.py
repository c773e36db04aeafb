"""Could the difference be chance? The exact permutation test for runs paired by seed.

Two policies that see the same shape and the same noise make a pair. If the policy made no
difference, each pair's difference could as well have the other sign: all 2^n sign patterns are
equally likely, whatever the distribution of the errors. Pairs from several shapes can be put
together, since a sign flips within its own pair: that is the stratified test.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

__all__ = ["SignFlip", "sign_flip"]

EXACT_UP_TO = 20  # pairs: a million patterns
DRAWS = 99_999  # random patterns beyond that


@dataclass(frozen=True, kw_only=True)
class SignFlip:
    """What the test says.

    Args:
        value: Mean difference, in the unit of the differences.
        p: Two-sided p-value.
        least_p: The smallest p-value that this many pairs could have given.
        n: Number of pairs.
        exact: Whether all patterns were counted.
    """

    value: float
    p: float
    least_p: float
    n: int
    exact: bool


def sign_flip(differences: ArrayLike, rng: np.random.Generator | None = None) -> SignFlip:
    """Test whether paired differences are centred at zero.

        p = #{ patterns e in {-1, 1}^n : |sum_i e_i d_i| >= |sum_i d_i| } / 2^n

    Above 20 pairs the patterns are drawn and the observed one is counted among them, which keeps
    the test valid.

    Args:
        differences: One per pair, shape (n,), n >= 1.
        rng: Draws the patterns; needed above 20 pairs.

    Returns:
        Mean, p-value and what the p-value could at best have been.

    Raises:
        ValueError: Differences that are not a vector of finite numbers; many pairs without `rng`.

    The paper's three repeats of a cell cannot show anything at 5 %, whatever they are:

    >>> sign_flip([0.9, 1.0, 1.2]).p
    0.25
    """
    d = np.asarray(differences, dtype=np.float64)
    if d.ndim != 1 or not len(d) or not np.isfinite(d).all():
        raise ValueError(f"differences must be a vector of finite numbers, not {differences!r}")
    n, tolerance = len(d), 1e-12 * float(np.abs(d).sum())
    exact = n <= EXACT_UP_TO
    if exact:
        sums = np.zeros(1)
        for value in d:
            sums = np.concatenate([sums + value, sums - value])
        p = float((np.abs(sums) >= abs(d.sum()) - tolerance).mean())
    else:
        if rng is None:
            raise ValueError(f"rng must be given above {EXACT_UP_TO} pairs, not {rng}")
        sums = np.array([d @ (2.0 * rng.integers(0, 2, size=n) - 1) for _ in range(DRAWS)])
        p = float((1 + (np.abs(sums) >= abs(d.sum()) - tolerance).sum()) / (1 + DRAWS))
    least = 2.0 ** (1 - n) if exact else max(2.0 ** (1 - n), 1 / (1 + DRAWS))
    return SignFlip(value=float(d.mean()), p=p, least_p=least, n=n, exact=exact)
