"""Does an agent listen to the quantile if one thing about its training is changed?

Four rivals of the paper's explanation (Section IV-F: at training time the quantile is small), each
a training of pi_RL that differs in one thing: the quantile is an input too weak to be noticed; the
agent is too short-sighted for what the quantile announces; one number at one time says too little;
the quantile never varies. The last is the paper's own, on the paper's own road: only the forecast
is blurred, in some episodes more and in some less.
"""

from dataclasses import dataclass

import pandas as pd

from cpl.experiments.run.need import Inputs, Need
from cpl.experiments.run.shard import Shard
from cpl.experiments.trained.recipes import Training, pieces, teach, upstream_of

__all__ = ["EXTENT", "LABEL", "PROFILES", "RTOL", "Config", "run_shard", "shards", "upstream"]

LABEL = "simulated"
EXTENT = ("pairs", "recipes")
RTOL = 1e-6  # of the learning curve's means; models agree bit for bit


@dataclass(frozen=True, kw_only=True)
class Config(Training):
    """The trainings; see `cpl.experiments.trained.recipes.Training`."""

    recipes: tuple[str, ...] = ("louder", "farther", "longer", "blurred")


PROFILES = {
    "smoke": Config(pairs=1, models="smoke", steps=1_500),
    "book": Config(pairs=1, recipes=("louder",), steps=30_000),
    "paper": Config(pairs=3),
}


def shards(config: Config) -> list[Shard]:
    """One training a shard."""
    return pieces(config)


def upstream(config: Config, shard: Shard) -> list[Need]:
    """Return what a shard is computed from: a pair of policies and its forecaster."""
    return upstream_of(config, shard.number("pair"))


def run_shard(config: Config, shard: Shard, inputs: Inputs) -> pd.DataFrame:
    """Train one agent; see `cpl.experiments.trained.recipes.teach`."""
    return teach(config, shard.text("recipe"), shard.number("pair"), inputs)
