"""Which speed can a car reach in each of the paper's speed ranges?

Full throttle on an empty road, in highway-env itself and in the compiled engine, beside what the
paper's setting (Section IV, Experimental Setup) amounts to in the engine's configuration.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from cpl.experiments.run.spec import Experiment, Shard, grid
from cpl.highway import PAPER, Engine, highway_env_options
from cpl.highway import Config as Road
from cpl.highway.reference import read_state, reference_env
from cpl.settings.ranges import Count, Settings

__all__ = ["EXPERIMENT", "PROFILES", "Config"]


_FASTER = 3
_ENGINES = ("highway-env", "cpl.highway")


@dataclass(frozen=True, kw_only=True)
class Config(Settings):
    """The ranges and how long the throttle is held.

    Attributes:
        top_speeds_mps: Upper ends of the speed ranges [m/s].
        low_speed_mps: Lower end of all of them [m/s].
        seconds: How long the throttle is held [s].
    """

    top_speeds_mps: tuple[float, ...] = (30.0, 40.0, 50.0)
    low_speed_mps: float = 20.0
    seconds: Count

    def __post_init__(self) -> None:
        super().__post_init__()
        if min(self.top_speeds_mps) <= self.low_speed_mps:
            raise ValueError(
                f"top_speeds_mps must exceed low_speed_mps, got {self.top_speeds_mps!r}"
            )


PROFILES = {
    "smoke": Config(seconds=3),
    "book": Config(seconds=12),
    "paper": Config(seconds=40),
}


def run_shard(config: Config, shard: Shard) -> pd.DataFrame:
    """Hold the throttle.

    Returns:
        One row a second: `engine`, `top_mps` (the range's nominal end), `second`, `speed_mps`,
        and the setting's `lanes_count` and `vehicles_count` with traffic.
    """
    top = float(shard["top_mps"])
    levels = tuple(np.linspace(config.low_speed_mps, top, 3).tolist())
    road = replace(PAPER, target_speeds=levels, vehicles_count=0)
    drive = _theirs if shard.text("engine") == "highway-env" else _ours
    speeds = list(drive(road, config.seconds))
    return pd.DataFrame(
        {
            "engine": shard.text("engine"),
            "top_mps": top,
            "second": range(len(speeds)),
            "speed_mps": speeds,
            "lanes_count": PAPER.lanes_count,
            "vehicles_count": PAPER.vehicles_count,
        }
    )


EXPERIMENT = Experiment(
    run=run_shard,
    profiles=PROFILES,
    shards=grid("{engine}-{top_mps:g}", engine=_ENGINES, top_mps="top_speeds_mps"),
    label="simulated",
)


def _ours(road: Road, seconds: int) -> Iterator[float]:
    engine = Engine(road, 1)
    engine.reset([0])
    yield float(engine.state().speed[0, 0])
    for _ in range(seconds):
        yield float(engine.step([_FASTER]).info.speed[0])


def _theirs(road: Road, seconds: int) -> Iterator[float]:
    env = reference_env(highway_env_options(road))
    env.reset(seed=0)
    yield float(read_state(env)["speed"][0])
    for _ in range(seconds):
        env.step(_FASTER)
        yield float(read_state(env)["speed"][0])
    env.close()
