"""Can the robot move without a fresh order, whatever becomes of datagrams and of one process?

All choices of an adversary are followed in a small model whose decisions are those of the functions
that run (`cpl.robot.search`).
"""

from dataclasses import asdict, dataclass

import pandas as pd

from cpl.experiments.run.spec import Experiment, Shard
from cpl.robot.search import search
from cpl.settings.ranges import Count, Settings

__all__ = ["EXPERIMENT", "PROFILES", "Config"]


@dataclass(frozen=True, kw_only=True)
class Config(Settings):
    """How far is looked.

    Attributes:
        depth: With one fault [turns of 0.05 s].
        depth_none: Without any fault of a process [turns].
    """

    depth: Count
    depth_none: Count


PROFILES = {
    "smoke": Config(depth=3, depth_none=4),
    "book": Config(depth=8, depth_none=10),
    "paper": Config(depth=16, depth_none=24),
}


def shards(config: Config) -> list[Shard]:
    """Return one search without a fault of a process, and one with a fault."""
    return [
        Shard("faults-0", {"faults": 0, "depth": config.depth_none}),
        Shard("faults-1", {"faults": 1, "depth": config.depth}),
    ]


def run_shard(config: Config, shard: Shard) -> pd.DataFrame:
    """Search.

    Returns:
        One row, as `cpl.robot.search.Found` has it; `depth`, `oldest` and `settled` in turns of
        0.05 s.
    """
    del config
    return pd.DataFrame([asdict(search(shard.number("depth"), shard.number("faults")))])


EXPERIMENT = Experiment(
    run=run_shard,
    profiles=PROFILES,
    shards=shards,
    label="exact",
)
