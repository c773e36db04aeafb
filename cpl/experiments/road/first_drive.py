"""What does a rule-of-thumb driver meet on highway-env, before and after the speed range widens?

Real highway-env at the paper's setting (Section IV, Experimental Setup), driven by
`cpl.policies.headway`. Everything a chapter derives (distances, forecasts, scores, quantiles) is
derived from the cars' positions stored here.
"""

from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
import pandas as pd

from cpl.experiments.run.spec import Experiment, Shard, grid
from cpl.highway.proximity import nearest_distance, proximity
from cpl.highway.reference import read_state, reference_env
from cpl.policies.headway import Headway
from cpl.settings.ranges import Count, Settings, interval

__all__ = ["EXPERIMENT", "PROFILES", "Config", "along"]


_KEPT = 150.0  # [m] cars farther along the road than this are not stored


@dataclass(frozen=True, kw_only=True)
class Config(Settings):
    """The rides.

    Attributes:
        top_speeds_mps: Upper ends of the speed ranges, one condition each [m/s].
        low_speed_mps: Lower end of all of them [m/s].
        levels: Speed levels the driver can choose from, evenly spaced.
        rides: Rides in each condition; the same environment seeds in all of them.
        first_seed: Environment seed of the first ride.
        time_gap_s: Free time ahead that the driver wants [s].
        lanes_count: Lanes.
        vehicles_count: Other cars.
        duration_s: A ride ends after this time [s], or with a crash.
    """

    top_speeds_mps: tuple[float, ...] = (30.0, 40.0)
    low_speed_mps: float = 20.0
    levels: Annotated[int, interval("[2, inf)")] = 3
    rides: Count
    first_seed: int = 0
    time_gap_s: float = 1.0
    lanes_count: int = 4
    vehicles_count: int = 50
    duration_s: int

    def __post_init__(self) -> None:
        super().__post_init__()
        if min(self.top_speeds_mps) <= self.low_speed_mps:
            raise ValueError(
                f"top_speeds_mps must exceed low_speed_mps, got {self.top_speeds_mps!r}"
            )


PROFILES = {
    "smoke": Config(rides=1, duration_s=5, vehicles_count=8),
    "book": Config(rides=2, duration_s=20),
    "paper": Config(rides=8, duration_s=40),
}


def run_shard(config: Config, shard: Shard) -> pd.DataFrame:
    """Drive once.

    Returns:
        One row a car and step: `top_speed_mps`, `ride`, `step` (0 before the first action),
        `vehicle` (0 is the ego), `x_m`, `y_m`, `heading_rad`, `speed_mps`, `crashed`, `action`
        (chosen after this step, -1 if none was) and `l_m`, the distance to the nearest other car
        (of all, stored or not).
    """
    top = float(shard["top_speed_mps"])
    env = reference_env(_options(config, top))
    drive = Headway(time_gap_s=config.time_gap_s, lanes_count=config.lanes_count)
    observation, _ = env.reset(seed=config.first_seed + shard.number("ride"))
    frames: list[pd.DataFrame] = []
    done = False
    while not done:
        action = drive(observation)
        frames.append(_frame(read_state(env), action))
        observation, _, terminated, truncated, _ = env.step(action)
        done = terminated or truncated
    frames.append(_frame(read_state(env), -1))
    env.close()
    table = pd.concat(frames, keys=range(len(frames)), names=["step", None]).reset_index("step")
    table.insert(0, "top_speed_mps", top)
    table.insert(1, "ride", shard.number("ride"))
    return table.reset_index(drop=True)


EXPERIMENT = Experiment(
    run=run_shard,
    profiles=PROFILES,
    shards=grid("top{top_speed_mps:g}-ride{ride}", top_speed_mps="top_speeds_mps", ride="rides"),
    label="simulated",
    rtol=1e-6,  # the last bits of highway-env's mathematics differ between processors
)


def along(table: pd.DataFrame) -> pd.DataFrame:
    """The ego's own rows of the rides, with the forecast target.

    Args:
        table: What this experiment returns.

    Returns:
        One row a step: the ego's columns and `l_tilde`, the squashed distance to the nearest car.
    """
    ego = table.loc[table["vehicle"] == 0].reset_index(drop=True)
    return ego.assign(l_tilde=proximity(ego["l_m"]))


def _options(config: Config, top: float) -> dict[str, Any]:
    speeds = np.linspace(config.low_speed_mps, top, config.levels)
    return {
        "lanes_count": config.lanes_count,
        "vehicles_count": config.vehicles_count,
        "duration": config.duration_s,
        "simulation_frequency": 15,  # [Hz]
        "policy_frequency": 1,  # [Hz]
        "action": {"type": "DiscreteMetaAction", "target_speeds": speeds.tolist()},
        "observation": {
            "type": "Kinematics",
            "vehicles_count": 6,  # the ego and the closest five
            "features": ["presence", "x", "y", "vx", "vy"],
            "normalize": False,
            "absolute": False,
            "see_behind": False,
            "order": "sorted",
        },
    }


def _frame(state: dict[str, Any], action: int) -> pd.DataFrame:
    here = np.column_stack([state["x"], state["y"]])
    frame = pd.DataFrame(
        {
            "vehicle": np.arange(len(here)),
            "x_m": here[:, 0],
            "y_m": here[:, 1],
            "heading_rad": state["heading"],
            "speed_mps": state["speed"],
            "crashed": state["crashed"],
            "action": action,
            "l_m": float(nearest_distance(here[0], here[1:])),
        }
    )
    return frame.loc[np.abs(here[:, 0] - here[0, 0]) <= _KEPT]
