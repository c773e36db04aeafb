"""What do the paper's two policies log when the robot has legs?

What `quadruped_walks` does, with the legged twin: three shapes, two ranges of the gain, pi_switch
and No Quantile, paired by seed. Needs the extra `legged`; its logs are recorded once and shipped.

Paper: Section V-C and V-D.
"""

import pandas as pd

from cpl.conformal import RunningMax
from cpl.experiments.quadruped import legged_collect, legged_predictor
from cpl.experiments.quadruped.lab import RANGES, policy, run_seed
from cpl.experiments.quadruped.legged import LIMITS, lab
from cpl.experiments.quadruped.quadruped_eval import Config, shards
from cpl.experiments.quadruped.quadruped_predictor import trained
from cpl.experiments.quadruped.quadruped_walks import CELL
from cpl.experiments.run.need import Inputs, Need
from cpl.experiments.run.shard import Shard
from cpl.quadruped import COLUMNS, GainLimits, PolicyConfig, RunConfig, SupervisorConfig, run, shape

__all__ = ["CELL", "EXTENT", "LABEL", "PROFILES", "Config", "run_shard", "shards", "upstream"]

LABEL = "simulated-legged"
RTOL = 1e-6
EXTENT = ("repeats",)

PROFILES = {
    "smoke": Config(
        collect="smoke", policies=("paper",), shapes=("triangle",), repeats=1, epochs=2, max_s=2.0
    ),
    "book": Config(collect="book", policies=("paper", "no_quantile"), repeats=1),
    "paper": Config(collect="paper", policies=("paper", "no_quantile"), repeats=3),
}


def upstream(config: Config, shard: Shard) -> list[Need]:
    """Name what a shard needs: the predictor trained on the legged twin's own zig-zags."""
    del shard
    settings = legged_predictor.Config(
        collect=config.collect,
        positive_weight=config.positive_weight,
        epochs=config.epochs,
        seed=config.seed,
    )
    return [Need(experiment="legged_predictor", config=settings, shards=("all",), name="predictor")]


def run_shard(config: Config, shard: Shard, inputs: Inputs) -> pd.DataFrame:
    """Run every policy once.

    Returns:
        The runs' logs, one row a policy step, with the names of `CELL` in front.
    """
    net, data = trained(inputs), legged_collect.PROFILES[config.collect]
    world = lab(data.light, data.richness, data.exposure_s, data.room_seed)
    path, (kp_min, kp_max) = shape(shard.text("shape")), RANGES[shard.text("range")]
    limits = GainLimits(kp_min=kp_min, kp_max=kp_max, q_safe=config.q_safe)
    tracking = PolicyConfig(alpha=config.alpha, rule=RunningMax(c=0.1))
    seed = run_seed(config.seed, "eval", path.name, shard.number("repeat"))
    logs: list[pd.DataFrame] = []
    for supervision in config.supervision:
        supervisor = SupervisorConfig() if supervision == "with" else None
        for name in config.policies:
            chosen = policy(name, limits, tracking, net)
            conduct = RunConfig(max_s=config.max_s, limits=LIMITS)
            rows = pd.DataFrame(run(world, path, chosen, supervisor, seed, conduct))
            logs.append(rows.assign(policy=name, supervision=supervision))
    table = pd.concat(logs, ignore_index=True).assign(**dict(shard.values))
    return table.reindex(columns=[*CELL, *COLUMNS])
