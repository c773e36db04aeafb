"""What does the robot's log look like when it walks zig-zags at a constant gain?

The data the predictor is trained on. Paper: Section V-B, 43 trajectories at kp = 1.5; the twin's
SLAM errors are its visual odometry's own losses of track.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import pandas as pd

from cpl.experiments.quadruped.lab import KINEMATIC, Hall, Twin, run_seed, training_path
from cpl.experiments.run.spec import Experiment, Shard, grid
from cpl.quadruped import GainLimits, Policy, PolicyConfig, RunConfig, constant_gain, run
from cpl.settings.ranges import Count, Positive

__all__ = ["EXPERIMENT", "PROFILES", "Config", "collecting"]


@dataclass(frozen=True, kw_only=True)
class Config(Hall):
    """What is walked; where, says `Hall`.

    Attributes:
        trajectories: Training paths; the paper's 43.
        keypoints: Keypoints a path.
        kp: The constant gain [1/s]; the paper's 1.5.
        max_s: A run longer than this is given up [s].
        seed: Draws paths and noise.
    """

    trajectories: Count
    keypoints: Count = 4
    kp: Positive = 1.5
    max_s: Positive = 60.0
    seed: int = 0


PROFILES = {
    "smoke": Config(trajectories=2, keypoints=1, kp=4.0, max_s=4.0),
    "book": Config(trajectories=43),
    "paper": Config(trajectories=43),
}


def collecting(twin: Twin, profiles: Mapping[str, Config]) -> Experiment:
    """Return the experiment that walks a twin along the zig-zags."""

    def run_shard(config: Config, shard: Shard) -> pd.DataFrame:
        """Walk one zig-zag.

        Returns:
            The run's log, one row a policy step, with `trajectory` in front.
        """
        trajectory = shard.number("trajectory")
        rows = run(
            twin.world(config),
            training_path(config.seed, trajectory, config.keypoints),
            Policy(constant_gain, GainLimits(kp_min=config.kp, kp_max=config.kp), PolicyConfig()),
            None,
            run_seed(config.seed, "collect", trajectory),
            RunConfig(max_s=config.max_s, limits=twin.limits),
        )
        return pd.DataFrame([{"trajectory": trajectory} | row for row in rows])

    return Experiment(
        run=run_shard,
        profiles=profiles,
        shards=grid("zigzag-{trajectory}", trajectory="trajectories"),
        label=twin.label,
        extent=("trajectories",),
        rtol=1e-6,
    )


EXPERIMENT = collecting(KINEMATIC, PROFILES)
