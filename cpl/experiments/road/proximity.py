"""Where does the normalised distance lie, and does it fall with distance?

Paper: Section IV, "We normalize l into the [0,1] interval".
"""

from dataclasses import dataclass

import numpy as np
import pandas as pd

from cpl.experiments.run.shard import Shard
from cpl.highway.proximity import proximity

__all__ = ["LABEL", "PROFILES", "Config", "run_shard", "shards"]

LABEL = "exact"


@dataclass(frozen=True, kw_only=True)
class Config:
    """Distances at which the transformation is evaluated.

    Attributes:
        farthest_m: Largest distance [m]; the road of the paper is a few kilometres long.
        points: Number of distances, from 0 on, evenly spaced.
    """

    farthest_m: float
    points: int

    def __post_init__(self) -> None:
        if self.points < 2:
            msg = f"points must be at least 2, got {self.points!r}"
            raise ValueError(msg)
        if not 0 < self.farthest_m <= 7000:
            msg = f"farthest_m must lie in (0, 7000] (floats underflow), got {self.farthest_m!r}"
            raise ValueError(msg)


PROFILES = {
    "smoke": Config(farthest_m=100.0, points=11),
    "book": Config(farthest_m=500.0, points=501),
    "paper": Config(farthest_m=5000.0, points=2001),
}


def shards(config: Config) -> list[Shard]:
    """Return the one piece there is."""
    del config
    return [Shard("all")]


def run_shard(config: Config, shard: Shard) -> pd.DataFrame:
    """Evaluate the transformation: columns ``l_m`` [m] and ``l_tilde`` [-], one row a distance."""
    del shard
    l_m = np.linspace(0.0, config.farthest_m, config.points)
    return pd.DataFrame({"l_m": l_m, "l_tilde": proximity(l_m)})
