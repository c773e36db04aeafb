"""How long does a robot walk on when a process is killed or hangs, or a link goes away?

Real processes on one computer, hurt at drawn moments: a policy that orders 0.3 m/s, its watchdog,
the watchdog's second, and an emulated robot's endpoint that notes what reaches it
(`cpl.robot.trials`).
"""

from dataclasses import asdict, dataclass

import pandas as pd

from cpl.experiments.run.spec import Experiment, Shard, parts
from cpl.robot.trials import DEEDS, PHASES, PLACEMENTS, trial
from cpl.settings.ranges import Count, Settings

__all__ = ["EXPERIMENT", "PROFILES", "Config"]

# What was measured depends on the machine and on the moment, so floats are not compared when this
# is verified; that no process was left behind is counted in whole numbers, and is.
PART = 10  # trials in a shard


@dataclass(frozen=True, kw_only=True)
class Config(Settings):
    """How often what is done to whom.

    Attributes:
        walking: Trials of each deed and placement while the robot walks.
        other: The same while it stands, and while it stops.
        seed: Draws the moments.
    """

    walking: Count
    other: Count
    seed: int = 0


PROFILES = {
    "smoke": Config(walking=1, other=1),
    "book": Config(walking=5, other=1),
    "paper": Config(walking=100, other=3),
}


def shards(config: Config) -> list[Shard]:
    """Return the trials in parts of ten: of a deed, in a phase, with a placement."""
    return [
        Shard(
            f"{deed}-{phase}-{placement}-{part}",
            {"deed": deed, "phase": phase, "placement": placement, "part": part, "trials": size},
        )
        for deed in DEEDS
        for phase in PHASES
        for placement in PLACEMENTS
        for part, size in parts(config.walking if phase == "walking" else config.other, PART)
    ]


def run_shard(config: Config, shard: Shard) -> pd.DataFrame:
    """Make the trials of a part.

    Returns:
        One row a trial, as `cpl.robot.trials.Trial` has it; `zero_s`, `stand_s` [s],
        `fastest_mps`, and `left`, the processes that did not go away.
    """
    first = PART * shard.number("part")
    rows = []
    for k in range(first, first + shard.number("trials")):
        seed = config.seed * 1_000_003 + k
        made = trial(shard.text("deed"), shard.text("phase"), shard.text("placement"), seed)
        rows.append({"trial": k} | asdict(made))
    return pd.DataFrame(rows)


EXPERIMENT = Experiment(
    run=run_shard,
    profiles=PROFILES,
    shards=shards,
    label="simulated-kinematic",
    rtol=1e12,
)
