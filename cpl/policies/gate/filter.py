"""A Kalman filter for the observed cars, in its steady state."""

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_discrete_are

from cpl.highway import Config

__all__ = ["filter_gains"]

_UNREST = (1.5, 0.5)  # [m/s2] what cars accelerate along and across the road, about


def filter_gains(road: Config, noise: float) -> NDArray[np.float64]:
    r"""Return how far place and speed follow what is seen of them, along and across.

    $$ K = P H^T (H P H^T + R)^{-1}, \qquad P = F P F^T - F K H P F^T + Q $$

    for a car at constant speed with random accelerations, of which place and speed are observed
    once a decision.

    Args:
        road: Its scale of the observation and time between decisions.
        noise: Standard deviation of the observation's noise, in its units; 0 for no filter.

    Returns:
        Gains, shape (2, 2, 2): axis, state (place, speed), what is seen of it.

    Examples:
        >>> filter_gains(Config(), 0.0)[0].tolist()
        [[1.0, 0.0], [0.0, 1.0]]
        >>> bool(filter_gains(Config(), 0.02)[0, 0, 0] < 0.6)
        True
    """
    if noise == 0.0:
        return np.tile(np.eye(2), (2, 1, 1))
    t, ranges = 1 / road.policy_frequency, road.ranges()
    f, gains = np.array([[1.0, t], [0.0, 1.0]]), np.empty((2, 2, 2))
    for axis, names in enumerate((("x", "vx"), ("y", "vy"))):
        r = np.diag([(noise * ranges[name][1]) ** 2 for name in names])
        push = _UNREST[axis] * np.array([0.5 * t * t, t])
        p = solve_discrete_are(f.T, np.eye(2), np.outer(push, push) + 1e-9 * np.eye(2), r)
        gains[axis] = p @ np.linalg.inv(p + r)
    return gains
