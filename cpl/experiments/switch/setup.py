"""What the experiments with the switch share: roads, seeds, thresholds, tables of block sums."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from cpl.conformal import RunningMax
from cpl.experiments.run.spec import Inputs
from cpl.experiments.trained.pairs import Models
from cpl.experiments.trained.policies import base_policy
from cpl.highway import PAPER
from cpl.highway import Config as Road
from cpl.policies.evaluate import Drivers, Forecast, Tracking, drive
from cpl.policies.measures import SUMS, block_sums
from cpl.policies.switch import Chooser, Switch
from cpl.settings.ranges import Count, Natural, Probability, Settings, interval

__all__ = [
    "BASELINES",
    "HORIZON",
    "Setup",
    "choose_thresholds",
    "compact",
    "curve",
    "drive",
    "drivers_of",
    "evaluation_seeds",
    "pairs_of",
    "road_of",
    "tracking_of",
    "validation_seeds",
]

HORIZON = 3  # [steps] how far the forecast looks
BASELINES = ("none", "dropout", "ensemble", "hau", "certificates")

_VALIDATION, _TEST = 10_000_000, 20_000_000  # training seeds lie below; the paper has no split

Ints = NDArray[np.int64]
Floats = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Setup(Settings):
    """The road, the policies that drive on it, and the tracker.

    Attributes:
        pairs: Training seeds: pairs of policies, each with its own forecaster.
        first_pair: Which pair is the first.
        models: Profile of the experiments that trained policies and forecasters.
        episodes: Test episodes of each pair and setting, the same environment seeds in all.
        validation_episodes: Episodes on which thresholds are chosen; other environment seeds.
        blocks: Into how many blocks the environment seeds are cut before they are added up.
        low_speed_mps: Lower end of the speed range [m/s].
        top_speed_mps: Upper end of it [m/s].
        levels: Speed levels, evenly spaced.
        lanes_count: Lanes.
        vehicles_count: Other cars.
        duration_s: An episode ends after this time [s], or with a crash.
        alpha: Miscoverage aimed at [-].
        share: The tracker's step as a share of the greatest score so far [-].
        delay: Steps after which a score is known [steps].
        carry: Whether an episode begins with the threshold that the one before ended with.
    """

    pairs: Count
    first_pair: Natural = 0
    models: Models = "paper"
    episodes: Count
    validation_episodes: Count
    blocks: Count
    low_speed_mps: float = 20.0
    top_speed_mps: float = 40.0
    levels: int = 3
    lanes_count: int = 4
    vehicles_count: int = 50
    duration_s: float = 40.0
    alpha: Probability = 0.1
    share: float = 0.1
    delay: Annotated[int, interval(f"[{HORIZON}, inf)")] = 3
    carry: bool = False

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.episodes % self.blocks:
            raise ValueError(f"blocks must divide episodes {self.episodes}, got {self.blocks!r}")
        tracking_of(self)
        road_of(self, self.top_speed_mps)


def pairs_of(setup: Setup, count: int | None = None) -> range:
    """Return the numbers of the pairs, or of the first few of them."""
    return range(setup.first_pair, setup.first_pair + (setup.pairs if count is None else count))


def road_of(setup: Setup, top_speed_mps: float) -> Road:
    """Return the road with a speed range; everything else is the paper's, or the setup's."""
    speeds = np.linspace(setup.low_speed_mps, top_speed_mps, setup.levels)
    return replace(
        PAPER,
        target_speeds=tuple(speeds.tolist()),
        lanes_count=setup.lanes_count,
        vehicles_count=setup.vehicles_count,
        duration=setup.duration_s,
    )


def tracking_of(setup: Setup) -> Tracking:
    """Return the tracker's settings."""
    rule = RunningMax(c=setup.share)
    return Tracking(rule=rule, alpha=setup.alpha, delay=setup.delay, carry=setup.carry)


def drivers_of(inputs: Inputs, pair: int) -> Drivers:
    """Return the two policies of a pair."""
    return Drivers(safe=base_policy(inputs, "safe", pair), speed=base_policy(inputs, "speed", pair))


