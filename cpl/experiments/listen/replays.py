"""What does the same traffic look like under different policies, second by second?

The rides that the book's replay shows: each environment seed is driven by every policy, with the
same forecaster and tracker watching, and the positions of the cars nearby are written down. These
are pictures of single rides; what holds over many is measured elsewhere.

`rules` drives two rules of thumb and forecasts that nothing changes; `learned` takes the trained
policies and the forecaster of one pair, and the agent of Table I that hears forecast and quantile.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from cpl.conformal import RunningMax
from cpl.experiments.run.spec import Experiment, Inputs, Need, Shard
from cpl.experiments.switch.setup import Setup, choose_thresholds, drivers_of, tracking_of
from cpl.experiments.trained.agents import need_agents
from cpl.experiments.trained.forecasters import forecaster
from cpl.experiments.trained.listening import decoded, hearing_of
from cpl.experiments.trained.needs import needs
from cpl.experiments.trained.pairs import Models
from cpl.highway import PAPER, Policy, Replay, record_replay
from cpl.highway import Config as Road
from cpl.highway.proximity import proximity
from cpl.network import MLP
from cpl.policies.controls import Always
from cpl.policies.evaluate import Drivers, Forecast, Tracking, drive
from cpl.policies.headway import Headway
from cpl.policies.listen import Hearing, best, ride
from cpl.policies.switch import Chooser, Switch
from cpl.settings.ranges import Choice, Count, Natural, Settings

__all__ = ["EXPERIMENT", "PROFILES", "Config", "Team", "record"]


_BEHIND, _AHEAD = 45.0, 130.0  # [m] cars farther away than this are not written down
_DRIVERS = ("rules", "learned")
_AGENT = "rl"  # which of Table I's: the one that hears the quantile and is not penalised
_STRIDE = 5  # frames of the simulation between two that are written down


@dataclass(frozen=True, kw_only=True)
class Config(Settings):
    """The rides.

    Attributes:
        drivers: `rules` or `learned`.
        models: Profile of the experiments that trained what `learned` takes.
        pair: Which of the trained pairs.
        top_speeds_mps: Upper ends of the speed ranges [m/s].
        low_speed_mps: Lower end of all of them [m/s].
        rides: Rides in each range; the same environment seeds in all of them.
        first_seed: Environment seed of the first ride.
        alpha: Miscoverage that the tracker aims at [-].
        c: Step of the tracker, as a share of the largest score so far [-].
        q_safe: Where the switch hands over [-]; 0 chooses it on validation seeds in the widest
            range, so that the careful policy drives half of the time.
        validation_rides: How many of those there are.
        horizon: How far the forecast looks [steps].
        hasty_gap_s: Free time ahead that the fast rule of thumb wants [s].
        careful_gap_s: Free time ahead that the careful one wants [s].
        vehicles_count: Other cars.
        duration_s: A ride ends after this time [s], or with a crash.
    """

    drivers: Annotated[str, Choice(_DRIVERS)] = "rules"
    models: Models = "paper"
    pair: Natural = 0
    top_speeds_mps: tuple[float, ...] = (30.0, 40.0)
    low_speed_mps: float = 20.0
    rides: Count
    first_seed: int = 20_000_000
    alpha: float = 0.1
    c: float = 0.1
    q_safe: float = 0.35
    validation_rides: int = 30
    horizon: int = 3
    hasty_gap_s: float = 0.6
    careful_gap_s: float = 2.0
    vehicles_count: int = 50
    duration_s: int = 40


@dataclass(frozen=True, kw_only=True)
class Team:
    """Who drives, and who watches.

    Attributes:
        drivers: The two base policies.
        choosers: By name of the policy that is recorded: who of the two drives when.
        forecast: What the forecaster says.
        q_safe: Where the switch among the choosers hands over [-].
        agent: Who drives alone, hearing forecast and quantile: what it hears, and its network.
    """

    drivers: Drivers
    choosers: Mapping[str, Chooser]
    forecast: Forecast
    q_safe: float
    agent: tuple[Hearing, MLP] | None = None


PROFILES = {
    "smoke": Config(rides=1, vehicles_count=12, duration_s=8, top_speeds_mps=(40.0,)),
    "book": Config(rides=6),
    "paper": Config(drivers="learned", rides=6, top_speeds_mps=(30.0, 40.0, 50.0), q_safe=0.0),
}


def _shards(config: Config) -> list[Shard]:
    """One speed range and environment seed a shard, with all policies."""
    return [
        Shard(f"top{top:g}-seed{seed}", {"top_speed_mps": top, "seed": seed})
        for top in config.top_speeds_mps
        for seed in range(config.first_seed, config.first_seed + config.rides)
    ]


def _needs(config: Config, shard: Shard) -> list[Need]:
    """Return what a shard is computed from: the trained pair, if learned policies drive."""
    del shard
    if config.drivers == "rules":
        return []
    agents = need_agents(config.models, [_AGENT], config.pair)
    return [*needs(config.models, config.pair), *agents]


def run_shard(config: Config, shard: Shard, inputs: Inputs | None = None) -> pd.DataFrame:
    """Drive one seed with every policy.

    Returns:
        One row a car and written frame: `top_speed_mps`, `seed`, `policy`, `q_safe`, `time_s`,
        `car` (0 is the ego), `x_m`, `y_m`, `heading_rad`, `speed_mps`, `crashed`; on the ego's
        rows at a decision also `action`, `l_tilde`, `l_hat` and `q` (NaN without a forecast) and
        `safe` (whether the careful policy drives, 1 or 0), elsewhere NaN.
    """
    top, seed = float(shard["top_speed_mps"]), shard.number("seed")
    road = _road(config, top)
    team = _rules(config, road) if config.drivers == "rules" else _learned(config, inputs or {})
    rides = {name: record(road, seed, team, name, config) for name in team.choosers}
    if team.agent is not None:
        rides["agent"] = _alone(road, seed, *team.agent)
    tables = [_table(one).assign(policy=name) for name, one in rides.items()]
    table = pd.concat(tables, ignore_index=True)
    table.insert(0, "top_speed_mps", top)
    table.insert(1, "seed", seed)
    table.insert(2, "policy", table.pop("policy"))
    table.insert(3, "q_safe", team.q_safe)
    return table


EXPERIMENT = Experiment(
    run=run_shard,
    profiles=PROFILES,
    shards=_shards,
    needs=_needs,
    label="simulated",
    rtol=1e-6,  # the last bits of the engine's mathematics differ between processors
)


def record(road: Road, seed: int, team: Team, policy: str, config: Config) -> Replay:
    """Drive one ride and write down every frame of it.

    Args:
        road: The road.
        seed: Its environment seed.
        team: Who drives.
        policy: Which of the team's choosers.
        config: Tracker and horizon.

    Returns:
        The ride, with the series `l_tilde`, `l_hat`, `q` and `safe`.
    """
    actions: list[int] = []
    rides = drive(
        road,
        Drivers(
            safe=_noting(team.drivers.safe, actions), speed=_noting(team.drivers.speed, actions)
        ),
        team.choosers[policy],
        [seed],
        forecast=team.forecast,
        tracking=_tracking(config),
        horizon=config.horizon,
        n_envs=1,
        record=True,
    )
    if rides.steps is None:  # only if it was not asked to record
        raise RuntimeError("the drive was not recorded")
    decided = rides.steps.iloc[: len(actions)]
    names = {"l_tilde": "l_tilde", "l_hat": "l_hat", "u": "q", "safe": "safe"}
    series = {ours: decided[theirs].to_numpy(np.float64) for theirs, ours in names.items()}
    series["q"] = np.where(np.isnan(series["l_hat"]), np.nan, series["q"])
    return record_replay(road, seed, actions, label=policy, series=series)


def _alone(road: Road, seed: int, hears: Hearing, network: MLP) -> Replay:
    """Record one ride of the agent, as `record` does; the careful policy never drives."""
    steps = ride(road, hears, best(network), [seed], n_envs=1, record=True).steps
    if steps is None:  # only if it was not asked to record
        raise RuntimeError("the ride was not recorded")
    series = {name: steps[name].to_numpy(np.float64) for name in ("l_tilde", "l_hat", "q")}
    series["q"] = np.where(np.isnan(series["l_hat"]), np.nan, series["q"])
    series["safe"] = np.zeros(len(steps))
    actions = steps["action"].astype(int).tolist()
    return record_replay(road, seed, actions, label="agent", series=series)


def _noting(policy: Policy, actions: list[int]) -> Policy:
    """Return the policy, which also writes down what it does on the one road."""

    def noted(obs: NDArray[np.float32]) -> NDArray[np.integer]:
        chosen = np.asarray(policy(obs))
        actions.append(int(chosen[0]))
        return chosen

    return noted


def _table(ride: Replay) -> pd.DataFrame:
    """Return the cars near the ego, every few frames, with what was decided."""
    frames, cars = ride.x_m.shape
    kept = np.arange(0, frames, _STRIDE)
    if kept[-1] != frames - 1:
        kept = np.append(kept, frames - 1)
    frame, car = (axis.ravel() for axis in np.meshgrid(kept, np.arange(cars), indexing="ij"))
    table = pd.DataFrame(
        {
            "time_s": frame / ride.config.simulation_frequency,
            "car": car,
            "x_m": np.round(ride.x_m[frame, car], 2),
            "y_m": np.round(ride.y_m[frame, car], 2),
            "heading_rad": np.round(ride.heading_rad[frame, car], 3),
            "speed_mps": np.round(ride.speed_mps[frame, car], 2),
            "crashed": ride.crashed[frame, car],
        }
    )
    for name, values in {"action": ride.action, **ride.series}.items():
        padded = np.full(frames, np.nan)
        padded[: -1 : ride.config.frames] = values
        table[name] = np.where(car == 0, padded[frame], np.nan)
    away = ride.x_m[frame, car] - ride.x_m[frame, 0]
    return table.loc[(away >= -_BEHIND) & (away <= _AHEAD)].reset_index(drop=True)


def _road(config: Config, top_speed_mps: float) -> Road:
    return replace(
        PAPER,
        target_speeds=tuple(np.linspace(config.low_speed_mps, top_speed_mps, 3).tolist()),
        vehicles_count=config.vehicles_count,
        duration=float(config.duration_s),
    )


def _tracking(config: Config) -> Tracking:
    return Tracking(rule=RunningMax(c=config.c), alpha=config.alpha, delay=config.horizon)


def _setup(config: Config) -> Setup:
    return Setup(
        pairs=config.pair + 1,
        models=config.models,
        episodes=1,
        validation_episodes=config.validation_rides,
        blocks=1,
        vehicles_count=config.vehicles_count,
        duration_s=float(config.duration_s),
        alpha=config.alpha,
        share=config.c,
        delay=config.horizon,
    )


def _choosers(q_safe: float) -> dict[str, Chooser]:
    return {"speed": Always([False]), "switch": Switch(q_safe), "safe": Always([True])}


def _learned(config: Config, inputs: Inputs) -> Team:
    """Return the trained pair, its forecaster, and the agent that hears it."""
    drivers = drivers_of(inputs, config.pair)
    forecast = forecaster(inputs, "conformal", config.pair, calibrated=False)
    q_safe = config.q_safe
    if q_safe == 0.0:
        road, setup = _road(config, max(config.top_speeds_mps)), _setup(config)
        how = {"forecast": forecast, "tracking": tracking_of(setup)}
        q_safe = round(float(choose_thresholds(road, drivers, setup, 3, **how)[1]), 3)
    return Team(
        drivers=drivers,
        choosers=_choosers(q_safe),
        forecast=forecast,
        q_safe=q_safe,
        agent=(
            hearing_of(_AGENT, forecast, _tracking(config)),
            decoded(inputs, "listeners", f"{_AGENT}-{config.pair}"),
        ),
    )


def _rules(config: Config, road: Road) -> Team:
    """Two rules of thumb, and a forecast that nothing changes."""

    def headway(gap_s: float) -> Policy:
        rule = Headway(time_gap_s=gap_s, lanes_count=road.lanes_count)
        return lambda obs: np.array([rule(one) for one in _metres(obs, road)])

    return Team(
        drivers=Drivers(safe=headway(config.careful_gap_s), speed=headway(config.hasty_gap_s)),
        choosers=_choosers(config.q_safe),
        forecast=_unchanged(road),
        q_safe=config.q_safe,
    )


def _unchanged(road: Road) -> Forecast:
    rows, columns = road.observation_vehicles_count, len(road.features)

    def forecast(flat: NDArray[np.float32]) -> tuple[NDArray[np.floating], None]:
        obs = flat.reshape(len(flat), -1, rows, columns)[:, -1]
        cars = _metres(obs, road)[:, 1:]
        away = np.where(cars[..., 0] > 0, np.hypot(cars[..., 1], cars[..., 2]), np.inf)
        return np.asarray(proximity(away.min(axis=1))), None

    return forecast


def _metres(obs: NDArray[np.floating], road: Road) -> NDArray[np.float64]:
    """Undo the scaling of observations."""
    far = {name: high for name, (_, high) in road.ranges().items()}
    scales = np.array([1.0 if name == "presence" else far[name] for name in road.features])
    return np.asarray(obs, np.float64) * scales
