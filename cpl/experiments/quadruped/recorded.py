"""What do a forecaster and a tracker make of the drift of real machines?

The questions of the chapter on recorded logs, asked of recordings whose error is known: do misses
come in bursts, does the carried tracker hold its rate, what does a frozen margin cover, which
windows are promised nothing? A forecaster is trained on the first half of one recording and meets
the second half of its own, and of every other one. No recording is shipped: `make recordings`
fetches those of the profile `paper`, and the smaller profiles take the camera's that is shipped.

Paper: Section V-A ("SLAM errors depend on path and speed"), of other machines than the paper's.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated

import pandas as pd

from cpl.experiments.run.spec import Experiment, Shard, grid
from cpl.forecast.drift import answers, halves, meet
from cpl.logs import Run, read_run
from cpl.logs.drift import of_feet, with_truth
from cpl.logs.fetch import recorded_file
from cpl.settings.ranges import Choice, Count, Positive, Probability, Settings
from cpl.store import data_path

__all__ = ["EXPERIMENT", "MACHINES", "PROFILES", "Config", "series"]

MACHINES = {
    "kitti-orb": "car, KITTI 00, ORB-SLAM against GPS and inertial truth",
    "kitti-sptam": "car, KITTI 00, S-PTAM against GPS and inertial truth",
    "euroc-v102": "flying, EuRoC V1 02, visual-inertial odometry against a motion capture",
    "fr2-desk": "hand-held, TUM fr2 desk, ORB-SLAM against a motion capture",
    "turtlebot": "wheels, TurtleBot, odometry against AMCL, which is an estimate itself",
    "staircase": "legs, a quadruped on stairs, its standing feet against each other",
    "t265": "camera at rest, T265 against a motion capture; shipped, 1.1 s",
}
"""What each recording is of, and what its error is measured against."""


@dataclass(frozen=True, kw_only=True)
class Config(Settings):
    """Which recordings, and how they are asked.

    Attributes:
        machines: Keys of `MACHINES`.
        horizon_s: Over which the drift is taken [s].
        step_s: From one forecast to the next [s]; the paper's 10 Hz.
        alpha: Miscoverage aimed at [-]; the paper's robot has 0.2.
        c: Step of the tracker as a share of the largest score [-]; the paper's 0.1.
        W: Window of the coverage [steps]; the paper's 4 s are 40.
        resamples: Resamples of blocks behind an interval.
        seed: Draws them.
    """

    machines: tuple[Annotated[str, Choice(tuple(MACHINES))], ...]
    horizon_s: Positive = 1.0
    step_s: Positive = 0.1
    alpha: Probability = 0.2
    c: Positive = 0.1
    W: Count = 40
    resamples: Count = 1000
    seed: int = 0


_SHIPPED = Config(machines=("t265",), horizon_s=0.05, step_s=0.005, W=20, resamples=20)
PROFILES = {
    "smoke": _SHIPPED,
    "book": _SHIPPED,
    "paper": Config(machines=tuple(name for name in MACHINES if name != "t265")),
}


def run_shard(config: Config, shard: Shard) -> pd.DataFrame:
    """Train on one recording's first half, and meet the second half of another.

    Returns:
        As `cpl.forecast.drift.answers`, with `trained` and `met` in front.

    Raises:
        cpl.logs.fetch.RecordingsError: A recording was not fetched.
    """
    trained, met = shard.text("trained"), shard.text("met")
    span = {"horizon_s": config.horizon_s, "step_s": config.step_s}
    found = meet(
        halves(series(trained, **span), horizon_s=config.horizon_s)[0],
        halves(series(met, **span), horizon_s=config.horizon_s)[1],
        alpha=config.alpha,
        c=config.c,
        delay=round(config.horizon_s / config.step_s),
        W=config.W,
    )
    table = answers(found, alpha=config.alpha, seed=config.seed, resamples=config.resamples)
    table.insert(0, "trained", trained)
    table.insert(1, "met", met)
    return table


EXPERIMENT = Experiment(
    run=run_shard,
    profiles=PROFILES,
    shards=grid("{trained}-{met}", trained="machines", met="machines"),
    label="measured",
    rtol=1e-6,
)


@lru_cache(maxsize=16)
def series(machine: str, *, horizon_s: float, step_s: float) -> pd.DataFrame:
    """Return a machine's motion and drift, step by step, as `cpl.logs.drift` has it.

    Args:
        machine: A key of `MACHINES`.
        horizon_s: Over which the drift is taken [s].
        step_s: From step to step [s].
    """
    if machine == "staircase":
        contacts = pd.read_csv(recorded_file("contacts.csv"))
        return of_feet(contacts, horizon_s=horizon_s, step_s=step_s)
    estimate, truth, same_body = _pair(machine)
    return with_truth(estimate, truth, horizon_s=horizon_s, step_s=step_s, same_body=same_body)


def _pair(machine: str) -> tuple[Run, Run, bool]:
    """Return what a machine believed, what was, and whether both tell of the same body."""
    real = "real-third-party"
    if machine.startswith("kitti"):
        name = {"kitti-orb": "ORB", "kitti-sptam": "SPTAM"}[machine]
        times = recorded_file("KITTI_00_gt_times.txt")
        estimate, truth = (
            read_run(recorded_file(f"KITTI_00_{each}.txt"), provenance=real, times=times)
            for each in (name, "gt")
        )
        return estimate, truth, True
    if machine == "euroc-v102":
        estimate = read_run(recorded_file("V102.txt"), provenance=real)
        return estimate, read_run(recorded_file("V102_groundtruth.csv"), provenance=real), False
    if machine == "fr2-desk":
        estimate = read_run(recorded_file("fr2_desk_ORB.txt"), provenance=real)
        return estimate, read_run(recorded_file("fr2_desk_groundtruth.txt"), provenance=real), True
    shipped = machine == "t265"
    path = data_path("logs", "real-t265", "test.bag") if shipped else recorded_file(
        "nav2_turtlebot.mcap")  # fmt: skip
    topics = ("/camera/odom/sample", "/vicon/t265_tracker/t265_tracker") if shipped else (
        "/odom", "/amcl_pose")  # fmt: skip
    estimate, truth = (read_run(path, provenance=real, topic=topic) for topic in topics)
    return estimate, truth, not shipped
