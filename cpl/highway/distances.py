"""How far the nearest car is, for a whole batch at once, exact and without copying the state."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from cpl import portable
from cpl.highway._compile import kernel
from cpl.highway.engine import Engine
from cpl.highway.geometry import CAR_LENGTH
from cpl.highway.layout import Fields
from cpl.highway.proximity import proximity

__all__ = ["SIGHT", "nearest_distances", "nearest_proximities", "proximities_range"]

SIGHT = 200.0  # [m] how far the ego car sees; l where no car is observed


def nearest_distances(
    engine: Engine, cars: Literal["all", "observed"] = "all"
) -> NDArray[np.float64]:
    r"""Distance l from each environment's ego car to the nearest other car, between centres.

    $$ l = \min_i \lVert p_i - p_0 \rVert $$

    Paper: Section IV, Predictor Training, which says neither which cars count nor what is measured
    between. All cars count here unless `cars` says otherwise.

    Args:
        engine: the roads, after a reset.
        cars: "all" other cars on the road, or only the "observed" ones: those that the next
            observation shows (before noise and dropout); without any, l is `SIGHT`.

    Returns:
        l [m], shape (n_envs,).

    Raises:
        ValueError: if there is no other car, the order of observation is shuffled (the observed
            cars are then drawn, not known), or `cars` is neither of the two.

    >>> from cpl.highway.config import Config
    >>> engine = Engine(Config(vehicles_count=5), n_envs=2)
    >>> _ = engine.reset(seeds=[0, 1])
    >>> nearest_distances(engine).shape
    (2,)
    """
    config = engine.config
    if config.vehicles_count < 1:
        raise ValueError(f"vehicles_count must be >= 1 for a distance, got {config.vehicles_count}")
    if cars not in ("all", "observed"):
        raise ValueError(f"cars must be 'all' or 'observed', got {cars!r}")
    if cars == "observed" and config.order == "shuffled":
        raise ValueError("order must be 'sorted' where cars='observed', got 'shuffled'")
    memory, n = engine._memory, config.vehicles_count + 1
    x, y = memory.cars[:, Fields.X, :n], memory.cars[:, Fields.Y, :n]
    dx, dy = x[:, 1:] - x[:, :1], y[:, 1:] - y[:, :1]
    squared = dx * dx + dy * dy
    if cars == "all":
        return np.sqrt(squared.min(axis=1))
    seen = squared < SIGHT * SIGHT
    if not config.see_behind:
        seen &= dx > -2 * CAR_LENGTH
    ahead = np.where(seen, np.abs(dx), np.inf)
    chosen = np.argsort(ahead, axis=1, kind="stable")[:, : config.observation_vehicles_count - 1]
    found = np.take_along_axis(np.where(seen, squared, SIGHT * SIGHT), chosen, axis=1)
    return np.sqrt(found.min(axis=1, initial=SIGHT * SIGHT))


def nearest_proximities(engine: Engine) -> NDArray[np.float64]:
    r"""Squashed distance l_tilde to the nearest other car, in the engine's arithmetic.

    Args:
        engine: The roads, after a reset.

    Returns:
        l_tilde [-], shape (n_envs,); on the path "own" the same bits on every machine.

    Raises:
        ValueError: If there is no other car.

    >>> from cpl.highway.config import Config
    >>> engine = Engine(Config(vehicles_count=5), n_envs=2)
    >>> _ = engine.reset(seeds=[0, 1])
    >>> bool((nearest_proximities(engine) < 1).all())
    True
    """
    if engine.path != "own":
        return np.asarray(proximity(nearest_distances(engine)), np.float64)
    if engine.config.vehicles_count < 1:
        raise ValueError("vehicles_count must be >= 1 for a distance, got 0")
    found = np.empty(engine.n_envs)
    proximities_range(engine._memory.cars, engine.config.vehicles_count + 1, found)
    return found


@kernel
def proximities_range(cars: np.ndarray, n: int, out: np.ndarray) -> None:
    """Fill each road's l_tilde, without libm."""
    for e in range(cars.shape[0]):
        x, y = cars[e, 0], cars[e, 1]
        least = np.inf
        for j in range(1, n):
            dx, dy = x[j] - x[0], y[j] - y[0]
            least = min(least, dx * dx + dy * dy)
        shrunk = portable.exp(-0.1 * np.sqrt(least))
        out[e] = 2.0 * shrunk / (1.0 + shrunk)
