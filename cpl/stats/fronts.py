"""Curves of points that trade one good against another: levels in common, and hypervolume."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = ["at_levels", "common_levels", "hypervolume"]

Floats = NDArray[np.float64]


def at_levels(x: ArrayLike, y: ArrayLike, levels: ArrayLike) -> Floats:
    """Read a curve at levels of x: straight lines between its points, in the order of x.

    Points with the same x count once, with the mean of their y. Outside of the points the curve
    keeps its last value, so choose levels that all curves reach (``common_levels``).

    Args:
        x: What is held equal, shape (..., k): collision rates, or durations.
        y: What is compared, the same shape: speeds.
        levels: Where to read, shape (m,); or (..., m), each curve at levels of its own.

    Returns:
        y at the levels, shape (..., m).

    Raises:
        ValueError: If the shapes of x and y differ, a curve has no point, or the levels do not fit.

    Examples:
        >>> at_levels([3.0, 1.0, 1.0], [9.0, 4.0, 6.0], [1.0, 2.0]).tolist()
        [5.0, 7.0]
    """
    xs, ys = np.asarray(x, np.float64), np.asarray(y, np.float64)
    where = np.asarray(levels, np.float64)
    if xs.shape != ys.shape or xs.ndim < 1 or xs.shape[-1] == 0:
        msg = f"y must have the shape of x and at least one point, got {xs.shape} and {ys.shape}"
        raise ValueError(msg)
    order = np.argsort(xs, axis=-1, kind="stable")
    xs, ys = (_rows(np.take_along_axis(part, order, -1)) for part in (xs, ys))
    shape = (*order.shape[:-1], where.shape[-1])
    where = _rows(np.broadcast_to(where, shape))
    read = np.empty(where.shape)
    rising = (np.diff(xs) > 0).all(axis=1)
    read[rising] = _lines(xs[rising], ys[rising], where[rising])
    for row in np.flatnonzero(~rising):
        places, owner, counts = np.unique(xs[row], return_inverse=True, return_counts=True)
        means = np.bincount(owner, weights=ys[row]) / counts
        read[row] = _lines(places[None], means[None], where[row, None])
    return read.reshape(shape)


def common_levels(*curves: ArrayLike, count: int) -> Floats:
    """Return evenly spaced levels that all curves reach: their common support, ends included.

    Args:
        curves: The x of each curve.
        count: How many levels, >= 2.

    Raises:
        ValueError: If there is no curve, no common support, or fewer than two levels are wanted.

    Examples:
        >>> common_levels([0.0, 2.0, 4.0], [1.0, 5.0], count=4).tolist()
        [1.0, 2.0, 3.0, 4.0]
    """
    if not curves or count < 2:
        msg = f"curves must be given and count be >= 2, got {len(curves)} curves and {count!r}"
        raise ValueError(msg)
    low = max(float(np.min(np.asarray(curve))) for curve in curves)
    high = min(float(np.max(np.asarray(curve))) for curve in curves)
    if not low < high:
        msg = f"curves must have levels in common, got none between {low:g} and {high:g}"
        raise ValueError(msg)
    return np.linspace(low, high, count)


def hypervolume(points: ArrayLike, reference: ArrayLike) -> Floats:
    """Return how much of the plane, down to a reference, a curve dominates; both goods maximised.

    Args:
        points: Shape (..., k, 2), one curve or many.
        reference: The worst point that counts, shape (2,); what lies below it adds nothing.

    Returns:
        The hypervolume (an area) of each curve, shape (...).

    Raises:
        ValueError: If the last axis is not 2 or a number is not finite.

    Examples:
        The point (2, 1) adds the unit square right of (1, 3)'s one by three:

        >>> float(hypervolume([[1.0, 3.0], [2.0, 1.0]], [0.0, 0.0]))
        4.0
    """
    array, worst = np.asarray(points, np.float64), np.asarray(reference, np.float64)
    if array.ndim < 2 or array.shape[-1] != 2 or worst.shape != (2,):
        msg = f"points must have shape (..., k, 2) and reference (2,), got {array.shape}"
        raise ValueError(msg)
    if not (np.isfinite(array).all() and np.isfinite(worst).all()):
        msg = "points and reference must be finite, got NaN or infinity"
        raise ValueError(msg)
    # From the right: each point adds what it reaches above all points to the right of it.
    x, y = np.moveaxis(np.maximum(array, worst), -1, 0)
    order = np.lexsort((-y, -x))
    x, y = np.take_along_axis(x, order, -1), np.take_along_axis(y, order, -1)
    below = np.maximum.accumulate(np.insert(y, 0, worst[1], axis=-1), axis=-1)[..., :-1]
    return np.cumsum((x - worst[0]) * np.maximum(y - below, 0), axis=-1)[..., -1]


def _rows(array: Floats) -> Floats:
    return array.reshape(-1, array.shape[-1])


def _lines(x: Floats, y: Floats, levels: Floats) -> Floats:
    """Return what `numpy.interp` does, bit for bit, row by row: x rises in each."""
    if not x.size:
        return np.empty_like(levels)
    left = np.clip((x[:, None, :] <= levels[:, :, None]).sum(axis=2) - 1, 0, None)
    right = np.minimum(left + 1, x.shape[1] - 1)
    (x0, x1), (y0, y1) = (
        (np.take_along_axis(part, left, 1), np.take_along_axis(part, right, 1)) for part in (x, y)
    )
    # At a point and outside of all the curve has a point's value, whatever the slope is.
    at_point = (levels <= x0) | (left == right)
    slope = np.divide(y1 - y0, x1 - x0, out=np.zeros_like(y0), where=~at_point)
    return np.where(at_point, y0, slope * (levels - x0) + y0)
