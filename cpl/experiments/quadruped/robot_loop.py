"""How long does the live loop take, and does it follow the paper's rules while it runs?

Paper: Section V-A, V-C and V-D: gain rule, false-positive rule, stop rule, "at 10 Hz". Runs go in
real time: the policy's process, the watchdog and an emulated Go1 on loopback, through the vendor's
library where it is here. The gain rule and the stop rule are worked out again from each logged row,
by formulas written here and not by the functions that drove the robot.
"""

import math
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from cpl.experiments.run.spec import Experiment, Shard, grid
from cpl.logs import read_run
from cpl.quadruped import Predictor
from cpl.robot import Plan, Walked, evaluation, perform, urgent
from cpl.robot.live import Emulated, emulated
from cpl.settings.ranges import Count, Positive, Settings

__all__ = ["EXPERIMENT", "PROFILES", "Config"]

# What was measured depends on the machine and on the moment, so floats are not compared when this
# is verified; that the rules were followed in every step is counted in whole numbers, and is.


@dataclass(frozen=True, kw_only=True)
class Config(Settings):
    """What is run.

    Attributes:
        runs: How many, alternately of the paper's policy in and out of distribution.
        max_s: A run longer than this is given up [s].
        world: `twin` (a camera that really loses track) or `ideal`.
        library: `auto`, `sdk` or `wire`.
        seed: Draws the forecasts and the emulator's noise.
    """

    runs: Count
    max_s: Positive = 20.0
    world: str = "twin"
    library: str = "auto"
    seed: int = 0


PROFILES = {
    "smoke": Config(runs=1, max_s=1.0, world="ideal", library="wire"),
    "book": Config(runs=2, max_s=10.0),
    "paper": Config(runs=6),
}


def run_shard(config: Config, shard: Shard) -> pd.DataFrame:
    """Make one run in real time.

    Returns:
        One row: `run`, `library`; `gain_wrong` and `stop_wrong`, the steps that do not follow the
        rules as stated; and, as floats, what was measured: `steps`, `quiet` (steps in which
        the false-positive rule did not speak), `duration_s`, and 99th percentiles and maxima of
        period error, policy time and the whole step [s], `stream_error_p99_s` of the 500 Hz.
    """
    k = shard.number("run")
    plans = [plan for plan in evaluation(1, config.seed) if plan.policy == "paper"]
    plan = replace(plans[k % len(plans)], max_s=config.max_s)
    stage = Emulated(
        start=plan.course.start,
        seed=plan.seed + k,
        world=config.world,
        library=config.library,
        software_camera=False,
    )
    with tempfile.TemporaryDirectory() as folder:
        there = Path(folder)
        with emulated(stage, there) as session, urgent():
            walked = perform(session.robot, plan, there, predictor=_doubtful(config.seed + k))
        stream = session.base.stats()
        log = read_run(walked.path).table.reset_index(drop=True)
    told = walked.timing.told()
    measured = {
        f"{name}_{which}_s": told[f"{name}_{which}_ms"] / 1e3
        for name in ("period_error", "policy", "loop")
        for which in ("p99", "max")
    }
    measured["stream_error_p99_s"] = stream["period_error_p99_ms"] / 1e3
    row = {"run": k, "library": session.base.library} | _rules(log, plan, walked) | measured
    return pd.DataFrame([row])


EXPERIMENT = Experiment(
    run=run_shard,
    profiles=PROFILES,
    shards=grid("run-{run}", run="runs"),
    label="simulated-kinematic",
    rtol=1e12,
)


def _rules(log: pd.DataFrame, plan: Plan, walked: Walked) -> dict[str, Any]:
    """Work gain and stop out again from the logged numbers."""
    before, wrong, spoke = min(max(1.5, plan.kp_min), plan.kp_max), 0, 0
    for kp, l_hat, q in log[["kp", "l_hat", "q"]].itertuples(index=False):
        false_alarm = l_hat - q < 1 - 0.8 and l_hat + q > 1.1
        slower = l_hat + q >= 0.8 and not false_alarm
        expected = min(max(before * (0.8 if slower else 1.1), plan.kp_min), plan.kp_max)
        wrong += not math.isclose(kp, expected, rel_tol=1e-9)
        spoke += bool(false_alarm)
        before = kp
    last = plan.course.waypoints[-1]
    distance = np.hypot(log["x_m"] - last[0], log["y_m"] - last[1])
    achieved = log["waypoint_index"] >= 0.75 * (len(plan.course) - 1)
    due = (distance < 0.1) & achieved
    ended = log["outcome"].fillna("") == "arrived"
    return {
        "gain_wrong": wrong,
        "stop_wrong": int((due != ended).sum()),
        "steps": float(walked.rows),
        "quiet": float(walked.rows - spoke),
        "duration_s": walked.duration_s,
    }


def _doubtful(seed: int) -> Predictor:
    """Return a network of the paper's size whose forecasts vary: every branch of the rules is met.

    It is not trained; how good it is does not matter for how long it takes.
    """
    from cpl.rng import stream

    rng = stream(seed, "robot", "doubtful")
    return Predictor(
        mean=np.zeros(47),
        std=np.ones(47),
        w1=rng.normal(0, 0.4, (128, 47)),
        b1=rng.normal(0, 0.5, 128),
        w2=rng.normal(0, 0.25, 128),
        b2=np.zeros(()),
    )
