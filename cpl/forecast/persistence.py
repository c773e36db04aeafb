"""The forecast to beat: nothing changes."""

import numpy as np
import numpy.typing as npt

__all__ = ["persistence"]


def persistence(
    values: npt.ArrayLike, *, horizon: int
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    r"""Forecast each value `horizon` steps ahead to be what it is now.

    $$ \hat l_{t+h \mid t} = \tilde l_t $$

    Args:
        values: what is to be forecast, by time, shape (T,).
        horizon: steps ahead h [steps], >= 1.

    Returns:
        Forecast and truth of every forecast that was ever checked, both by the time at which the
        forecast was made, shape (max(T - h, 0),).

    Raises:
        ValueError: if `values` is not one sequence of finite numbers or `horizon` is below 1.

    >>> forecast, truth = persistence([0.1, 0.2, 0.4, 0.8], horizon=3)
    >>> forecast, truth
    (array([0.1]), array([0.8]))
    """
    series = np.asarray(values, dtype=np.float64)
    if series.ndim != 1 or not np.all(np.isfinite(series)):
        raise ValueError(f"values must be one sequence of finite numbers, not {values!r}")
    if horizon < 1:
        raise ValueError(f"horizon must be >= 1 step, not {horizon!r}")
    return series[:-horizon].copy(), series[horizon:].copy()
