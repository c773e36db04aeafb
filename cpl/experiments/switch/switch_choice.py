"""Which threshold would one choose, and what does the switch then do in many episodes?

Section IV-F leaves q_safe open ("a user specified threshold"; a commented line of the source says
0.3). Here it is chosen on validation seeds: the fastest threshold with at most a stated share of
crashes, once in the range in which the car is then driven and once in the range of the training,
which is all that a user has before a shift.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from cpl.experiments.run.spec import Experiment, Inputs, Shard, grid
from cpl.experiments.switch.setup import (
    HORIZON,
    Setup,
    drive,
    drivers_of,
    evaluation_seeds,
    pairs_of,
    road_of,
    tracking_of,
    validation_seeds,
)
from cpl.experiments.trained.forecasters import forecaster
from cpl.experiments.trained.needs import needs_of_pair
from cpl.policies.controls import Always
from cpl.policies.evaluate import Drivers, Forecast, Rides, Tracking
from cpl.policies.switch import Switch, thresholds
from cpl.settings.ranges import Count, Share

__all__ = ["EXPERIMENT", "PROFILES", "Config"]


_TRAINING_TOP = 30.0  # [m/s] the speed range in which everything was trained


@dataclass(frozen=True, kw_only=True)
class Config(Setup):
    """The choice, and how long the chosen ones drive.

    Attributes:
        tops_mps: Upper ends of the speed ranges [m/s].
        q_safe: The threshold that is not chosen [-].
        allowed: Share of validation episodes that may crash [-].
        long_episodes: Test episodes of the switch; the other policies have `episodes`.
        window: Scored steps in a row in which q must stay at or above the threshold for the
            estimate of Assumption 1 [steps].
    """

    tops_mps: tuple[float, ...] = (30.0, 40.0, 50.0)
    q_safe: float = 0.3
    allowed: Share = 0.1
    long_episodes: int
    window: Count = 5

    def __post_init__(self) -> None:
        super().__post_init__()
        thresholds(self.q_safe)
        if self.long_episodes < self.episodes:
            raise ValueError(
                f"long_episodes must be at least {self.episodes}, got {self.long_episodes!r}"
            )


PROFILES = {
    "smoke": Config(
        pairs=1, models="smoke", episodes=4, validation_episodes=2, blocks=2, vehicles_count=8,
        tops_mps=(40.0,), long_episodes=6,
    ),
    "book": Config(
        pairs=1, episodes=40, validation_episodes=20, blocks=20, tops_mps=(40.0,),
        long_episodes=80,
    ),
    "paper": Config(
        pairs=10, episodes=500, validation_episodes=50, blocks=25, long_episodes=2000
    ),
}  # fmt: skip


def run_shard(config: Config, shard: Shard, inputs: Inputs) -> pd.DataFrame:
    """Choose thresholds and drive, in all speed ranges.

    Returns:
        One row an episode: `pair`, `top_mps`, `policy` (`switch 0.3`: not chosen; `switch chosen`;
        `switch transferred`: chosen in the range of the training; `none chosen` and `none
        transferred`: without a quantile; `safe`; `speed`), `q_safe`, `seed`, `steps`, `crashed`,
        `speed_sum` and `last_speed` [m/s], `distance_m`, `overtaken`, `safe_steps`, `scored`,
        `missed`, and `floor_scored` and `floor_missed`: of the scores in windows in which q stayed
        at or above the threshold, how many there were and how many were missed.
    """
    pair = shard.number("pair")
    drivers, tracking = drivers_of(inputs, pair), tracking_of(config)
    forecast = forecaster(inputs, "conformal", pair, calibrated=False)
    found = []
    before = _chosen(config, _TRAINING_TOP, drivers, forecast, tracking)
    before_bare = _chosen(config, _TRAINING_TOP, drivers, forecast, None)
    for top in config.tops_mps:
        here = _chosen(config, top, drivers, forecast, tracking)
        bare = _chosen(config, top, drivers, forecast, None)
        road = road_of(config, top)
        for names, points, count, tracker in (
            (
                ["switch 0.3", "switch chosen"],
                [config.q_safe, here],
                config.long_episodes,
                tracking,
            ),
            (["switch transferred"], [before], config.episodes, tracking),
            (["none chosen", "none transferred"], [bare, before_bare], config.episodes, None),
        ):
            rides = drive(
                road, drivers, Switch(points), evaluation_seeds(count), settings=len(points),
                forecast=forecast, tracking=tracker, record=tracker is not None,
            )  # fmt: skip
            found.append(_rows(rides, names, np.array(points), config.window))
        rides = drive(
            road, drivers, Always([True, False]), evaluation_seeds(config.episodes), settings=2
        )
        found.append(_rows(rides, ["safe", "speed"], np.full(2, np.nan), config.window))
        for table in found[-4:]:
            table.insert(0, "top_mps", top)
    joined = pd.concat(found, ignore_index=True)
    joined.insert(0, "pair", pair)
    return joined


EXPERIMENT = Experiment(
    run=run_shard,
    profiles=PROFILES,
    shards=grid("pair{pair}", pair=pairs_of),
    needs=needs_of_pair,
    label="simulated",
    extent=("pairs", "first_pair"),
    rtol=1e-5,  # speeds are stored in single precision
)


def _chosen(
    config: Config, top: float, drivers: Drivers, forecast: Forecast, tracking: Tracking | None
) -> float:
    """Return the greatest threshold at and below which the validation crashes are allowed.

    If none is, the safest one.
    """
    grid = np.round(np.arange(0.1, 1.25, 0.1), 2)
    rides = drive(
        road_of(config, top), drivers, Switch(grid), validation_seeds(config.validation_episodes),
        settings=len(grid), forecast=forecast, tracking=tracking,
    ).episodes  # fmt: skip
    rate = rides["crashed"].to_numpy(np.float64).reshape(len(grid), -1).mean(axis=1)
    fine = np.cumprod(rate <= config.allowed).sum()
    return float(grid[max(int(fine) - 1, 0)])


def _rows(
    rides: Rides, names: Sequence[str], q_safe: NDArray[np.float64], window: int
) -> pd.DataFrame:
    """Name the settings, add the scores under Assumption 1, and store numbers in few bytes."""
    table = rides.episodes.drop(columns=["changes", "u_sum", "u_steps"])
    table.insert(0, "policy", np.array(names)[table["setting"]])
    table.insert(1, "q_safe", q_safe[table["setting"]])
    table = table.assign(floor_scored=0, floor_missed=0)
    if rides.steps is not None:
        counts = _floor(rides.steps, q_safe, window)
        table = table.drop(columns=["floor_scored", "floor_missed"]).merge(
            counts, on=["setting", "seed"], how="left"
        )
    bytes_ = ["steps", "safe_steps", "scored", "missed", "floor_scored", "floor_missed"]
    kinds = dict.fromkeys(bytes_, "int16") | {"seed": "int32", "overtaken": "int16"}
    floats = dict.fromkeys(["q_safe", "speed_sum", "last_speed", "distance_m"], "float32")
    return (
        table.drop(columns="setting")
        .fillna({"floor_scored": 0, "floor_missed": 0})
        .astype({**kinds, **floats})
    )


def _floor(steps: pd.DataFrame, q_safe: NDArray[np.float64], window: int) -> pd.DataFrame:
    """Count scores, and misses, in windows of forecasts that all met q >= the threshold."""
    later = steps.groupby(["setting", "seed"], sort=False)["l_tilde"].shift(-HORIZON)
    scores = (later - steps["l_hat"]).abs().to_numpy()
    u, setting = steps["u"].to_numpy(), steps["setting"].to_numpy()
    high = (u >= q_safe[setting]) & np.isfinite(scores)
    # A run of high steps ends with a low one or with the episode; it counts from a length on.
    begins = steps["step"].to_numpy() == 0
    run = np.cumsum(begins | ~high)
    counted = high & (np.bincount(run, weights=high)[run] >= window)
    missed = counted & (scores > u)
    frame = pd.DataFrame({"setting": setting, "seed": steps["seed"], "a": counted, "b": missed})
    sums = pd.DataFrame(frame.groupby(["setting", "seed"])[["a", "b"]].sum()).reset_index()
    return sums.set_axis(["setting", "seed", "floor_scored", "floor_missed"], axis=1)
