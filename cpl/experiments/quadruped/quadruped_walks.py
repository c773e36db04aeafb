"""What do the paper's two policies log on three shapes, in two ranges of the gain?

The runs of `quadruped_eval`, row by row: same seeds, same noise, same predictor. `cpl record`
writes them as MCAP files, one a run, which is what the book ships and analyses.

Paper: Section V-C and V-D, there with three repeats.
"""

import pandas as pd

from cpl.experiments.quadruped.quadruped_eval import Config, shards, upstream, walks
from cpl.experiments.quadruped.quadruped_predictor import trained
from cpl.experiments.run.need import Inputs
from cpl.experiments.run.shard import Shard
from cpl.quadruped import COLUMNS

__all__ = ["CELL", "LABEL", "PROFILES", "Config", "run_shard", "shards", "upstream"]

LABEL = "simulated-kinematic"
RTOL = 1e-6
CELL = ("shape", "range", "policy", "supervision", "repeat")

PROFILES = {
    "smoke": Config(
        collect="smoke", policies=("paper",), shapes=("triangle",), repeats=1, epochs=2, max_s=2.0
    ),
    "book": Config(collect="book", policies=("paper", "no_quantile"), repeats=3),
    "paper": Config(collect="paper", policies=("paper", "no_quantile"), repeats=20),
}


def run_shard(config: Config, shard: Shard, inputs: Inputs) -> pd.DataFrame:
    """Run every policy once.

    Returns:
        The runs' logs, one row a policy step, with the names of `CELL` in front.
    """
    logs = [
        pd.DataFrame(walk.rows).assign(policy=walk.policy, supervision=walk.supervision)
        for walk in walks(config, shard, trained(inputs))
    ]
    table = pd.concat(logs, ignore_index=True).assign(**dict(shard.values))
    return table.reindex(columns=[*CELL, *COLUMNS])
