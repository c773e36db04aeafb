"""Which weight of its penalty serves an agent best?

"We select, for each agent separately, the weighting coefficient of the penalty terms to maximize
their performance" (Section IV, Baselines); the paper gives neither the grid nor the result. Here
rl_1 and rl_2 are trained over a small grid each, with training seeds of their own, and judged on
validation seeds by what the road pays them in the range of the training, without the penalty. rl_3
has the weights of both.
"""

from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
import pandas as pd

from cpl.experiments.run.spec import Experiment, Inputs, Shard
from cpl.experiments.trained import base_policies
from cpl.experiments.trained.forecasters import forecaster, need_forecasters
from cpl.experiments.trained.listening import Lessons, hearing_of, learn, penalty_of
from cpl.policies.listen import best, ride
from cpl.rng import stream
from cpl.settings.ranges import Count, interval

__all__ = ["EXPERIMENT", "PROFILES", "Config", "selected"]


_SEEDS, _VALIDATION = 10_000_000, 10_000_000
_TRAINING_TOP = 30.0  # [m/s]


@dataclass(frozen=True, kw_only=True)
class Config(Lessons):
    """The grid.

    Attributes:
        weights_q: Weights of the penalty on the norm of q, for rl_1 [-].
        weights_product: Weights of the penalty q l_hat, for rl_2 [-].
        tops_mps: Upper ends of the speed ranges of the validation [m/s]; only the training's
            range decides.
        episodes: Validation episodes in each.
    """

    weights_q: Annotated[tuple[float, ...], interval("[0, inf)")] = (1.0, 3.0, 10.0)
    weights_product: Annotated[tuple[float, ...], interval("[0, inf)")] = (2.0, 6.0, 20.0)
    tops_mps: tuple[float, ...] = (30.0, 40.0, 50.0)
    episodes: Count = 200

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("weights_q", "weights_product", "tops_mps"):
            if not getattr(self, name):
                raise ValueError(f"{name} must hold at least one number, got none")
        if _TRAINING_TOP not in self.tops_mps:
            raise ValueError(f"tops_mps must name {_TRAINING_TOP}, got {self.tops_mps!r}")


PROFILES = {
    "smoke": Config(
        pairs=1, models="smoke", steps=300, hidden=(32, 32), weights_q=(0.0, 1.0),
        weights_product=(1.0,), tops_mps=(30.0,), episodes=3,
    ),
    "book": Config(
        pairs=1, steps=20_000, weights_q=(0.0, 10.0), weights_product=(20.0,), episodes=50
    ),
    "paper": Config(pairs=2),
}  # fmt: skip


def _shards(config: Config) -> list[Shard]:
    """One training a shard."""
    grid = [("rl_1", weight) for weight in config.weights_q]
    grid += [("rl_2", weight) for weight in config.weights_product]
    return [
        Shard(f"{agent}-{weight:g}-{pair}", {"agent": agent, "weight": weight, "pair": pair})
        for pair in range(config.pairs)
        for agent, weight in grid
    ]


def run_shard(config: Config, shard: Shard, inputs: Inputs) -> pd.DataFrame:
    """Train one agent with one weight and drive it over the validation seeds.

    Returns:
        One row a speed range: `agent`, `weight`, `pair`, `seed`, `top_mps`, `episodes`, `paid`
        (what the road pays an episode, without the penalty), `duration_s`, `crash_rate`,
        `episode_speed_mps`, `mean_q` and `error_rate`.
    """
    agent, pair, weight = shard.text("agent"), shard.number("pair"), float(shard["weight"])
    seed = int(stream(pair, "penalty_grid", agent, repr(weight)).integers(_SEEDS))
    forecast = forecaster(inputs, "conformal", pair, calibrated=False)
    hears = hearing_of(agent, forecast, config.tracking)
    network, _ = learn(config, hears, penalty_of(agent, weight, weight), seed=seed)
    rows = []
    for top in config.tops_mps:
        base = replace(base_policies.PROFILES[config.models], top_speed_mps=top)
        seeds = range(_VALIDATION, _VALIDATION + config.episodes)
        road = base_policies.road(base, "speed")
        rides = ride(road, hears, best(network), list(seeds)).episodes
        rows.append(
            {
                "agent": agent,
                "weight": weight,
                "pair": pair,
                "seed": seed,
                "top_mps": top,
                "episodes": config.episodes,
                "paid": rides["reward_sum"].mean(),
                "duration_s": rides["steps"].mean(),
                "crash_rate": rides["crashed"].mean(),
                "episode_speed_mps": (rides["speed_sum"] / rides["steps"]).mean(),
                "mean_q": rides["u_sum"].sum() / max(rides["u_steps"].sum(), 1),
                "error_rate": rides["missed"].sum() / max(rides["scored"].sum(), 1),
            }
        )
    return pd.DataFrame(rows)


EXPERIMENT = Experiment(
    run=run_shard,
    profiles=PROFILES,
    shards=_shards,
    needs=lambda config, shard: [need_forecasters(config.models, shard.number("pair"))],
    label="simulated",
    extent=("pairs",),
    rtol=1e-6,
)


def selected(
    table: pd.DataFrame, agent: str, *, by: str = "paid", top_mps: float = _TRAINING_TOP
) -> float:
    """Return the weight that served an agent best, over all pairs; the smallest of equals.

    Args:
        table: What the experiment found.
        agent: "rl_1" or "rl_2".
        by: The measure that decides.
        top_mps: The speed range that decides [m/s].
    """
    rows = table.loc[(table["agent"] == agent) & (table["top_mps"] == top_mps)]
    weights = np.unique(rows["weight"])
    means = [float(np.mean(rows.loc[rows["weight"] == weight, by])) for weight in weights]
    return float(weights[int(np.argmax(means))])
