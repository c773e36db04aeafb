"""Can anything that knows less do what the quantile does, and what would perfect knowledge do?

The switch of Section IV with the tracked quantile, against choosers without its information (a
clock, a coin, other episodes' quantiles, a limit of speed) and against oracles. Each is a curve
over a setting of its own, on the same environment seeds.
"""

from dataclasses import dataclass, replace
from functools import partial
from typing import Annotated

import numpy as np
import pandas as pd

from cpl.experiments.run.spec import Experiment, Inputs, Shard, grid
from cpl.experiments.switch.setup import (
    HORIZON,
    Setup,
    choose_thresholds,
    compact,
    curve,
    drive,
    drivers_of,
    pairs_of,
    road_of,
    tracking_of,
    validation_seeds,
)
from cpl.experiments.trained.forecasters import forecaster
from cpl.experiments.trained.needs import needs_of_pair
from cpl.highway import Config as Road
from cpl.policies.controls import (
    Always,
    Clock,
    Coin,
    OracleCrash,
    OracleProximity,
    RandomSwitch,
    Replay,
    capped,
    cruise,
    slower,
)
from cpl.policies.evaluate import Drivers, Forecast
from cpl.policies.switch import Switch
from cpl.settings.ranges import Count, interval
from cpl.stats import split_conformal_rank

__all__ = ["EXPERIMENT", "PROFILES", "Config"]


_TRAINING_TOP = 30.0  # [m/s] the speed range in which everything was trained


@dataclass(frozen=True, kw_only=True)
class Config(Setup):
    """The controls.

    Attributes:
        points: Points of each curve.
        donors: Validation episodes whose quantiles are replayed.
        oracle_blocks: Blocks of test seeds that the oracles drive; they cost five engines.
        oracle_horizons: How far the crash oracle looks [steps], a point each.
        seed: Of coins and dice.
    """

    points: Annotated[int, interval("[2, inf)")] = 6
    donors: Count = 60
    oracle_blocks: Count
    oracle_horizons: tuple[int, ...] = (2, 3, 4)
    seed: int = 0

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.oracle_blocks > self.blocks:
            raise ValueError(f"oracle_blocks must lie in [1, blocks], got {self.oracle_blocks!r}")


PROFILES = {
    "smoke": Config(
        pairs=1, models="smoke", episodes=4, validation_episodes=2, blocks=2, vehicles_count=8,
        points=2, donors=2, oracle_blocks=1,
    ),
    "book": Config(
        pairs=1, episodes=60, validation_episodes=10, blocks=20, points=4, donors=20,
        oracle_blocks=10,
    ),
    "paper": Config(pairs=10, episodes=250, validation_episodes=30, blocks=25, oracle_blocks=10),
}  # fmt: skip


def run_shard(config: Config, shard: Shard, inputs: Inputs) -> pd.DataFrame:
    """Drive all controls of one pair.

    Returns:
        One row a control, level and block of environment seeds: `pair`, `control`, `level`,
        `value` (the control's own setting), `block`, and `cpl.policies.measures.SUMS`.
    """
    pair = shard.number("pair")
    drivers, road = drivers_of(inputs, pair), road_of(config, config.top_speed_mps)
    forecast = forecaster(inputs, "conformal", pair, calibrated=False)
    tables = {
        **_quantiles(config, road, drivers, forecast),
        **_blind(config, road, drivers),
        **_oracles(config, road, drivers, forecast),
    }
    return pd.concat(
        [compact(table, {"pair": pair, "control": name}) for name, table in tables.items()],
        ignore_index=True,
    )


EXPERIMENT = Experiment(
    run=run_shard,
    profiles=PROFILES,
    shards=grid("pair{pair}", pair=pairs_of),
    needs=needs_of_pair,
    label="simulated",
    extent=("pairs", "first_pair"),
    rtol=1e-5,  # sums of speeds are stored in single precision
)


def _quantiles(
    config: Config, road: Road, drivers: Drivers, forecast: Forecast
) -> dict[str, pd.DataFrame]:
    """Drive the switch with its own quantile, and with others that keep some of its sides."""
    tracking, plain = tracking_of(config), partial(curve, forecast=forecast)
    q_safe = choose_thresholds(
        road, drivers, config, config.points, forecast=forecast, tracking=tracking
    )
    bare = choose_thresholds(road, drivers, config, config.points, forecast=forecast)
    donor = _traces(config, road, drivers, forecast, q_safe)
    mean = np.broadcast_to(
        np.nanmean(donor, axis=1, keepdims=True), (*donor.shape[:1], 1, donor.shape[2])
    )
    constant = np.full((len(q_safe), 1, donor.shape[2]), _split_quantile(config, drivers, forecast))
    return {
        "conformal": plain(road, drivers, Switch(q_safe), config, q_safe, tracking=tracking),
        "none": plain(road, drivers, Switch(bare), config, bare),
        "donor": plain(road, drivers, Replay(q_safe, donor), config, q_safe),
        "mean profile": plain(road, drivers, Replay(q_safe, mean), config, q_safe),
        "split constant": plain(road, drivers, Replay(q_safe, constant), config, q_safe),
    }


