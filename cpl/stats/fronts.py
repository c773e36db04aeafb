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
        levels: Where to read, shape (m,).

    Returns:
        y at the levels, shape (..., m).

    Raises:
        ValueError: If the shapes of x and y differ or a curve has no point.

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
    xs, ys = np.take_along_axis(xs, order, -1), np.take_along_axis(ys, order, -1)
    rows = [_read(a, b, where) for a, b in zip(_rows(xs), _rows(ys), strict=True)]
    return np.array(rows).reshape(*xs.shape[:-1], where.size)


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
    import moocore

    array, worst = np.asarray(points, np.float64), np.asarray(reference, np.float64)
    if array.ndim < 2 or array.shape[-1] != 2 or worst.shape != (2,):
        msg = f"points must have shape (..., k, 2) and reference (2,), got {array.shape}"
        raise ValueError(msg)
    if not (np.isfinite(array).all() and np.isfinite(worst).all()):
        msg = "points and reference must be finite, got NaN or infinity"
        raise ValueError(msg)
    measure = moocore.Hypervolume(ref=worst, maximise=True)
    flat = np.maximum(array, worst).reshape(-1, *array.shape[-2:])
    return np.array([float(measure(curve)) for curve in flat]).reshape(array.shape[:-2])


def _rows(array: Floats) -> Floats:
    return array.reshape(-1, array.shape[-1])


def _read(x: Floats, y: Floats, levels: Floats) -> Floats:
    if np.all(x[1:] > x[:-1]):
        return np.interp(levels, x, y)
    places, owner, counts = np.unique(x, return_inverse=True, return_counts=True)
    return np.interp(levels, places, np.bincount(owner, weights=y) / counts)
