"""Do agents that hear the forecast and its quantile learn to use them?

The five learned agents of Table I beside pi_speed (Section IV, Baselines): the same learner, road
and reward, with the forecast, with the quantile, and with penalties on it. Forecast and tracker run
inside the training environment; an outcome is known after its delay, as on the road. Each pair of
base policies has a forecaster, and each forecaster its five agents.
"""

from dataclasses import dataclass
from typing import Annotated

import pandas as pd

from cpl.experiments.run.spec import Experiment, Inputs, Need, Shard, grid
from cpl.experiments.trained import penalty_grid
from cpl.experiments.trained.forecasters import forecaster, need_forecasters
from cpl.experiments.trained.listening import AGENTS, Lessons, hearing_of, learn, penalty_of
from cpl.network import encode_networks
from cpl.policies.listen import Penalty
from cpl.rng import stream
from cpl.settings.ranges import Choice
from cpl.store import plain

__all__ = ["EXPERIMENT", "PROFILES", "Config"]


_SEEDS = 10_000_000  # training seeds lie below; validation and test seeds above


@dataclass(frozen=True, kw_only=True)
class Config(Lessons):
    """The trainings.

    Attributes:
        agents: Which agents; `cpl.experiments.trained.listening.AGENTS` says what they are.
        penalty_q: Weight of the penalty on the norm of q, of rl_1 and rl_3 [-]; a negative one is
            replaced by what `penalty_grid` selects.
        penalty_product: The same for the penalty q l_hat, of rl_2 and rl_3.
    """

    agents: Annotated[tuple[str, ...], Choice(AGENTS)] = AGENTS
    penalty_q: float = -1.0
    penalty_product: float = -1.0

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.agents:
            raise ValueError("agents must name at least one, got none")
        Penalty(q=self.penalty_q, product=self.penalty_product)


PROFILES = {
    "smoke": Config(pairs=1, models="smoke", steps=400, hidden=(32, 32)),
    "book": Config(pairs=1, agents=("rl",), steps=30_000),
    "paper": Config(pairs=10),
}


def _needs(config: Config, shard: Shard) -> list[Need]:
    """Return what a shard is computed from: a pair's forecaster, and the grid of the penalties."""
    needs = [need_forecasters(config.models, shard.number("pair"))]
    given = penalty_of(shard.text("agent"), config.penalty_q, config.penalty_product)
    if given.q < 0 or given.product < 0:
        grid = penalty_grid.PROFILES[config.models]
        names = tuple(part.name for part in penalty_grid.EXPERIMENT.shards(grid))
        needs.append(Need(experiment="penalty_grid", config=grid, shards=names))
    return needs


def run_shard(config: Config, shard: Shard, inputs: Inputs) -> pd.DataFrame:
    """Train one agent.

    Returns:
        Its learning curve, see `cpl.experiments.trained.listening.learn`, after the columns
        `agent`, `pair`, `seed`, `penalty_q` and `penalty_product` (the weights). The last row's
        `model` holds the network "q" with its settings, the others' are empty.
    """
    agent, pair = shard.text("agent"), shard.number("pair")
    seed = int(stream(pair, "listeners", agent).integers(_SEEDS))
    forecast = forecaster(inputs, "conformal", pair, calibrated=False)
    penalty = _penalty(config, agent, inputs)
    hears = hearing_of(agent, forecast, config.tracking)
    network, table = learn(config, hears, penalty, seed=seed)
    labels = {
        "agent": agent,
        "pair": pair,
        "seed": seed,
        "penalty_q": penalty.q,
        "penalty_product": penalty.product,
    }
    for place, (name, value) in enumerate(labels.items()):
        table.insert(place, name, value)
    how = EXPERIMENT.without_extent(plain(config))
    table["model"] = b""
    table.loc[len(table) - 1, "model"] = encode_networks(
        {"q": network}, {**labels, "parameters": how}
    )
    return table


EXPERIMENT = Experiment(
    run=run_shard,
    profiles=PROFILES,
    shards=grid("{agent}-{pair}", pair="pairs", agent="agents"),
    needs=_needs,
    label="simulated",
    extent=("pairs",),
    rtol=1e-6,  # of the learning curve's means; models agree bit for bit
)


def _penalty(config: Config, agent: str, inputs: Inputs) -> Penalty:
    given = penalty_of(agent, config.penalty_q, config.penalty_product)
    if "penalty_grid" not in inputs:
        return given
    grid = pd.concat(list(inputs["penalty_grid"].values()), ignore_index=True)
    return Penalty(
        q=penalty_grid.selected(grid, "rl_1") if given.q < 0 else given.q,
        product=penalty_grid.selected(grid, "rl_2") if given.product < 0 else given.product,
    )
