"""How far the nearest car is, for a whole batch at once, exact and without copying the state."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from cpl.highway.engine import Engine
from cpl.highway.geometry import CAR_LENGTH
from cpl.highway.layout import Fields

__all__ = ["SIGHT", "nearest_distances"]

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
