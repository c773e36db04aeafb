"""Can an agent learn to use the quantile where the quantile varies?

Trainings beyond the paper's: speed ranges and densities are drawn anew for each episode, so that
the forecast is good in some and bad in others. `wide` drives by itself; `gate` chooses between
pi_safe and pi_speed as the switch does, and a crash costs it five times as much. Each has a twin
that sees everything but the quantile.
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

    recipes: tuple[str, ...] = ("wide", "wide_nq", "gate", "gate_nq")


PROFILES = {
    "smoke": Config(pairs=1, models="smoke", steps=1_500),
    "book": Config(pairs=1, recipes=("gate",), steps=30_000),
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
