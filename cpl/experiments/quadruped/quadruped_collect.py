"""What does the robot's log look like when it walks zig-zags at a constant gain?

The data the predictor is trained on. Paper: Section V-B, 43 trajectories at kp = 1.5; the twin's
SLAM errors are its visual odometry's own losses of track.
"""

from dataclasses import dataclass

import pandas as pd

from cpl.experiments.quadruped.lab import EXPOSURE_S, LIGHT, RICHNESS, lab, run_seed, training_path
from cpl.experiments.run.shard import Shard
from cpl.quadruped import GainLimits, Policy, PolicyConfig, RunConfig, constant_gain, run

__all__ = ["EXTENT", "LABEL", "PROFILES", "Config", "run_shard", "shards"]

LABEL = "simulated-kinematic"
RTOL = 1e-6
EXTENT = ("trajectories",)


@dataclass(frozen=True, kw_only=True)
class Config:
    """What is walked, and where.

    Attributes:
        trajectories: Training paths; the paper's 43.
        keypoints: Keypoints a path.
        kp: The constant gain [1/s]; the paper's 1.5.
        light: Light level of the hall, 1 = bright [-].
        richness: How much there is to be seen, 0 to 1 [-].
        exposure_s: Exposure time [s].
        max_s: A run longer than this is given up [s].
        room_seed: Paints the hall.
        seed: Draws paths and noise.
    """

    trajectories: int
    keypoints: int = 4
    kp: float = 1.5
    light: float = LIGHT
    richness: float = RICHNESS
    exposure_s: float = EXPOSURE_S
    max_s: float = 60.0
    room_seed: int = 0
    seed: int = 0

    def __post_init__(self) -> None:
        for name in ("trajectories", "keypoints", "kp", "max_s"):
            if not getattr(self, name) > 0:
                raise ValueError(f"{name} must be above 0, not {getattr(self, name)}")


PROFILES = {
    "smoke": Config(trajectories=2, keypoints=1, kp=4.0, max_s=4.0),
    "book": Config(trajectories=43),
    "paper": Config(trajectories=43),
}


def shards(config: Config) -> list[Shard]:
    """Return one shard a trajectory."""
    return [Shard(f"zigzag-{k}", {"trajectory": k}) for k in range(config.trajectories)]


def run_shard(config: Config, shard: Shard) -> pd.DataFrame:
    """Walk one zig-zag.

    Returns:
        The run's log, one row a policy step, with `trajectory` in front.
    """
    trajectory = shard.number("trajectory")
    rows = run(
        lab(config.light, config.richness, config.exposure_s, config.room_seed),
        training_path(config.seed, trajectory, config.keypoints),
        Policy(constant_gain, GainLimits(kp_min=config.kp, kp_max=config.kp), PolicyConfig()),
        None,
        run_seed(config.seed, "collect", trajectory),
        RunConfig(max_s=config.max_s),
    )
    return pd.DataFrame([{"trajectory": trajectory} | row for row in rows])
