"""What does each fault do, in each phase of a run, with the watchdog on either computer?

Each cell is a short run in lock-step, through the drivers, the watchdog and the datagrams that a
robot would get (`cpl.robot.drill`). What ends processes is measured by `robot_stops`.
"""

from dataclasses import asdict, dataclass

import pandas as pd

from cpl.experiments.run.spec import Experiment, Shard
from cpl.robot.drill import PHASES, PLACEMENTS, WHAT, suffer
from cpl.settings.ranges import Count, Settings

__all__ = ["EXPERIMENT", "PROFILES", "Config"]


@dataclass(frozen=True, kw_only=True)
class Config(Settings):
    """Which cells.

    Attributes:
        faults: How many of the faults, in their order.
        library: What speaks to the emulated robot: `wire` or `sdk`.
    """

    faults: Count
    library: str = "wire"


PROFILES = {
    "smoke": Config(faults=1),
    "book": Config(faults=10),
    "paper": Config(faults=len(WHAT)),
}


def shards(config: Config) -> list[Shard]:
    """Return one shard a fault."""
    return [Shard(name, {"fault": name}) for name in list(WHAT)[: config.faults]]


def run_shard(config: Config, shard: Shard) -> pd.DataFrame:
    """Let a fault happen in each phase with each placement.

    Returns:
        One row a cell, as `cpl.robot.drill.Cell` has it.
    """
    name = shard.text("fault")
    cells = [suffer(name, phase, place, config.library) for phase in PHASES for place in PLACEMENTS]
    return pd.DataFrame([asdict(cell) for cell in cells])


EXPERIMENT = Experiment(
    run=run_shard,
    profiles=PROFILES,
    shards=shards,
    label="simulated-kinematic",
)
