"""Do the compiled engine and highway-env make the same ride?

One episode with the same seed and the same actions in both, each car's place after every decision.
The large comparison is in the tests; this one can be looked at.
"""

from dataclasses import dataclass

import numpy as np
import pandas as pd

from cpl.experiments.run.spec import Experiment, Shard, grid
from cpl.highway import Config as Road
from cpl.highway import Engine, highway_env_options
from cpl.highway.reference import read_state, reference_env
from cpl.rng import stream
from cpl.settings.ranges import Count, Settings

__all__ = ["EXPERIMENT", "PROFILES", "Config", "differences"]


_ENGINES = ("highway-env", "cpl.highway")


@dataclass(frozen=True, kw_only=True)
class Config(Settings):
    """The ride.

    Attributes:
        seed: Environment seed; the actions are drawn from a stream of the same seed.
        steps: Decisions, one a second; the ride goes on after a crash, as highway-env's does.
        vehicles_count: Other cars.
        lanes_count: Lanes.
        top_speed_mps: Upper end of the speed range [m/s].
    """

    seed: int = 0
    steps: Count
    vehicles_count: int
    lanes_count: int = 4
    top_speed_mps: float = 40.0


PROFILES = {
    "smoke": Config(steps=3, vehicles_count=5),
    "book": Config(steps=20, vehicles_count=20),
    "paper": Config(steps=40, vehicles_count=50),
}


def run_shard(config: Config, shard: Shard) -> pd.DataFrame:
    """Drive the ride in one engine.

    Returns:
        One row a step and car: `engine`, `step` (0 after the reset), `vehicle` (0 is the ego),
        `x_m`, `y_m`, `heading_rad`, `speed_mps`, `target_lane` and `crashed`.
    """
    engine = shard.text("engine")
    road = Road(
        lanes_count=config.lanes_count,
        vehicles_count=config.vehicles_count,
        target_speeds=tuple(np.linspace(20.0, config.top_speed_mps, 3).tolist()),
    )
    actions = stream(config.seed, "side_by_side").integers(0, 5, config.steps).tolist()
    drive = _theirs if engine == "highway-env" else _ours
    table = pd.concat(
        [pd.DataFrame(state).assign(step=k) for k, state in enumerate(drive(road, config, actions))]
    )
    table.insert(0, "engine", engine)
    return table.rename_axis("vehicle").reset_index()


EXPERIMENT = Experiment(
    run=run_shard,
    profiles=PROFILES,
    shards=grid("{engine}", engine=_ENGINES),
    label="simulated",
    rtol=1e-6,  # the last bits of highway-env's mathematics differ between processors
)


def differences(table: pd.DataFrame) -> pd.Series:
    """Compare the two engines car by car.

    Args:
        table: What this experiment returns.

    Returns:
        By column, the largest absolute difference; of `target_lane` and `crashed`, how many rows
        differ.
    """
    place = ["step", "vehicle"]
    first, second = (
        table[table["engine"] == engine].set_index(place).drop(columns="engine")
        for engine in _ENGINES
    )
    counted = ["target_lane", "crashed"]
    measured = [name for name in first.columns if name not in counted]
    largest = (first[measured] - second[measured]).abs().max()
    return pd.concat([largest, (first[counted] != second[counted]).sum()])


def _theirs(road: Road, config: Config, actions: list[int]) -> list[dict[str, np.ndarray]]:
    env = reference_env(highway_env_options(road))
    env.reset(seed=config.seed)
    states = [_columns(read_state(env))]
    for action in actions:
        env.step(action)
        states.append(_columns(read_state(env)))
    env.close()
    return states


def _ours(road: Road, config: Config, actions: list[int]) -> list[dict[str, np.ndarray]]:
    engine = Engine(road, 1)
    engine.reset([config.seed])
    states = [_columns({k: v[0] for k, v in vars(engine.state()).items()})]
    for action in actions:
        engine.step([action])
        states.append(_columns({k: v[0] for k, v in vars(engine.state()).items()}))
    return states


def _columns(state: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    return {
        "x_m": state["x"],
        "y_m": state["y"],
        "heading_rad": state["heading"],
        "speed_mps": state["speed"],
        "target_lane": state["target_lane"],
        "crashed": state["crashed"],
    }
