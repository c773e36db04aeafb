"""What does the legged twin's log look like when it walks zig-zags at a constant gain?

What `quadruped_collect` does, with a Go1 that walks in MuJoCo; the training data of its predictor.
The paths are the first of the kinematic twin's: MuJoCo's pictures take their time. Needs the extra
`legged`.
"""

from dataclasses import dataclass

from cpl.experiments.quadruped import quadruped_collect
from cpl.experiments.quadruped.legged import LEGGED, RICHNESS

__all__ = ["EXPERIMENT", "PROFILES", "Config"]


@dataclass(frozen=True, kw_only=True)
class Config(quadruped_collect.Config):
    """What is walked, and where; see `quadruped_collect`."""

    richness: float = RICHNESS


PROFILES = {
    "smoke": Config(trajectories=2, keypoints=1, kp=4.0, max_s=4.0, richness=0.25),
    "book": Config(trajectories=10),
    "paper": Config(trajectories=10),
}

EXPERIMENT = quadruped_collect.collecting(LEGGED, PROFILES)