def _traces(
    config: Config, road: Road, drivers: Drivers, forecast: Forecast, q_safe: np.ndarray
) -> np.ndarray:
    """Record the quantile along validation episodes; after an episode's end it stays as it was."""
    steps = drive(
        road,
        drivers,
        Switch(q_safe),
        validation_seeds(config.donors),
        settings=len(q_safe),
        forecast=forecast,
        tracking=tracking_of(config),
        record=True,
    ).steps
    if steps is None:
        raise RuntimeError("no steps were recorded")
    length = round(config.duration_s)
    traces = np.full((len(q_safe), config.donors, length + 1), np.nan)
    place = (
        steps["setting"].to_numpy(),
        (steps["seed"] - validation_seeds(1)[0]).to_numpy(),
        steps["step"].to_numpy(),
    )
    traces[place] = steps["u"]
    for t in range(1, length + 1):
        ended = np.isnan(traces[..., t])
        traces[..., t] = np.where(ended, traces[..., t - 1], traces[..., t])
    return np.nan_to_num(traces)


def _split_quantile(config: Config, drivers: Drivers, forecast: Forecast) -> float:
    """Return the split conformal quantile of the errors in the range of the training."""
    road = road_of(replace(config, top_speed_mps=_TRAINING_TOP), _TRAINING_TOP)
    half = Coin([0.5], episodes=config.donors, seed=config.seed)
    steps = drive(
        road, drivers, half, validation_seeds(config.donors), forecast=forecast, record=True
    ).steps
    if steps is None:
        raise RuntimeError("no steps were recorded")
    later = steps.groupby("seed")["l_tilde"].shift(-HORIZON)
    scores = np.sort((later - steps["l_hat"]).abs().dropna().to_numpy())
    rank = min(split_conformal_rank(len(scores), config.alpha), len(scores))
    return float(scores[rank - 1])


def _blind(config: Config, road: Road, drivers: Drivers) -> dict[str, pd.DataFrame]:
    """Drive what does not look at a forecast at all."""
    n, seconds = config.episodes, round(config.duration_s)
    shares = np.linspace(0.1, 0.9, config.points)
    until = np.linspace(seconds / 8, seconds * 7 / 8, config.points).round()
    coin = Coin(shares, episodes=n, seed=config.seed)
    dice = RandomSwitch(shares, episodes=n, steps=seconds + 1, seed=config.seed)
    tops = np.linspace(config.low_speed_mps + 2.0, config.top_speed_mps - 2.0, config.points)
    fixed = np.linspace(config.low_speed_mps, config.low_speed_mps + 10.0, config.points)
    alone = replace(drivers, safe=slower, speed=slower)
    return {
        "coin": curve(road, drivers, coin, config, shares),
        "random": curve(road, drivers, dice, config, shares),
        "clock, safe first": curve(road, drivers, Clock(until, safe_first=True), config, until),
        "clock, fast first": curve(road, drivers, Clock(until, safe_first=False), config, until),
        "cap": _ranges(config, [capped(road, top) for top in tops], drivers, tops),
        "constant speed": _ranges(config, [cruise(road, v) for v in fixed], alone, fixed),
        "safe": curve(road, drivers, Always([True]), config, np.array([np.nan])),
        "speed": curve(road, drivers, Always([False]), config, np.array([np.nan])),
        "never": curve(road, drivers, Always([False], after=4), config, np.array([np.nan])),
    }


def _ranges(
    config: Config, roads: list[Road], drivers: Drivers, values: np.ndarray
) -> pd.DataFrame:
    """Drive pi_speed on roads that differ in the speed levels."""
    tables = [
        curve(road, drivers, Always([False]), config, np.array([value])).assign(level=level)
        for level, (road, value) in enumerate(zip(roads, values, strict=True))
    ]
    return pd.concat(tables, ignore_index=True)


def _oracles(
    config: Config, road: Road, drivers: Drivers, forecast: Forecast
) -> dict[str, pd.DataFrame]:
    """Drive with the true future, on the first test seeds."""
    count = config.oracle_blocks * (config.episodes // config.blocks)
    # The forecast of the true l_tilde has the same scale, so plain thresholds spread it well.
    q_safe = np.linspace(0.15, 0.75, config.points).round(3)
    far = np.array(config.oracle_horizons)
    near = OracleProximity(q_safe, drivers.speed, horizon=HORIZON)
    crash = OracleCrash(far, drivers.speed)
    return {
        "oracle l_tilde": curve(road, drivers, near, config, q_safe, episodes=count),
        "oracle crash": curve(road, drivers, crash, config, far, episodes=count),
    }