def evaluation_seeds(count: int) -> Ints:
    """Return environment seeds for testing, the same for all methods and pairs."""
    return _TEST + np.arange(count)


def validation_seeds(count: int) -> Ints:
    """Return environment seeds for choosing thresholds; no test sees them."""
    return _VALIDATION + np.arange(count)


def curve(
    road: Road,
    drivers: Drivers,
    chooser: Chooser,
    setup: Setup,
    values: Floats,
    *,
    forecast: Forecast | None = None,
    tracking: Tracking | None = None,
    episodes: int = 0,
) -> pd.DataFrame:
    """Drive every setting of a chooser over the test seeds and add up by blocks.

    Args:
        road: The road.
        drivers: The policies.
        chooser: Who drives.
        setup: How many episodes and blocks.
        values: The chooser's settings (thresholds, shares, ...), for the table.
        forecast: As for `drive`.
        tracking: As for `drive`.
        episodes: Fewer test seeds than the setup's, a multiple of a block's; 0 for all.

    Returns:
        One row a setting and block: `level`, `value`, `block` and the sums.
    """
    count = episodes or setup.episodes
    rides = drive(
        road,
        drivers,
        chooser,
        evaluation_seeds(count),
        settings=len(values),
        forecast=forecast,
        tracking=tracking,
    )
    table = block_sums(rides.episodes, setup.blocks * count // setup.episodes)
    table.insert(1, "value", np.asarray(values, np.float64)[table["setting"]])
    return table.rename(columns={"setting": "level"})


def choose_thresholds(
    road: Road,
    drivers: Drivers,
    setup: Setup,
    count: int,
    *,
    forecast: Forecast,
    tracking: Tracking | None = None,
) -> Floats:
    """Choose thresholds that spread the share of steps under the safe policy evenly.

    Methods have scales of their own, so the same thresholds would put all points of one method
    into one corner. Two rounds on the validation seeds: a coarse grid, then what it suggests.

    Args:
        road: The road.
        drivers: The policies.
        setup: How many validation episodes.
        count: How many thresholds.
        forecast: The forecaster.
        tracking: The tracker, if there is one.

    Returns:
        Ascending thresholds in [0, 2], shape (count,).
    """
    seeds = validation_seeds(setup.validation_episodes)
    wanted = np.linspace(0.04, 0.96, count)
    grid = np.concatenate([np.linspace(0.0, 1.25, 14), [2.0]])
    tried, duty = np.empty(0), np.empty(0)
    for _ in range(2):
        rides = drive(
            road,
            drivers,
            Switch(grid),
            seeds,
            settings=len(grid),
            forecast=forecast,
            tracking=tracking,
        ).episodes
        safe, all_ = (
            rides[name].to_numpy(np.float64).reshape(len(grid), -1).sum(axis=1)
            for name in ("safe_steps", "steps")
        )
        found = safe / all_
        order = np.argsort(np.concatenate([tried, grid]), kind="stable")
        tried, duty = np.concatenate([tried, grid])[order], np.concatenate([duty, found])[order]
        falling = np.minimum.accumulate(duty)
        span = falling[-1] + wanted * (falling[0] - falling[-1])
        grid = np.unique(np.interp(span, falling[::-1], tried[::-1]).round(4))
    return np.interp(np.linspace(0, 1, count), np.linspace(0, 1, len(grid)), grid)


def compact(table: pd.DataFrame, labels: Mapping[str, object]) -> pd.DataFrame:
    """Put labels before a table of sums and store its numbers in few bytes."""
    whole = ("episodes", "steps", "crashes", "clean_steps", "clean_episodes", "overtaken",
             "safe_steps", "changes", "u_steps", "scored", "missed")  # fmt: skip
    small = {name: "int32" if name in whole else "float32" for name in SUMS}
    kinds = {"level": "int8", "block": "int16", **small}
    made = table.astype({name: kind for name, kind in kinds.items() if name in table})
    for place, (name, value) in enumerate(labels.items()):
        made.insert(place, name, value)
    return made
