"""What do the paper's two policies log on three shapes, in two ranges of the gain?

The runs of `quadruped_eval`, row by row: same seeds, same noise, same predictor. `cpl record`
writes them as MCAP files, one a run, which is what the book ships and analyses.

Paper: Section V-C and V-D, there with three repeats.
"""

from collections.abc import Callable, Mapping

import pandas as pd

from cpl.experiments.quadruped.lab import KINEMATIC, Hall, Twin
from cpl.experiments.quadruped.quadruped_collect import PROFILES as COLLECTED
from cpl.experiments.quadruped.quadruped_eval import EXPERIMENT as EVALUATION
from cpl.experiments.quadruped.quadruped_eval import Config, walks
from cpl.experiments.quadruped.quadruped_predictor import need_predictor, trained
from cpl.experiments.run.spec import Experiment, Inputs, Need, Shard
from cpl.quadruped import COLUMNS

__all__ = ["CELL", "EXPERIMENT", "PROFILES", "Config", "walking"]

CELL = ("shape", "range", "policy", "supervision", "repeat")

PROFILES = {
    "smoke": Config(
        collect="smoke", policies=("paper",), shapes=("triangle",), repeats=1, epochs=2, max_s=2.0
    ),
    "book": Config(collect="book", policies=("paper", "no_quantile"), repeats=3),
    "paper": Config(collect="paper", policies=("paper", "no_quantile"), repeats=20),
}


def walking(
    twin: Twin,
    collected: Mapping[str, Hall],
    needs: Callable[[Config], list[Need]],
    profiles: Mapping[str, Config],
    *,
    extent: tuple[str, ...] = (),
) -> Experiment:
    """Return the experiment that logs a twin's walks.

    Args:
        twin: Who walks.
        collected: Settings of the collection, by profile: its hall is walked in.
        needs: The network that was trained on it.
        profiles: Settings of the walks.
        extent: See `Experiment`.
    """

    def run_shard(config: Config, shard: Shard, inputs: Inputs) -> pd.DataFrame:
        """Run every policy once.

        Returns:
            The runs' logs, one row a policy step, with the names of `CELL` in front.
        """
        world = twin.world(collected[config.collect])
        logs = [
            pd.DataFrame(walk.rows).assign(policy=walk.policy, supervision=walk.supervision)
            for walk in walks(world, twin.limits, config, shard, trained(inputs))
        ]
        table = pd.concat(logs, ignore_index=True).assign(**dict(shard.values))
        return table.reindex(columns=[*CELL, *COLUMNS])

    return Experiment(
        run=run_shard,
        profiles=profiles,
        shards=EVALUATION.shards,
        needs=lambda config, _: needs(config),
        label=twin.label,
        extent=extent,
        rtol=1e-6,
    )


EXPERIMENT = walking(KINEMATIC, COLLECTED, need_predictor, PROFILES)
