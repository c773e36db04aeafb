"""How well does the paper's network foresee the SLAM errors of the legged twin?

What `quadruped_predictor` does, on the zig-zags of `legged_collect`.
"""

import pandas as pd

from cpl.experiments.quadruped import legged_collect
from cpl.experiments.quadruped.quadruped_predictor import PROFILES, Config, fitted, shards
from cpl.experiments.run.need import Inputs, Need
from cpl.experiments.run.shard import Shard

__all__ = ["EXTENT", "LABEL", "PROFILES", "Config", "run_shard", "shards", "upstream"]

LABEL = "simulated-legged"
RTOL = 1e-6
EXTENT = ("folds",)


def upstream(config: Config, shard: Shard) -> list[Need]:
    """Name what a shard needs: all collected trajectories."""
    del shard
    settings = legged_collect.PROFILES[config.collect]
    names = tuple(each.name for each in legged_collect.shards(settings))
    return [Need(experiment="legged_collect", config=settings, shards=names, name="log")]


def run_shard(config: Config, shard: Shard, inputs: Inputs) -> pd.DataFrame:
    """Train once; the row is that of `quadruped_predictor`."""
    data = legged_collect.PROFILES[config.collect]
    return fitted(config, shard, inputs, seed=data.seed, keypoints=data.keypoints)
