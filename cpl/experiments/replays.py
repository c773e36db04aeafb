"""What does the same traffic look like under different policies, second by second?

The rides that the book's replay shows: each environment seed is driven by every policy, with the
same forecaster and tracker watching, and the positions of the cars nearby are written down. These
are pictures of single rides; what holds over many is measured elsewhere.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from cpl.conformal import RunningMax
from cpl.experiments._shard import Shard
from cpl.highway import PAPER, Policy, Replay, record_replay
from cpl.highway import Config as Road
from cpl.highway.proximity import proximity
from cpl.policies.controls import Always
from cpl.policies.evaluate import Drivers, Forecast, Tracking, drive
from cpl.policies.headway import Headway
from cpl.policies.switch import Chooser, Switch

__all__ = ["LABEL", "PROFILES", "RTOL", "Config", "Team", "record", "run_shard", "shards"]

LABEL = "simulated"
RTOL = 1e-6  # the last bits of the engine's mathematics differ between processors

_BEHIND, _AHEAD = 45.0, 130.0  # [m] cars farther away than this are not written down
_DRIVERS = ("rules",)
_STRIDE = 5  # frames of the simulation between two that are written down


@dataclass(frozen=True, kw_only=True)
class Config:
    """The rides.

    Attributes:
        drivers: `rules`, two rules of thumb and a forecast that nothing changes.
        top_speeds_mps: Upper ends of the speed ranges [m/s].
        low_speed_mps: Lower end of all of them [m/s].
        rides: Rides in each range; the same environment seeds in all of them.
        first_seed: Environment seed of the first ride.
        alpha: Miscoverage that the tracker aims at [-].
        c: Step of the tracker, as a share of the largest score so far [-].
        q_safe: Where the switch hands over [-].
        horizon: How far the forecast looks [steps].
        hasty_gap_s: Free time ahead that the fast rule of thumb wants [s].
        careful_gap_s: Free time ahead that the careful one wants [s].
        vehicles_count: Other cars.
        duration_s: A ride ends after this time [s], or with a crash.
    """

    drivers: str = "rules"
    top_speeds_mps: tuple[float, ...] = (30.0, 40.0)
    low_speed_mps: float = 20.0
    rides: int
    first_seed: int = 20_000_000
    alpha: float = 0.1
    c: float = 0.1
    q_safe: float = 0.35
    horizon: int = 3
    hasty_gap_s: float = 0.6
    careful_gap_s: float = 2.0
    vehicles_count: int = 50
    duration_s: int = 40

    def __post_init__(self) -> None:
        if self.drivers not in _DRIVERS:
            raise ValueError(f"drivers must be one of {', '.join(_DRIVERS)}, got {self.drivers!r}")
        if self.rides < 1:
            raise ValueError(f"rides must be at least 1, got {self.rides!r}")


@dataclass(frozen=True, kw_only=True)
class Team:
    """Who drives, and who watches.

    Attributes:
        drivers: The two base policies.
        choosers: By name of the policy that is recorded: who of the two drives when.
        forecast: What the forecaster says.
    """

    drivers: Drivers
    choosers: Mapping[str, Chooser]
    forecast: Forecast


PROFILES = {
    "smoke": Config(rides=1, vehicles_count=12, duration_s=8, top_speeds_mps=(40.0,)),
    "book": Config(rides=6),
}


def shards(config: Config) -> list[Shard]:
    """One speed range and environment seed a shard, with all policies."""
    return [
        Shard(f"top{top:g}-seed{seed}", {"top_speed_mps": top, "seed": seed})
        for top in config.top_speeds_mps
        for seed in range(config.first_seed, config.first_seed + config.rides)
    ]


def run_shard(config: Config, shard: Shard) -> pd.DataFrame:
    """Drive one seed with every policy.

    Returns:
        One row a car and written frame: `top_speed_mps`, `seed`, `policy`, `time_s`, `car` (0 is
        the ego), `x_m`, `y_m`, `heading_rad`, `speed_mps`, `crashed`; on the ego's rows at a
        decision also `action`, `l_tilde`, `l_hat` and `q` (NaN without a forecast) and `safe`
        (whether the careful policy drives, 1 or 0), elsewhere NaN.
    """
    top, seed = float(shard["top_speed_mps"]), shard.number("seed")
    road = replace(
        PAPER,
        target_speeds=tuple(np.linspace(config.low_speed_mps, top, 3).tolist()),
        vehicles_count=config.vehicles_count,
        duration=float(config.duration_s),
    )
    team = _TEAMS[config.drivers](config, road)
    rides = [
        _table(record(road, seed, team, name, config)).assign(policy=name) for name in team.choosers
    ]
    table = pd.concat(rides, ignore_index=True)
    table.insert(0, "top_speed_mps", top)
    table.insert(1, "seed", seed)
    table.insert(2, "policy", table.pop("policy"))
    return table


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
        tracking=Tracking(rule=RunningMax(c=config.c), alpha=config.alpha, delay=config.horizon),
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


def _rules(config: Config, road: Road) -> Team:
    """Two rules of thumb, and a forecast that nothing changes."""

    def headway(gap_s: float) -> Policy:
        rule = Headway(time_gap_s=gap_s, lanes_count=road.lanes_count)
        return lambda obs: np.array([rule(one) for one in _metres(obs, road)])

    return Team(
        drivers=Drivers(safe=headway(config.careful_gap_s), speed=headway(config.hasty_gap_s)),
        choosers={
            "speed": Always([False]),
            "switch": Switch(config.q_safe),
            "safe": Always([True]),
        },
        forecast=_unchanged(road),
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


_TEAMS: dict[str, Callable[[Any, Road], Team]] = {"rules": _rules}
