"""Does anything that learns beat the switch at the same speed, here and where nothing was trained?

Fixed before any test seed was driven:

- Attempts that learn: `wide` and `gate` (`cpl.experiments.trained.recipes`), with their twins
  without the quantile, and the paper's `rl` and `rl_nq`. Attempts without training: a threshold
  moved by near misses (`risk control`), the quantile carried over, and a forecast of a crash in
  place of the distance.
- Rivals: the switch over its thresholds, chosen on validation seeds at 20-40 m/s and kept on all
  roads; the coin, the speed cap and the clock.
- Statistic: crashes an episode minus the rivals' at the same mean speed (sum of speeds over sum of
  decisions), read off straight lines between the points of their curve and its two ends.
- Interval: 95 %, crossed bootstrap over training seeds and blocks of environment seeds. An attempt
  beats a rival on a road if the interval lies below 0.
- Whether an agent *uses* its quantile: the same agent under do(q), and its twin.
"""

from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
import pandas as pd

from cpl.experiments.gate.streams import WORLDS
from cpl.experiments.listen._attempts import (
    agent_sums,
    blind,
    doings_of,
    donors_of,
    switches,
    thresholds_of,
)
from cpl.experiments.run.spec import Experiment, Inputs, Shard, grid
from cpl.experiments.switch.setup import Setup, compact, drivers_of, pairs_of, road_of
from cpl.experiments.trained.agents import KNOWN, agent, needs_with_agents
from cpl.highway import Config as Road
from cpl.settings.ranges import Choice, Count, Share, interval

__all__ = ["EXPERIMENT", "PROFILES", "ROADS", "Config"]


ROADS: dict[str, tuple[float, dict[str, object]]] = {
    "20-30": (30.0, {}),
    "20-40": (40.0, {}),
    "20-50": (50.0, {}),
    "dense": (40.0, {"vehicles_density": 1.5}),
    "three lanes": (40.0, {"lanes_count": 3}),
    "aggressive": (40.0, dict(WORLDS["aggressive"].changes)),
    "noise": (40.0, dict(WORLDS["noise"].changes)),
    "dropout": (40.0, dict(WORLDS["dropout"].changes)),
}
"""Upper end of the speed range [m/s] and what else is different; all but three untrained."""

_CHOSEN = "20-40"  # the road on whose validation seeds thresholds are chosen


@dataclass(frozen=True, kw_only=True)
class Config(Setup):
    """The attempts and the rivals.

    Attributes:
        agents: Trained agents, of `cpl.experiments.trained.agents.KNOWN`.
        roads: Which of `ROADS`.
        points: Points of each curve.
        epsilons: Shares of near misses that the moved threshold aims at, a point each.
        donors: Validation episodes whose quantiles are shown in place of an agent's own.
    """

    agents: Annotated[tuple[str, ...], Choice(KNOWN)] = (
        "rl", "rl_nq", "wide", "wide_nq", "gate", "gate_nq",
    )  # fmt: skip
    roads: Annotated[tuple[str, ...], Choice(tuple(ROADS))] = tuple(ROADS)
    points: Annotated[int, interval("[2, inf)")] = 5
    epsilons: tuple[Share, ...] = (0.01, 0.02, 0.05, 0.1, 0.2)
    donors: Count = 40


PROFILES = {
    "smoke": Config(
        pairs=1, models="smoke", episodes=4, validation_episodes=2, blocks=2, vehicles_count=8,
        agents=("wide_nq", "gate"), roads=("20-40", "noise"), points=2, epsilons=(0.05, 0.2),
        donors=2,
    ),
    "book": Config(
        pairs=1, episodes=40, validation_episodes=10, blocks=20, agents=("gate", "gate_nq"),
        roads=("20-40",), points=3, epsilons=(0.02, 0.1), donors=10,
    ),
    "paper": Config(pairs=3, episodes=150, validation_episodes=30, blocks=15),
}  # fmt: skip


def run_shard(config: Config, shard: Shard, inputs: Inputs) -> pd.DataFrame:
    """Drive everything of one pair on one road.

    Returns:
        One row a way to drive, intervention, level and block of environment seeds: `road`, `pair`,
        `method`, `doing` ("natural", or what an agent is shown in place of q: its "mean", that of
        a "donor"), `level`, `value` (of a curve's setting), `block`, and the sums.
    """
    pair, name = shard.number("pair"), shard.text("road")
    drivers, road = drivers_of(inputs, pair), _road(config, name)
    chosen = thresholds_of(config, _road(config, _CHOSEN), drivers, inputs, pair, config.points)
    epsilons = np.asarray(config.epsilons)
    tables = switches(config, road, drivers, inputs, pair, chosen, epsilons)
    tables |= blind(config, road, drivers, config.points)
    parts = [compact(table, {"method": key}) for key, table in tables.items()]
    parts += [_agent(config, road, key, pair, inputs) for key in config.agents]
    joined = pd.concat(parts, ignore_index=True).fillna({"doing": "natural"})
    for place, (key, value) in enumerate({"road": name, "pair": pair}.items()):
        joined.insert(place, key, value)
    joined.insert(3, "doing", joined.pop("doing"))
    return joined


EXPERIMENT = Experiment(
    run=run_shard,
    profiles=PROFILES,
    shards=grid("pair{pair}-{road}", pair=pairs_of, road="roads"),
    needs=needs_with_agents,
    label="simulated",
    extent=("pairs", "first_pair"),
    rtol=1e-5,  # sums of speeds are stored in single precision
)


def _agent(config: Config, road: Road, name: str, pair: int, inputs: Inputs) -> pd.DataFrame:
    """Drive one agent as it is, and under do(q)."""
    who = agent(inputs, config.models, name, pair)
    donors = donors_of(road, who.hearing, who.network, config.donors)
    table = agent_sums(config, road, who.hearing, who.network, doings_of(who.hearing, donors))
    return compact(table.assign(level=0, value=np.nan), {"method": name})


def _road(config: Config, name: str) -> Road:
    top, changes = ROADS[name]
    return replace(road_of(config, top), **changes)  # type: ignore[arg-type]
