"""The bootstrap for results that have two sources of chance: training seeds and environment seeds.

Resampling is expressed by *weights*: how often each unit was drawn. A statistic that is a function
of sums (a mean, a ratio of sums such as collisions per km) then costs one matrix product for all
resamples.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import stats as sp

from cpl.stats.estimates import Estimate

__all__ = ["Band", "Weights", "band", "hierarchical_weights", "interval", "p_value", "sums"]

Floats = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Weights:
    """How often every unit was drawn in every resample.

    Attributes:
        counts: Shape (resamples, groups, units), with groups * units on average in a resample.
        groups: The number of groups, on which the degrees of freedom of an interval rest.
    """

    counts: Floats
    groups: int


@dataclass(frozen=True, kw_only=True)
class Band:
    """Values with an interval each; all of them hold together with the stated confidence.

    Attributes:
        value: The values, shape (k,).
        low: Lower ends.
        high: Upper ends.
        n: The number of independent groups.
    """

    value: Floats
    low: Floats
    high: Floats
    n: int


def hierarchical_weights(
    groups: int,
    units: int,
    rng: np.random.Generator,
    *,
    resamples: int = 2_000,
    crossed: bool = True,
) -> Weights:
    r"""Draw groups with replacement, then units, and count.

    With ``crossed`` the units are the same in all groups (all training seeds drive the same
    environment seeds), and one draw of units serves all groups:

    .. math:: w_{gu} = c_g\, d_u, \qquad c, d \text{ multinomial}

    the pigeonhole bootstrap, which errs to the wide side (Owen 2007). Otherwise each drawn group
    has units of its own, drawn anew: the nested bootstrap.

    Args:
        groups: The number of groups (training seeds), >= 1. With one, only units are drawn.
        units: The number of units a group (environment seeds, or blocks of them), >= 2.
        rng: Where the resamples come from.
        resamples: How many.
        crossed: Whether the units of all groups are the same.

    Returns:
        The weights.

    Raises:
        ValueError: If a number is too small.

    Examples:
        >>> weights = hierarchical_weights(3, 4, np.random.default_rng(0), resamples=5)
        >>> weights.counts.shape, weights.counts.sum(axis=(1, 2)).tolist()
        ((5, 3, 4), [12.0, 12.0, 12.0, 12.0, 12.0])
    """
    if groups < 1 or units < 2 or resamples < 1:
        msg = (
            "groups and resamples must be >= 1 and units >= 2, "
            f"got {groups!r}, {resamples!r} and {units!r}"
        )
        raise ValueError(msg)
    drawn = rng.multinomial(groups, np.full(groups, 1 / groups), size=resamples)
    if crossed:
        chosen = rng.multinomial(units, np.full(units, 1 / units), size=resamples)
        counts = drawn[:, :, None] * chosen[:, None, :]
    else:
        counts = rng.multinomial(drawn * units, np.full(units, 1 / units))
    return Weights(counts=counts.astype(np.float64), groups=groups)


def sums(values: ArrayLike, weights: Weights) -> tuple[Floats, Floats]:
    """Add up values over groups and units, once as they are and once in every resample.

    Args:
        values: Shape (groups, units, ...).
        weights: From ``hierarchical_weights``.

    Returns:
        The plain sums, shape (...), and those of the resamples, shape (resamples, ...).

    Raises:
        ValueError: If the shapes do not fit or a value is not finite.

    Examples:
        >>> weights = hierarchical_weights(1, 2, np.random.default_rng(1), resamples=3)
        >>> total, resampled = sums([[1.0, 3.0]], weights)
        >>> float(total), resampled.tolist()
        (4.0, [4.0, 2.0, 6.0])
    """
    array = np.asarray(values, dtype=np.float64)
    resamples, groups, units = weights.counts.shape
    if array.shape[:2] != (groups, units) or not np.isfinite(array).all():
        msg = f"values must be finite with shape ({groups}, {units}, ...), got {array.shape}"
        raise ValueError(msg)
    flat = array.reshape(groups * units, -1)
    drawn = weights.counts.reshape(resamples, -1) @ flat
    return array.sum(axis=(0, 1)), drawn.reshape(resamples, *array.shape[2:])


def interval(
    value: float, resampled: ArrayLike, *, groups: int, confidence: float = 0.95
) -> Estimate:
    r"""Turn a statistic and its resamples into an interval that is honest for few groups.

    .. math:: v \pm t_{G-1} \sqrt{G / (G - 1)}\ \mathrm{sd}(v^*)

    Percentiles of a bootstrap over ten groups cover clearly less than they say; Student's quantile
    and the factor for the lost degree of freedom mend that. With one group the normal quantile is
    used: the interval then speaks of that one training seed only.

    Args:
        value: The statistic.
        resampled: The same in every resample, shape (resamples,).
        groups: Number of independent groups.
        confidence: Coverage, in (0, 1).

    Returns:
        The estimate; its ``n`` is the number of groups.

    Examples:
        >>> estimate = interval(1.0, [0.5, 1.5], groups=1)  # sd 0.5, quantile 1.96
        >>> round(estimate.low, 3), round(estimate.high, 3)
        (0.02, 1.98)
    """
    half = _quantile(groups, confidence) * float(np.std(np.asarray(resampled)))
    return Estimate(value=value, low=value - half, high=value + half, n=groups)


def band(values: ArrayLike, resampled: ArrayLike, *, groups: int, confidence: float = 0.95) -> Band:
    r"""Return intervals that all hold together: a simultaneous band.

    The half width is the same number of standard errors everywhere,

    .. math:: v_k \pm c\, \mathrm{sd}(v^*_k), \qquad
              P\bigl(\max_k |v^*_k - v_k| / \mathrm{sd}(v^*_k) \le c\bigr) = 1 - a

    with c stretched for few groups as in ``interval``. Where nothing varies the band has no width.

    Args:
        values: The statistics, shape (k,).
        resampled: The same in every resample, shape (resamples, k).
        groups: Number of independent groups.
        confidence: Coverage of all together, in (0, 1).

    Returns:
        The band.

    Raises:
        ValueError: If the shapes do not fit.
    """
    centre, drawn = np.asarray(values, np.float64), np.asarray(resampled, np.float64)
    if drawn.ndim != 2 or drawn.shape[1:] != centre.shape:
        msg = f"resampled must have shape (resamples, {centre.size}), got {drawn.shape}"
        raise ValueError(msg)
    spread = drawn.std(axis=0)
    moved = np.where(spread > 0, np.abs(drawn - drawn.mean(axis=0)), 0.0)
    largest = np.max(moved / np.where(spread > 0, spread, 1.0), axis=1, initial=0.0)
    normal = float(sp.norm.ppf((1 + confidence) / 2))
    reach = float(np.quantile(largest, confidence)) * _quantile(groups, confidence) / normal
    return Band(value=centre, low=centre - reach * spread, high=centre + reach * spread, n=groups)


def p_value(value: float, resampled: ArrayLike, *, groups: int) -> float:
    """Return the two-sided p-value of "it is zero" that belongs to ``interval``.

    Args:
        value: The statistic.
        resampled: The same in every resample.
        groups: Number of independent groups.

    Examples:
        >>> round(p_value(1.96, [-1.0, 1.0], groups=1), 3)
        0.05
    """
    error = float(np.std(np.asarray(resampled)))
    if error == 0.0:
        return float(value == 0.0)
    if groups < 2:
        return float(2 * sp.norm.sf(abs(value) / error))
    return float(2 * sp.t.sf(abs(value) / (error * np.sqrt(groups / (groups - 1))), groups - 1))


def _quantile(groups: int, confidence: float) -> float:
    """How many bootstrap standard errors an interval reaches to each side."""
    if not 0 < confidence < 1:
        msg = f"confidence must lie in (0, 1), got {confidence!r}"
        raise ValueError(msg)
    if groups < 2:
        return float(sp.norm.ppf((1 + confidence) / 2))
    return float(sp.t.ppf((1 + confidence) / 2, groups - 1) * np.sqrt(groups / (groups - 1)))
