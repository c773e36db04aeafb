"""Intervals and laws for one number: a share, a mean, a difference, a coverage."""

from dataclasses import dataclass
from fractions import Fraction
from math import ceil
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import stats as sp

__all__ = [
    "Estimate",
    "mean_interval",
    "proportion",
    "rank_correlation",
    "split_conformal_law",
    "split_conformal_rank",
]


@dataclass(frozen=True, kw_only=True)
class Estimate:
    """A number with its interval: ``low <= value <= high``, from ``n`` independent units."""

    value: float
    low: float
    high: float
    n: int


def proportion(hits: int, n: int, *, confidence: float = 0.95) -> Estimate:
    """Return a share with its exact Clopper-Pearson interval.

    Args:
        hits: Number of successes, 0 <= hits <= n.
        n: Number of independent trials.
        confidence: Coverage of the interval, in (0, 1); the exact method covers at least that.

    Raises:
        ValueError: If an argument is out of its range.

    Examples:
        No failure in 100 trials still leaves a rate of up to 3.6 %, since 0.964^100 = 0.025:

        >>> estimate = proportion(0, 100)
        >>> estimate.low, round(estimate.high, 4)
        (0.0, 0.0362)
    """
    _check_confidence(confidence)
    if n < 1 or not 0 <= hits <= n:
        msg = f"hits must lie in [0, n] and n be positive, got hits={hits!r}, n={n!r}"
        raise ValueError(msg)
    tail = (1 - confidence) / 2
    low = float(sp.beta.ppf(tail, hits, n - hits + 1)) if hits else 0.0
    high = float(sp.beta.ppf(1 - tail, hits + 1, n - hits)) if hits < n else 1.0
    return Estimate(value=hits / n, low=low, high=high, n=n)


def mean_interval(sample: ArrayLike, *, confidence: float = 0.95) -> Estimate:
    """Return a mean with its Student t interval.

    Args:
        sample: Independent values, shape (n,), n >= 2.
        confidence: Coverage of the interval, in (0, 1).

    Raises:
        ValueError: If the sample is not a vector of at least two finite numbers.

    Examples:
        >>> estimate = mean_interval([1.0, 2.0, 3.0])  # 2 +- 4.303 / sqrt(3)
        >>> estimate.value, round(estimate.high, 3)
        (2.0, 4.484)
    """
    _check_confidence(confidence)
    values = _vector("sample", sample)
    half = sp.t.ppf((1 + confidence) / 2, values.size - 1) * sp.sem(values)
    mean = float(values.mean())
    return Estimate(value=mean, low=mean - float(half), high=mean + float(half), n=values.size)


def rank_correlation(x: ArrayLike, y: ArrayLike, *, confidence: float = 0.95) -> Estimate:
    r"""Return Spearman's rank correlation with its interval over the units.

    .. math:: \tanh\bigl(\operatorname{artanh} \rho \pm z \sqrt{1.06 / (n - 3)}\bigr)

    the variance of Fieller, Hartley and Pearson (1957). Where the ranks agree wholly, the
    correlation counts as that of one exchange of neighbours.

    Args:
        x: One value a unit, shape (n,), n >= 4.
        y: Another.
        confidence: Coverage of the interval, in (0, 1).

    Returns:
        The estimate; 0 between -1 and 1 where one of the two does not vary.

    Raises:
        ValueError: If the two are not finite vectors of one length of at least four.

    Examples:
        >>> estimate = rank_correlation([1, 2, 3, 4, 5, 6, 7, 8], [2, 1, 3, 4, 6, 5, 7, 8])
        >>> round(estimate.value, 3), round(estimate.low, 2), round(estimate.high, 2)
        (0.952, 0.74, 0.99)
    """
    _check_confidence(confidence)
    first, second = _vector("x", x), _vector("y", y)
    n = first.size
    if n < 4 or second.size != n:
        raise ValueError(f"x and y must have one length >= 4, got {n} and {second.size}")
    if not np.ptp(first) or not np.ptp(second):
        return Estimate(value=0.0, low=-1.0, high=1.0, n=n)
    value = float(np.corrcoef(sp.rankdata(first), sp.rankdata(second))[0, 1])
    most = 1 - 12 / (n * (n**2 - 1))
    half = float(sp.norm.ppf((1 + confidence) / 2)) * np.sqrt(1.06 / (n - 3))
    centre = np.arctanh(np.clip(value, -most, most))
    low, high = (float(np.tanh(centre + side * half)) for side in (-1, 1))
    return Estimate(value=round(value, 12), low=min(low, value), high=max(high, value), n=n)


def split_conformal_rank(n: int, alpha: float) -> int:
    r"""Return the rank of the calibration score that split conformal prediction uses.

    .. math:: k = \lceil (1-\alpha)(n+1) \rceil

    The decimal that was typed counts, not its binary neighbour: for ``alpha=0.1, n=9`` the rank
    is 9 although ``(1 - 0.1) * 10`` may round to just above it.

    Args:
        n: Number of calibration scores.
        alpha: Nominal miscoverage, in (0, 1).

    Returns:
        The rank k, counted from 1; k = n + 1 means that the threshold is infinite.

    Raises:
        ValueError: If n is not positive or alpha not in (0, 1).

    Examples:
        >>> [split_conformal_rank(n, 0.1) for n in (9, 100, 5)]
        [9, 91, 6]
    """
    if n < 1:
        msg = f"n must be positive, got {n!r}"
        raise ValueError(msg)
    if not 0 < alpha < 1:
        msg = f"alpha must lie in (0, 1), got {alpha!r}"
        raise ValueError(msg)
    return ceil((1 - Fraction(repr(float(alpha)))) * (n + 1))


def split_conformal_law(n: int, alpha: float) -> Any:  # noqa: ANN401 - SciPy's frozen law
    r"""Return the law of the coverage of split conformal prediction given its calibration set.

    .. math:: P(s_{n+1} \le s_{(k)} \mid s_1..s_n) \sim \text{Beta}(k,\ n+1-k)

    It holds exactly for exchangeable scores without ties (given the latent law, if there is one);
    its mean k/(n+1) is at least 1 - alpha. With ties the coverage can only be larger.

    Args:
        n: Number of calibration scores.
        alpha: Nominal miscoverage, in (0, 1), with alpha >= 1/(n+1).

    Returns:
        A frozen ``scipy.stats.beta``.

    Raises:
        ValueError: If n is too small for alpha: the threshold would be infinite.

    Examples:
        >>> law = split_conformal_law(9, 0.1)
        >>> float(law.mean()), float(law.var().round(6))
        (0.9, 0.008182)
    """
    k = split_conformal_rank(n, alpha)
    if k > n:
        msg = f"n must be at least 1/alpha - 1 for a finite threshold, got n={n}, alpha={alpha}"
        raise ValueError(msg)
    return sp.beta(k, n + 1 - k)


def _vector(name: str, values: ArrayLike) -> NDArray[np.float64]:
    array = np.asarray(values, dtype=np.float64)
    if array.ndim != 1 or array.size < 2 or not np.isfinite(array).all():
        msg = f"{name} must be a vector of at least two finite numbers, got shape {array.shape}"
        raise ValueError(msg)
    return array


def _check_confidence(confidence: float) -> None:
    if not 0 < confidence < 1:
        msg = f"confidence must lie in (0, 1), got {confidence!r}"
        raise ValueError(msg)
