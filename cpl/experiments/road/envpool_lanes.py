"""To which side do other cars change lanes, in highway-env's rules and in EnvPool's?

highway-env asks its car-following model about the left and then about the right neighbouring lane
and lets a later yes override an earlier one, so a car that may go both ways goes right. EnvPool's
C++ port returns at the first yes. Nothing else about the two need be known to tell them apart: the
first seconds of many roads are enough. EnvPool is installed with the extra `bench`.
"""

from dataclasses import dataclass, replace
from typing import Annotated, Any

import numpy as np
import numpy.typing as npt
import pandas as pd

from cpl.experiments.run.spec import Experiment, Shard, grid
from cpl.highway import Config as Road
from cpl.highway import Engine
from cpl.settings.ranges import Count, Settings, interval

__all__ = ["EXPERIMENT", "PROFILES", "Config"]


_SLOWER = 4
_SIDES = ("left", "right")
_VY_RANGE = 80.0  # [m/s] that highway-env maps to 1
_MOVING = 0.2  # [m/s] across the road, above what steering along a lane gives


@dataclass(frozen=True, kw_only=True)
class Config(Settings):
    """How many roads are watched, and for how long.

    Attributes:
        roads: Roads of each engine.
        seconds: How long they are watched [s]; longer, and the lanes fill up on the chosen side.
        seed: First seed.
        vehicles_count: Other cars.
        lanes_count: Lanes; with many, many cars can go both ways.
    """

    roads: Count
    seconds: Count = 2
    seed: int = 0
    vehicles_count: int = 50
    lanes_count: Annotated[int, interval("[3, inf)")] = 6


PROFILES = {
    "smoke": Config(roads=16, vehicles_count=8),
    "book": Config(roads=512),
    "paper": Config(roads=2048),
}


def run_shard(config: Config, shard: Shard) -> pd.DataFrame:
    """Watch the cars of the inner lanes, which can go both ways.

    Returns:
        One row a second and direction: `engine`, `second`, `direction` (left or right) and `cars`,
        how many cars of inner lanes were moving that way.

    Raises:
        ModuleNotFoundError: if EnvPool is asked for and not installed.
    """
    road = _EnvPool(config) if shard.text("engine") == "EnvPool" else _Ours(config)
    rows: list[dict[str, object]] = []
    for second in range(1, config.seconds + 1):
        for direction, cars in zip(_SIDES, _moving(road.step(), config.lanes_count), strict=True):
            rows.append({"second": second, "direction": direction, "cars": cars})
    table = pd.DataFrame(rows)
    table.insert(0, "engine", shard.text("engine"))
    return table


EXPERIMENT = Experiment(
    run=run_shard,
    profiles=PROFILES,
    shards=grid("{engine}", engine=("cpl.highway", "EnvPool")),
    label="simulated",
)


def _moving(obs: npt.NDArray[Any], lanes_count: int) -> tuple[int, int]:
    """Count the cars of inner lanes that move to the left and to the right."""
    seen = obs[:, 1:, 0] > 0.5
    lane = (obs[:, 1:, 2] + obs[:, :1, 2]) * lanes_count  # highway-env maps 4 m a lane to 1
    across = obs[:, 1:, 4] * _VY_RANGE
    inner = seen & (lane > 0.4) & (lane < lanes_count - 1.4)
    return int((inner & (across < -_MOVING)).sum()), int((inner & (across > _MOVING)).sum())


class _Ours:
    """The compiled engine, its ego car slowing down."""

    def __init__(self, config: Config) -> None:
        rows = config.vehicles_count + 1
        road = replace(
            Road(),
            vehicles_count=config.vehicles_count,
            lanes_count=config.lanes_count,
            observation_vehicles_count=rows,
        )
        self._engine = Engine(road, config.roads)
        self._engine.reset(np.arange(config.seed, config.seed + config.roads))
        self._actions = np.full(config.roads, _SLOWER)

    def step(self) -> npt.NDArray[Any]:
        return self._engine.step(self._actions).obs


class _EnvPool:
    """EnvPool's port, the same."""

    def __init__(self, config: Config) -> None:
        import envpool  # pyright: ignore[reportMissingImports]

        self._env = envpool.make_gymnasium(
            "Highway-v0",
            num_envs=config.roads,
            seed=config.seed,
            vehicles_count=config.vehicles_count,
            lanes_count=config.lanes_count,
            observation_vehicles_count=config.vehicles_count + 1,
        )
        self._env.reset()
        self._actions = np.full(config.roads, _SLOWER)

    def step(self) -> npt.NDArray[Any]:
        return np.asarray(self._env.step(self._actions)[0])
