"""Effects of what was changed, with training seeds and environment seeds resampled together."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from cpl.policies.comparison import chosen
from cpl.policies.measures import cube, measure
from cpl.rng import stream
from cpl.stats import (
    Estimate,
    Weights,
    at_levels,
    hierarchical_weights,
    interval,
    mean_interval,
    sums,
)

__all__ = ["beside", "contrast", "difference", "over_pairs", "speaks", "with_interval"]

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
) -> Estimate:
    r"""Estimate how far a method's measure lies above a curve of rivals at the method's own speed.

    $$ \Delta = \frac1L \sum_l \bigl( y_l - c(x_l) \bigr), \qquad
       c = \text{straight lines between the rivals' points} $$

    Everything is read anew in every resample. Outside of its points the curve keeps its last value.

    Args:
        table: Block sums with `pair`, `level` and `block`.
        method: Columns and values that choose the method, one point or L of them.
        curve: The same for the rivals.
        ends: The same for single points that belong to the rivals' curve.
        y: The measure that is compared.
        x: The measure that is held equal.

    Returns:
        The difference; below 0 the method crashes less than the rivals at the same speed.
    """
    own, *rivals = _common([chosen(table, which) for which in (method, curve, *ends)])
    weights = _weights(own)
    read = [
        [measure(part, name) for name in (x, y) for part in sums(cubes, weights)]
        for cubes in (own, np.concatenate(rivals, axis=2))
    ]
    (own_x, own_xs, own_y, own_ys), (line_x, line_xs, line_y, line_ys) = read
    value = float(np.mean(own_y - at_levels(line_x, line_y, own_x)))
    drawn = [
        np.mean(b - at_levels(p, q, a))
        for a, b, p, q in zip(own_xs, own_ys, line_xs, line_ys, strict=True)
    ]
    return interval(value, drawn, groups=weights.groups)


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


def with_interval(estimate: Estimate, form: str = "{:+.1f}") -> str:
    """Write an estimate with its interval.

    Examples:
        >>> with_interval(Estimate(value=1.0, low=-0.25, high=2.25, n=4), "{:+.2f}")
        '+1.00 (-0.25 to +2.25)'
    """
    value, low, high = (form.format(end) for end in (estimate.value, estimate.low, estimate.high))
    return f"{value} ({low} to {high})"


def speaks(estimate: Estimate) -> str:
    """Say whether an effect speaks for what predicted it to be positive.

    Examples:
        >>> speaks(Estimate(value=1.0, low=0.5, high=1.5, n=4))
        'for it'
        >>> speaks(Estimate(value=1.0, low=-0.5, high=2.5, n=4))
        'open'
    """
    if estimate.low > 0:
        return "for it"
    return "against it" if estimate.high <= 0 else "open"


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
