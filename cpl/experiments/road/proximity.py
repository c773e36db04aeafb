"""Where does the normalised distance lie, and does it fall with distance?

Paper: Section IV, "We normalize l into the [0,1] interval".
"""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
import pandas as pd

from cpl.experiments.run.spec import Experiment, Shard, whole
from cpl.highway.proximity import proximity
from cpl.settings.ranges import Settings, interval

__all__ = ["EXPERIMENT", "PROFILES", "Config"]


@dataclass(frozen=True, kw_only=True)
class Config(Settings):
    """Distances at which the transformation is evaluated.

    Attributes:
        farthest_m: Largest distance [m]; the road of the paper is a few kilometres long.
        points: Number of distances, from 0 on, evenly spaced.
    """

    farthest_m: Annotated[float, interval("(0, 7000]")]
    points: Annotated[int, interval("[2, inf)")]


PROFILES = {
    "smoke": Config(farthest_m=100.0, points=11),
    "book": Config(farthest_m=500.0, points=501),
    "paper": Config(farthest_m=5000.0, points=2001),
}


def run_shard(config: Config, shard: Shard) -> pd.DataFrame:
    """Evaluate the transformation: columns ``l_m`` [m] and ``l_tilde`` [-], one row a distance."""
    del shard
    l_m = np.linspace(0.0, config.farthest_m, config.points)
    return pd.DataFrame({"l_m": l_m, "l_tilde": proximity(l_m)})


EXPERIMENT = Experiment(
    run=run_shard,
    profiles=PROFILES,
    shards=whole,
    label="exact",
)
