"""Does what the agent is shown matter more if one thing about its training was changed?

The interventions of `why_do` on the agents of `agents_why`.
"""

from dataclasses import dataclass

import pandas as pd

from cpl.experiments.listen import why_do
from cpl.experiments.run.need import Inputs, Need
from cpl.experiments.run.shard import Shard

__all__ = ["EXTENT", "LABEL", "PROFILES", "RTOL", "Config", "run_shard", "shards", "upstream"]

LABEL = "simulated"
EXTENT = ("pairs", "first_pair")
RTOL = 1e-5  # sums of speeds are stored in single precision


@dataclass(frozen=True, kw_only=True)
class Config(why_do.Config):
    """The interventions; see `cpl.experiments.listen.why_do.Config`."""

    agents: tuple[str, ...] = ("louder", "farther", "longer", "blurred")
    tops_mps: tuple[float, ...] = (30.0, 40.0)
    q_values: tuple[float, ...] = (0.0, 0.4, 0.8, 1.2)


PROFILES = {
    "smoke": Config(
        pairs=1, models="smoke", episodes=4, validation_episodes=2, blocks=2, vehicles_count=8,
        agents=("louder", "longer"), tops_mps=(40.0,), q_values=(0.0, 1.0), donors=2,
    ),
    "book": Config(
        pairs=1, episodes=40, validation_episodes=2, blocks=20, agents=("louder",),
        tops_mps=(40.0,), q_values=(0.0, 1.2), donors=10,
    ),
    "paper": Config(pairs=3, episodes=125, validation_episodes=2, blocks=25),
}  # fmt: skip


def shards(config: Config) -> list[Shard]:
    """One pair a shard."""
    return why_do.shards(config)


def upstream(config: Config, shard: Shard) -> list[Need]:
    """Return what a shard is computed from: policies, forecasters and agents of a pair."""
    return why_do.upstream(config, shard)


def run_shard(config: Config, shard: Shard, inputs: Inputs) -> pd.DataFrame:
    """Drive every agent of a pair under every intervention; see `cpl.experiments.listen.why_do`."""
    return why_do.run_shard(config, shard, inputs)
