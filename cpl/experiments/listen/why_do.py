"""What does an agent do if somebody else sets its quantile?

Interventions do(q) on trained agents, on the same test seeds: q as it is tracked; frozen at its
mean in the range of training; that of another episode in the same range, step by step; that of an
episode in another range; and the same value always, from 0 up. The road, the forecast and the
tracker go on undisturbed, so a difference in survival is the effect of what q told the agent, or
of its not telling it.
"""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
import pandas as pd

from cpl.experiments.listen._attempts import agent_sums, donors_of
from cpl.experiments.run.spec import Experiment, Inputs, Shard, grid
from cpl.experiments.switch.setup import Setup, compact, pairs_of, road_of
from cpl.experiments.trained.agents import KNOWN, Agent, agent, needs_with_agents
from cpl.policies.doing import Doing, freeze, natural, replay
from cpl.settings.ranges import Choice, Count

__all__ = ["EXPERIMENT", "PROFILES", "Config"]


_TRAINING_TOP = 30.0  # [m/s]


_HEARING = tuple(name for name in KNOWN if not name.endswith("_nq"))


@dataclass(frozen=True, kw_only=True)
class Config(Setup):
    """The interventions.

    Attributes:
        agents: Who, of `cpl.experiments.trained.agents.KNOWN`; those that see no quantile are
            refused.
        tops_mps: Upper ends of the speed ranges [m/s].
        q_values: What q is set to [-].
        donors: Validation episodes whose quantiles are shown in place of an agent's own.
    """

    agents: Annotated[tuple[str, ...], Choice(_HEARING)] = ("rl", "rl_1", "rl_2", "rl_3")
    tops_mps: tuple[float, ...] = (30.0, 40.0, 50.0)
    q_values: tuple[float, ...] = (0.0, 0.2, 0.4, 0.6, 0.8, 1.0, 1.2)
    donors: Count = 60

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.q_values or not np.isfinite(self.q_values).all():
            raise ValueError(f"q_values must be finite, at least one, got {self.q_values!r}")


PROFILES = {
    "smoke": Config(
        pairs=1, models="smoke", episodes=4, validation_episodes=2, blocks=2, vehicles_count=8,
        agents=("rl",), tops_mps=(40.0,), q_values=(0.0, 1.0), donors=2,
    ),
    "book": Config(
        pairs=1, episodes=40, validation_episodes=2, blocks=20, agents=("rl",), tops_mps=(40.0,),
        q_values=(0.0, 0.6, 1.2), donors=10,
    ),
    "paper": Config(pairs=10, episodes=125, validation_episodes=2, blocks=25),
}  # fmt: skip


def run_shard(config: Config, shard: Shard, inputs: Inputs) -> pd.DataFrame:
    """Drive every agent of a pair under every intervention.

    Returns:
        One row a speed range, agent, intervention and block of environment seeds: `top_mps`,
        `pair`, `agent`, `doing` ("natural", "mean", "donor", "swap" or "set"), `value` (of "set"
        and "mean"; else NaN), `block`, and the sums.
    """
    pair = shard.number("pair")
    found = []
    for name in config.agents:
        listener = agent(inputs, config.models, name, pair)
        for top in config.tops_mps:
            table = _driven(config, listener, top)
            found.append(compact(table, {"top_mps": top, "pair": pair, "agent": name}))
    return pd.concat(found, ignore_index=True)


EXPERIMENT = Experiment(
    run=run_shard,
    profiles=PROFILES,
    shards=grid("pair{pair}", pair=pairs_of),
    needs=needs_with_agents,
    label="simulated",
    extent=("pairs", "first_pair"),
    rtol=1e-5,  # sums of speeds are stored in single precision
)


def _driven(config: Config, listener: Agent, top: float) -> pd.DataFrame:
    road = road_of(config, top)
    own = _donors(config, listener, top)
    # From the range of training the quantiles of another one, from there those of training.
    training = own if top == _TRAINING_TOP else _donors(config, listener, _TRAINING_TOP)
    away = max(config.tops_mps) if max(config.tops_mps) > _TRAINING_TOP else config.top_speed_mps
    swapped = training if top != _TRAINING_TOP else _donors(config, listener, away)
    mean = float(training.mean())
    doings: dict[str, Doing] = {
        "natural": natural,
        "mean": freeze(mean),
        "donor": replay(own),
        "swap": replay(swapped),
        **{f"set {value:g}": freeze(value) for value in config.q_values},
    }
    table = agent_sums(config, road, listener.hearing, listener.network, doings)
    told = {f"set {value:g}": ("set", value) for value in config.q_values} | {
        "mean": ("mean", mean)
    }
    pairs = [told.get(name, (name, np.nan)) for name in table["doing"]]
    table["doing"] = [name for name, _ in pairs]
    table.insert(1, "value", [value for _, value in pairs])
    return table


def _donors(config: Config, listener: Agent, top: float) -> np.ndarray:
    return donors_of(road_of(config, top), listener.hearing, listener.network, config.donors)
