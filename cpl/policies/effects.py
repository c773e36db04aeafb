"""Effects of what was changed, with training seeds and environment seeds resampled together."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy import stats as sp

from cpl.policies.comparison import chosen
from cpl.policies.measures import MEASURES, SUMS, cube, measure
from cpl.rng import stream
from cpl.stats import Estimate, Weights, hierarchical_weights, interval, mean_interval, sums
from cpl.stats.matched import Ratio, beside_curve

__all__ = ["beside", "contrast", "difference", "over_pairs", "p_of"]

Which = Mapping[str, object]
Floats = NDArray[np.float64]


def difference(table: pd.DataFrame, first: Which, second: Which, name: str) -> Estimate:
    """Estimate a measure of one way to drive minus that of another, on the same episodes.

    Args:
        table: Block sums with `pair` and `block`.
        first: Columns and values that choose the first.
        second: The same for the second.
        name: One of `cpl.policies.measures.MEASURES`.
    """
    return contrast(table, [(1.0, first), (-1.0, second)], name)


def contrast(table: pd.DataFrame, terms: Sequence[tuple[float, Which]], name: str) -> Estimate:
    r"""Estimate a weighted sum of one measure over several ways to drive.

    $$ \Delta = \sum_k w_k\, m_k $$

    Pairs and environment seeds are resampled together for all of them. Pairs that one of them has
    not driven are left out.

    Args:
        table: Block sums with `pair` and `block`.
        terms: Each a weight, and the columns and values that choose its rows.
        name: One of `cpl.policies.measures.MEASURES`.

    Raises:
        ValueError: If a term has no rows, or they have no pair or block in common.
    """
    cubes = _common([chosen(table, which) for _, which in terms])
    weights = _weights(cubes[0])
    value, drawn = 0.0, np.zeros(len(weights.counts))
    for (factor, _), part in zip(terms, cubes, strict=True):
        total, resampled = sums(part[:, :, 0], weights)
        value += factor * float(measure(total, name))
        drawn += factor * measure(resampled, name)
    return interval(value, drawn, groups=weights.groups)


def beside(
    table: pd.DataFrame,
    method: Which,
    curve: Which,
    *,
    ends: Sequence[Which] = (),
    y: str = "crash_rate",
    x: str = "step_speed_mps",
    mixtures: bool = False,
) -> Estimate:
    """Estimate how far a method's measure lies above a curve of rivals at the method's own speed.

    Args:
        table: Block sums with `pair`, `level` and `block`.
        method: Columns and values that choose the method, one point.
        curve: The same for the rivals.
        ends: The same for single points that belong to the rivals' curve.
        y: The measure that is compared.
        x: The measure that is held equal.
        mixtures: Whether rivals may be mixed by a coin.

    Returns:
        The difference; below 0 the method crashes less than the rivals at the same speed.
    """
    own, *rivals = _common([chosen(table, which) for which in (method, curve, *ends)])
    joined = np.concatenate(rivals, axis=2)
    weights = _weights(own)
    ratios = [
        Ratio(over=part[..., SUMS.index(MEASURES[key][0])],
              under=part[..., SUMS.index(MEASURES[key][1])])
        for key in (y, x) for part in (own[:, :, 0], joined)
    ]  # fmt: skip
    own_y, rival_y, own_x, rival_x = ratios
    return beside_curve(own_y, own_x, rival_y, rival_x, weights, mixtures=mixtures)


def over_pairs(values: pd.Series) -> Estimate:
    """Estimate a mean over training seeds, one value each.

    Examples:
        >>> over_pairs(pd.Series([1.0, 2.0, 3.0])).value
        2.0
    """
    kept = values.dropna()
    if len(kept) < 2:
        value = float(kept.mean())
        return Estimate(value=value, low=-np.inf, high=np.inf, n=len(kept))
    return mean_interval(kept.to_numpy(np.float64))


def p_of(estimate: Estimate, *, confidence: float = 0.95) -> float:
    """Return the two-sided p-value that goes with a symmetric interval around an effect.

    Args:
        estimate: The effect; its `n` is the number of groups.
        confidence: Of the interval.

    Examples:
        An interval that just touches 0:

        >>> round(p_of(Estimate(value=1.0, low=0.0, high=2.0, n=4)), 6)
        0.05
    """
    free = max(estimate.n - 1, 1)
    half = (estimate.high - estimate.low) / 2
    if not half > 0:
        return 1.0 if estimate.value == 0 else 0.0
    scale = half / sp.t.ppf((1 + confidence) / 2, free)
    return float(2 * sp.t.sf(abs(estimate.value) / scale, free))


def _common(parts: list[pd.DataFrame]) -> list[Floats]:
    """Arrange block sums over the pairs and blocks that all parts have."""
    kept = parts
    for name in ("pair", "block"):
        shared = sorted(set.intersection(*(set(part[name]) for part in kept)))
        if not shared:
            raise ValueError(f"table must have a {name} that all terms share, got none")
        kept = [part.loc[part[name].isin(shared)] for part in kept]
    named = [part if "level" in part else part.assign(level=0) for part in kept]
    return [cube(part) for part in named]


def _weights(part: Floats) -> Weights:
    groups, units = part.shape[:2]
    return hierarchical_weights(groups, units, stream(0, "effects", groups, units))
