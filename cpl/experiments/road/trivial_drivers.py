"""What do drivers achieve that look at nothing?

Every later number needs these beside it: the paper's setting (Section IV), driven at one blind
speed, at full throttle, and at random.
"""

from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from cpl.experiments.run.spec import Experiment, Shard
from cpl.highway import PAPER, Policy, run_episodes
from cpl.rng import stream
from cpl.settings.ranges import Count, Natural, Settings

__all__ = ["EXPERIMENT", "PROFILES", "Config", "summary"]


_FASTER, _SLOWER = 3, 4  # highway-env's actions


@dataclass(frozen=True, kw_only=True)
class Config(Settings):
    """The drivers and how often each drives.

    Attributes:
        cruise_speeds_mps: Speeds that are held blindly [m/s], a driver each.
        top_speeds_mps: Upper ends of the speed ranges of the other drivers [m/s].
        low_speed_mps: Lower end of the speed ranges [m/s].
        episodes: Episodes of each driver; the same environment seeds for all.
        first_seed: Environment seed of the first episode.
        vehicles_count: Other cars.
        lanes_count: Lanes.
    """

    cruise_speeds_mps: tuple[float, ...]
    top_speeds_mps: tuple[float, ...] = (30.0, 40.0, 50.0)
    low_speed_mps: float = 20.0
    episodes: Count
    first_seed: Natural = 0
    vehicles_count: int = 50
    lanes_count: int = 4


PROFILES = {
    "smoke": Config(cruise_speeds_mps=(20.0, 30.0), episodes=4, vehicles_count=8),
    "book": Config(cruise_speeds_mps=(20.0, 22.0, 24.0, 28.0, 34.0, 40.0), episodes=100),
    "paper": Config(cruise_speeds_mps=tuple(float(v) for v in range(20, 41)), episodes=1000),
}


def _shards(config: Config) -> list[Shard]:
    """One driver a shard."""
    held = [
        Shard(f"cruise-{v:g}", {"driver": "cruise", "speed": v}) for v in config.cruise_speeds_mps
    ]
    ranged = [
        Shard(f"{driver}-{top:g}", {"driver": driver, "speed": top})
        for driver in ("faster", "random")
        for top in config.top_speeds_mps
    ]
    return held + ranged


def run_shard(config: Config, shard: Shard) -> pd.DataFrame:
    """Drive every episode of one driver.

    Returns:
        One row an episode: `driver` (cruise, faster or random), `speed_mps` (the speed that is
        held, or the upper end of the range), and the columns of `cpl.highway.run_episodes`.
    """
    driver, speed = shard.text("driver"), float(shard["speed"])
    levels = (
        (speed, speed + 1.0)
        if driver == "cruise"
        else tuple(np.linspace(config.low_speed_mps, speed, 3).tolist())
    )
    road = replace(
        PAPER,
        target_speeds=levels,
        vehicles_count=config.vehicles_count,
        lanes_count=config.lanes_count,
    )
    seeds = np.arange(config.first_seed, config.first_seed + config.episodes)
    table = run_episodes(road, _driver(driver, config.first_seed), seeds)
    table.insert(0, "driver", driver)
    table.insert(1, "speed_mps", speed)
    return table


EXPERIMENT = Experiment(
    run=run_shard,
    profiles=PROFILES,
    shards=_shards,
    label="simulated",
)


def summary(table: pd.DataFrame) -> pd.DataFrame:
    """Average over the episodes of each driver.

    Args:
        table: What this experiment returns.

    Returns:
        One row a driver and speed: `episodes`, `crashes`, `crash_rate`, `duration_s`,
        `mean_speed_mps`, `overtaken` and `crashes_per_km`.
    """
    rows = table.groupby(["driver", "speed_mps"], as_index=False).agg(
        episodes=("crashed", "size"),
        crashes=("crashed", "sum"),
        crash_rate=("crashed", "mean"),
        duration_s=("duration_s", "mean"),
        mean_speed_mps=("episode_mean_speed_mps", "mean"),
        overtaken=("overtaken", "mean"),
        distance_m=("distance_m", "sum"),
    )
    return rows.assign(crashes_per_km=1000 * rows["crashes"] / rows.pop("distance_m"))


def _driver(driver: str, seed: int) -> Policy:
    if driver == "random":
        draws = stream(seed, "trivial_drivers", driver)
        return lambda obs: draws.integers(0, 5, len(obs))
    action = _SLOWER if driver == "cruise" else _FASTER
    return lambda obs: np.full(len(obs), action)
