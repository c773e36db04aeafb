"""How near danger is: the distance l to the nearest car and its squashed form l_tilde.

The paper forecasts l_tilde three steps ahead (Section IV, Predictor Training). It says neither what
l is measured between nor which cars count; here l is the distance between centres, over all other
cars on the road unless a caller passes fewer.
"""

import numpy as np
import numpy.typing as npt

__all__ = ["distance_from_proximity", "nearest_distance", "proximity"]

_STEEPNESS = 0.1  # [1/m] the paper's factor in the exponent


def nearest_distance(
    ego: npt.ArrayLike, others: npt.ArrayLike
) -> npt.NDArray[np.float64] | np.float64:
    r"""Distance l between the ego vehicle's centre and the nearest other centre.

    $$ l = \min_i \lVert p_i - p_0 \rVert $$

    Args:
        ego: position(s) of the ego vehicle, shape (..., 2) [m].
        others: positions of the other vehicles, shape (..., n, 2) with n >= 1 [m].

    Returns:
        The distance [m], shape (...).

    Raises:
        ValueError: if the last axis is not 2, or no other vehicle is given.

    >>> float(nearest_distance([0.0, 0.0], [[3.0, 4.0], [30.0, 0.0]]))
    5.0
    """
    p0 = np.asarray(ego, dtype=np.float64)
    p = np.asarray(others, dtype=np.float64)
    if p0.ndim < 1 or p0.shape[-1] != 2:
        raise ValueError(f"ego must have shape (..., 2), not {p0.shape}")
    if p.ndim < 2 or p.shape[-1] != 2 or p.shape[-2] == 0:
        raise ValueError(f"others must have shape (..., n, 2) with n >= 1, not {p.shape}")
    return np.min(np.hypot(*np.moveaxis(p - p0[..., None, :], -1, 0)), axis=-1)


def proximity(l: npt.ArrayLike) -> npt.NDArray[np.float64] | np.float64:  # noqa: E741 (the paper's l)
    r"""Squash a distance l into l_tilde: 1 at contact of centres, falling towards 0 far away.

    $$ \tilde l = \frac{2}{1 + e^{0.1\, l}} $$

    Paper: Section IV, Predictor Training (which says the range is [0, 1]; it is (0, 1]).

    Args:
        l: distances [m], any shape, l >= 0.

    Returns:
        l_tilde [-], the same shape.

    Raises:
        ValueError: if a distance is negative or not finite.

    >>> float(proximity(0.0))
    1.0
    >>> round(float(proximity(17.0)), 2)
    0.31
    """
    d = np.asarray(l, dtype=np.float64)
    if not np.all(np.isfinite(d)) or np.any(d < 0):
        raise ValueError(f"l must be finite and >= 0 m, not {l!r}")
    # exp(-x) cannot overflow for x >= 0, exp(x) can.
    e = np.exp(-_STEEPNESS * d)
    return 2.0 * e / (1.0 + e)


def distance_from_proximity(l_tilde: npt.ArrayLike) -> npt.NDArray[np.float64] | np.float64:
    r"""Turn l_tilde back into the distance l it stands for.

    $$ l = 10 \ln(2 / \tilde l - 1) $$

    Args:
        l_tilde: proximities [-], any shape, 0 < l_tilde <= 1.

    Returns:
        l [m], the same shape.

    Raises:
        ValueError: if a value lies outside (0, 1].

    >>> round(float(distance_from_proximity(proximity(17.0))), 6)
    17.0
    """
    p = np.asarray(l_tilde, dtype=np.float64)
    if not np.all((p > 0) & (p <= 1)):
        raise ValueError(f"l_tilde must lie in (0, 1], not {l_tilde!r}")
    return np.log(2.0 / p - 1.0) / _STEEPNESS
