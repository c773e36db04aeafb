"""How fast can each method drive, for how safe?

Section IV-F, Figure 2: the switch with the tracked quantile against five other uncertainties, each
as a curve over its threshold. The thresholds are chosen method by method on validation seeds, to
spread the share of steps under the safe policy evenly; the test seeds are the same for all.
"""

from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
import pandas as pd

from cpl.experiments.run.spec import Experiment, Inputs, Shard
from cpl.experiments.switch.setup import (
    BASELINES,
    Setup,
    choose_thresholds,
    compact,
    curve,
    drivers_of,
    pairs_of,
    road_of,
    tracking_of,
)
from cpl.experiments.trained.forecasters import forecaster
from cpl.experiments.trained.needs import needs_of_pair
from cpl.policies.controls import Always
from cpl.policies.switch import Switch, thresholds
from cpl.settings.ranges import Choice, Count, interval

__all__ = ["EXPERIMENT", "PROFILES", "Config"]


_SCALED = ("dropout", "ensemble", "hau", "certificates")  # what a calibration can change


_METHODS = ("conformal", *BASELINES)


@dataclass(frozen=True, kw_only=True)
class Config(Setup):
    """The curves.

    Attributes:
        methods: What is added to the forecast: `conformal` and baselines.
        thresholds: Points of each curve, in the range of `top_speed_mps`.
        q_safe: Thresholds for all methods in place of chosen ones; a single 0 chooses.
        side_tops_mps: Upper ends of other speed ranges [m/s]; 0 for none.
        side_pairs: Pairs there, none for 0.
        side_thresholds: Points of each curve there.
        side_episodes: Test episodes there; calibrated methods do not drive there.
    """

    methods: Annotated[tuple[str, ...], Choice(_METHODS)] = _METHODS
    thresholds: Annotated[int, interval("[2, inf)")] = 12
    q_safe: tuple[float, ...] = (0.0,)
    side_tops_mps: tuple[float, ...] = (30.0, 50.0)
    side_pairs: int = 5
    side_thresholds: Annotated[int, interval("[2, inf)")] = 8
    side_episodes: Count = 250

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.side_episodes % self.blocks:
            raise ValueError(
                f"side_episodes must be a multiple of blocks, got {self.side_episodes!r}"
            )
        thresholds(self.q_safe)


PROFILES = {
    "smoke": Config(
        pairs=1, models="smoke", episodes=4, validation_episodes=2, blocks=2, vehicles_count=8,
        methods=("conformal", "none", "dropout"), thresholds=2, side_tops_mps=(0.0,),
        side_episodes=2,
    ),
    "book": Config(
        pairs=1, episodes=60, validation_episodes=10, blocks=20, methods=("conformal", "none"),
        thresholds=6, side_tops_mps=(0.0,), side_episodes=20,
    ),
    "paper": Config(pairs=10, episodes=500, validation_episodes=30, blocks=25),
}  # fmt: skip


def _shards(config: Config) -> list[Shard]:
    """One pair in one speed range a shard."""
    sides = [top for top in config.side_tops_mps if top > 0]
    places = [(config.top_speed_mps, pair) for pair in pairs_of(config)]
    places += [(top, pair) for top in sides for pair in pairs_of(config, config.side_pairs)]
    return [Shard(f"top{top:g}-pair{pair}", {"top_mps": top, "pair": pair}) for top, pair in places]


def run_shard(config: Config, shard: Shard, inputs: Inputs) -> pd.DataFrame:
    """Drive all curves of one pair in one speed range.

    Returns:
        One row a method, calibration, level and block of environment seeds: `top_mps`, `pair`,
        `method`, `calibrated`, `level`, `value` (the threshold), `block`, and
        `cpl.policies.measures.SUMS`. The methods `safe`, `speed` and `never` are the safe policy,
        the fast one, and the fast one after the fifth observation: the end of all curves.
    """
    pair, top = shard.number("pair"), float(shard["top_mps"])
    main = top == config.top_speed_mps
    points = config.thresholds if main else config.side_thresholds
    episodes = config.episodes if main else config.side_episodes
    config = replace(config, episodes=episodes)
    drivers, road = drivers_of(inputs, pair), road_of(config, top)
    found = []
    for method in config.methods:
        for calibrated in (False, True) if main and method in _SCALED else (False,):
            forecast = forecaster(inputs, method, pair, calibrated=calibrated)
            tracking = tracking_of(config) if method == "conformal" else None
            how = {"forecast": forecast, "tracking": tracking}
            q_safe = np.asarray(config.q_safe)
            if not q_safe.any():
                q_safe = choose_thresholds(road, drivers, config, points, **how)
            table = curve(road, drivers, Switch(q_safe), config, q_safe, **how)
            found.append(compact(table, {"method": method, "calibrated": calibrated}))
    for name, safe, after in (("safe", True, 0), ("speed", False, 0), ("never", False, 4)):
        chooser = Always([safe], after=after)
        table = curve(road, drivers, chooser, config, np.array([np.nan]))
        found.append(compact(table, {"method": name, "calibrated": False}))
    joined = pd.concat(found, ignore_index=True)
    joined.insert(0, "top_mps", top)
    joined.insert(1, "pair", pair)
    return joined


EXPERIMENT = Experiment(
    run=run_shard,
    profiles=PROFILES,
    shards=_shards,
    needs=needs_of_pair,
    label="simulated",
    extent=("pairs", "first_pair", "side_pairs"),
    rtol=1e-5,  # sums of speeds are stored in single precision
)
