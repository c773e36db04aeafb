"""A method beside a whole curve of rivals, where both cost the same."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cpl.stats.bootstrap import Weights, interval, sums
from cpl.stats.estimates import Estimate
from cpl.stats.fronts import at_levels
from cpl.stats.tradeoff import Curve

__all__ = ["Ratio", "along", "apart", "beside_curve", "ratio"]

Floats = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, eq=False)
class Ratio:
    """A ratio of sums over groups and units, such as crashes an episode or metres a second.

    Attributes:
        over: What is counted, shape (groups, units) of one method or (groups, units, k) of a curve.
        under: What it is divided by, the same shape.
    """

    over: Floats
    under: Floats


def ratio(over: ArrayLike, under: ArrayLike, *labels: ArrayLike) -> Ratio:
    """Add rows up over groups, units and, if given, the points of a curve.

    Args:
        over: What is counted, one a row.
        under: What it is divided by, one a row.
        labels: Each row's group, its unit and, for a curve, its point.

    Raises:
        ValueError: If some unit has no row.

    Examples:
        >>> ratio([1, 1, 1], [4, 4, 4], [0, 0, 1], [5, 5, 5]).over.tolist()
        [[2.0], [1.0]]
    """
    places = [np.unique(np.asarray(label), return_inverse=True) for label in labels]
    shape = tuple(len(names) for names, _ in places)
    at = tuple(inverse for _, inverse in places)
    sums_of = [np.zeros(shape), np.zeros(shape), np.zeros(shape)]
    for total, values in zip(sums_of, (over, under, np.ones(len(at[0]))), strict=True):
        np.add.at(total, at, np.asarray(values, np.float64))
    if not sums_of[2].all():
        raise ValueError(f"labels must meet in all {shape} combinations, got some without a row")
    return Ratio(over=sums_of[0], under=sums_of[1])


def beside_curve(
    y: Ratio,
    x: Ratio,
    curve_y: Ratio,
    curve_x: Ratio,
    weights: Weights,
    *,
    mixtures: bool = False,
    confidence: float = 0.95,
) -> Estimate:
    r"""Return how far a method's y lies above a curve's at the method's own x.

    $$ \Delta = y - c(x), \qquad
       c = \text{straight lines between the curve's points } (x_k, y_k) $$

    Everything is read anew in every resample: the method's x and y, the points, the lines. Outside
    of its points the curve keeps its last value.

    Args:
        y: What should be small: crashes over episodes.
        x: What is held equal: metres over seconds.
        curve_y: The same of the rivals, a last axis more.
        curve_x: The same of the rivals.
        weights: From ``hierarchical_weights``.
        mixtures: Whether the rivals may be mixed by a coin: the lower convex hull of the points.
        confidence: Of the interval.

    Returns:
        The difference; its ``n`` is the number of groups.

    Examples:
        Half way between two rivals, and .1 below them:

        >>> from cpl.stats import hierarchical_weights
        >>> ones = np.ones((2, 3))
        >>> weights = hierarchical_weights(2, 3, np.random.default_rng(0), resamples=20)
        >>> wide = np.ones((2, 3, 2))
        >>> found = beside_curve(
        ...     Ratio(over=0.2 * ones, under=ones), Ratio(over=1.5 * ones, under=ones),
        ...     Ratio(over=wide * [0.2, 0.4], under=wide), Ratio(over=wide * [1, 2], under=wide),
        ...     weights,
        ... )
        >>> round(found.value, 3), round(found.low, 3), round(found.high, 3)
        (-0.1, -0.1, -0.1)
    """
    value, drawn = _above(y, x, curve_y, curve_x, weights, mixtures=mixtures)
    return interval(value, drawn, groups=weights.groups, confidence=confidence)


def apart(
    first: tuple[Ratio, Ratio],
    second: tuple[Ratio, Ratio],
    curve: tuple[Ratio, Ratio],
    weights: Weights,
    *,
    mixtures: bool = False,
) -> Estimate:
    """Return how much farther above a curve one method lies than another, each at its own x.

    Args:
        first: A method's y and x, as in `beside_curve`.
        second: The other's; the same groups and units.
        curve: The rivals' y and x.
        weights: From ``hierarchical_weights``; the same resamples for both.
        mixtures: Whether the rivals may be mixed by a coin.

    Returns:
        The difference; its ``n`` is the number of groups.
    """
    (a, drawn_a), (b, drawn_b) = (
        _above(*own, *curve, weights, mixtures=mixtures) for own in (first, second)
    )
    return interval(a - b, drawn_a - drawn_b, groups=weights.groups)


def along(first: Curve, second: Curve, *, groups: int) -> list[Estimate | None]:
    """Return how far each point of a curve lies above another curve, at the point's own x.

    What `beside_curve` says of one method, for all points at once. The intervals hold one by one.

    Args:
        first: The curve whose points are asked about.
        second: The one that is read between its points; the same resamples.
        groups: Number of independent groups.

    Returns:
        One difference a point; None where the second curve has no point on one of its sides.
    """
    value = first.y - at_levels(second.x, second.y, first.x)
    drawn = first.y_drawn - at_levels(second.x_drawn, second.y_drawn, first.x_drawn)
    inside = (first.x >= second.x.min()) & (first.x <= second.x.max())
    return [
        interval(float(value[k]), drawn[:, k], groups=groups) if inside[k] else None
        for k in range(len(value))
    ]


def _above(
    y: Ratio, x: Ratio, curve_y: Ratio, curve_x: Ratio, weights: Weights, *, mixtures: bool = False
) -> tuple[float, Floats]:
    (own_y, drawn_y), (own_x, drawn_x) = _ratio(y, weights), _ratio(x, weights)
    (line_y, drawn_line_y), (line_x, drawn_line_x) = (
        _ratio(curve_y, weights),
        _ratio(curve_x, weights),
    )
    read = _hull if mixtures else _line
    value = float(own_y - read(line_x[None], line_y[None], own_x[None])[0])
    return value, drawn_y - read(drawn_line_x, drawn_line_y, drawn_x)


def _ratio(ratio: Ratio, weights: Weights) -> tuple[Floats, Floats]:
    (over, drawn_over), (under, drawn_under) = (
        sums(part, weights) for part in (ratio.over, ratio.under)
    )
    return over / under, drawn_over / drawn_under


def _line(x: Floats, y: Floats, at: Floats) -> Floats:
    return at_levels(x, y, at[:, None])[:, 0]


def _hull(x: Floats, y: Floats, at: Floats) -> Floats:
    """Read the lower convex hull of each row's points."""
    corners = [_lower(a, b) for a, b in zip(x, y, strict=True)]
    sizes, read = np.array([len(each) for each in corners]), np.empty(len(at))
    for size in np.unique(sizes):
        rows = np.flatnonzero(sizes == size)
        kept = np.array([corners[row] for row in rows])
        corner_x, corner_y = (np.take_along_axis(part[rows], kept, 1) for part in (x, y))
        read[rows] = _line(corner_x, corner_y, at[rows])
    return read


def _lower(x: Floats, y: Floats) -> list[int]:
    """Return the corners of the lower convex hull: Andrew's monotone chain."""
    kept: list[int] = []
    for k in np.lexsort((y, x)).tolist():
        while len(kept) > 1:
            a, b = kept[-2], kept[-1]
            if (x[b] - x[a]) * (y[k] - y[a]) > (y[b] - y[a]) * (x[k] - x[a]):
                break
            kept.pop()
        kept.append(k)
    return kept
