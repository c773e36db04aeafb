"""One run from standing to standing, with its log: what is shared by rehearsals and real runs."""

from __future__ import annotations

import errno
import os
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import closing, contextmanager
from dataclasses import dataclass, field, replace
from itertools import count
from pathlib import Path
from typing import Any

from cpl.conformal import RunningMax
from cpl.logs import RunInfo, RunWriter
from cpl.quadruped import (
    GAIN_RULES,
    HORIZON,
    GainLimits,
    Policy,
    PolicyConfig,
    RunConfig,
    shape,
    zigzag,
)
from cpl.quadruped import Path as Course
from cpl.quadruped.policy import Forecast
from cpl.rng import stream
from cpl.robot.clock import Timing
from cpl.robot.guard import GuardConfig
from cpl.robot.loop import PERIOD_S, Robot, drive, halt, prepare

__all__ = [
    "KP",
    "POLICIES",
    "RANGES",
    "Plan",
    "Walked",
    "collection",
    "evaluation",
    "log_path",
    "numbered",
    "perform",
]

KP = 1.5  # [1/s] Section V-B
KEYPOINTS = 4
TRAJECTORIES, REPEATS = 43, 3  # Section V-B, V-D
RANGES = {"in": (1.2, 1.8), "out": (0.8, 4.0)}  # [1/s] Section V-C
POLICIES = ("paper", "no_quantile", "corrected", "constant")
ALPHA, STEP_SHARE = 0.2, 0.1
SYNC_EVERY_S, NEVER_S = 1.0, 1e9

Watch = Callable[[dict[str, Any]], None]


@dataclass(frozen=True, kw_only=True)
class Plan:
    """A run that is to be made.

    Args:
        name: Of its log, without the ending.
        course: The path.
        shape: What tables call the path.
        range: What tables call the range of the gain.
        policy: Name of a gain rule.
        repeat: Number of the repeat, or of the training path.
        kp_min: Least gain [1/s].
        kp_max: Largest gain [1/s].
        seed: Draws a twin's noise; the same for policies that are compared.
        max_s: A longer run is given up [s].
    """

    name: str
    course: Course
    shape: str
    range: str
    policy: str
    repeat: int
    kp_min: float
    kp_max: float
    seed: int = 0
    max_s: float = 60.0

    def __post_init__(self) -> None:
        if self.policy not in GAIN_RULES:
            known = ", ".join(GAIN_RULES)
            raise ValueError(f"policy must be one of {known}, not {self.policy!r}")


@dataclass(frozen=True, kw_only=True)
class Walked:
    """A run that was made.

    Attributes:
        plan: What was to be done.
        path: Its log.
        outcome: Why it ended.
        rows: Steps.
        duration_s: By the robot's clock [s].
        slam_errors: Steps with a SLAM error.
        reasons: Steps in which the guard changed the command, by reason.
        timing: How regular it was.
    """

    plan: Plan
    path: Path
    outcome: str
    rows: int
    duration_s: float
    slam_errors: int
    reasons: dict[str, int]
    timing: Timing = field(repr=False)


def collection(trajectories: int = TRAJECTORIES, seed: int = 0) -> list[Plan]:
    """Return the training runs: zig-zags at a constant gain.

    Paper: Section V-B.

    Args:
        trajectories: How many.
        seed: Draws the paths.

    >>> runs = collection(2)
    >>> runs[1].name, runs[1].policy, runs[1].kp_max
    ('collect-01', 'constant', 1.5)
    """
    if trajectories < 1:
        raise ValueError(f"trajectories must be at least 1, not {trajectories}")
    return [
        Plan(
            name=f"collect-{k:02d}",
            course=zigzag(stream(seed, "quadruped", "zigzag", k), keypoints=KEYPOINTS),
            shape="zigzag",
            range="train",
            policy="constant",
            repeat=k,
            kp_min=KP,
            kp_max=KP,
            seed=_seed(seed, "collect", k),
        )
        for k in range(trajectories)
    ]


def evaluation(repeats: int = REPEATS, seed: int = 0) -> list[Plan]:
    """Return the evaluation runs: three shapes, two ranges, two policies.

    Paper: Section V-C and V-D.

    Args:
        repeats: Of each.
        seed: Draws a twin's noise.

    >>> len(evaluation(3))
    36
    """
    if repeats < 1:
        raise ValueError(f"repeats must be at least 1, not {repeats}")
    return [
        Plan(
            name=f"{name}-{gains}-{policy}-{repeat}",
            course=shape(name),
            shape=name,
            range=gains,
            policy=policy,
            repeat=repeat,
            kp_min=RANGES[gains][0],
            kp_max=RANGES[gains][1],
            seed=_seed(seed, "eval", name, repeat),
        )
        for repeat in range(repeats)
        for name in ("triangle", "rectangle", "hexagon")
        for gains in RANGES
        for policy in ("paper", "no_quantile")
    ]


def perform(
    robot: Robot,
    plan: Plan,
    folder: Path,
    *,
    predictor: Forecast | None = None,
    config: GuardConfig | None = None,
    about: Mapping[str, Any] | None = None,
    watch: Watch | None = None,
) -> Walked:
    """Make one run: ready the robot, walk, let it stand, and keep the log.

    Whatever ends the run, the robot is asked for zero velocity and then to stand, and every row
    that was logged is in the file.

    Args:
        robot: Standing on the path's first waypoint.
        plan: What is to be done.
        folder: Where the log goes.
        predictor: The trained network; not needed by the constant policy.
        config: The guard's.
        about: More for the log's configuration.
        watch: Is shown each row.

    Raises:
        RobotError: Robot or camera are not ready.
        FileExistsError: There is a log of that name: it is not touched, and nothing moves.
        ValueError: A policy that needs a predictor, without one.
    """
    if predictor is None and plan.policy != "constant":
        raise ValueError(f"predictor must be given for policy {plan.policy!r}, not None")
    config, timing = config or GuardConfig(), Timing(period_s=PERIOD_S)
    path = log_path(folder, plan)  # before anything moves
    prepare(robot, plan.course)
    info = _info(robot, plan, config, about or {})
    policy = _policy(plan, predictor)
    run = RunConfig(max_s=plan.max_s)
    row: dict[str, Any] = {}
    reasons: dict[str, int] = {}
    rows = errors = 0
    ours = False  # whether the file is this run's
    try:
        with (
            RunWriter(path, info, sync_every_s=NEVER_S) as log,
            _flushed(path),
            closing(drive(robot, plan.course, policy, config, run, timing)) as steps,
        ):
            ours = True
            for row in steps:
                log.write(row)
                rows, errors = rows + 1, errors + (row["slam_error"] != 0)
                if row["supervisor"]:
                    reasons[row["supervisor"]] = reasons.get(row["supervisor"], 0) + 1
                if watch is not None:
                    watch(row)
    finally:
        if ours and rows == 0:
            path.unlink()  # it holds nothing, and would stand in the way of the next try
        halt(robot)
    return Walked(
        plan=plan,
        path=path,
        outcome=row["outcome"],
        rows=rows,
        duration_s=row["t_s"],
        slam_errors=errors,
        reasons=reasons,
        timing=timing,
    )


def log_path(folder: Path, plan: Plan) -> Path:
    """Return where the log of a run goes.

    Raises:
        FileExistsError: There is one of that name; a free one is offered.
    """
    path = folder / f"{plan.name}.mcap"
    if not path.exists():
        return path
    said = f"there is a log already, and it stays; free is {numbered(folder, plan).name}"
    raise FileExistsError(errno.EEXIST, said, str(path))


def numbered(folder: Path, plan: Plan) -> Plan:
    """Return the plan under the first name that is free in a folder: `NAME`, `NAME.2`, `NAME.3`.

    Args:
        folder: Where logs are.
        plan: A run.
    """
    names = (plan.name if k == 1 else f"{plan.name}.{k}" for k in count(1))
    free = next(name for name in names if not (folder / f"{name}.mcap").exists())
    return replace(plan, name=free)


@contextmanager
def _flushed(path: Path) -> Iterator[None]:
    """Flush a file to the disk each second, beside the loop: a slow disk must not make it late."""
    over = threading.Event()

    def flush() -> None:
        with path.open("rb") as file:
            while not over.wait(SYNC_EVERY_S):
                os.fsync(file.fileno())

    thread = threading.Thread(target=flush, daemon=True)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()


def _policy(plan: Plan, predictor: Forecast | None) -> Policy:
    limits = GainLimits(kp_min=plan.kp_min, kp_max=plan.kp_max)
    config = PolicyConfig(alpha=ALPHA, rule=RunningMax(c=STEP_SHARE))
    return Policy(GAIN_RULES[plan.policy], limits, config, forecast=predictor)


def _info(robot: Robot, plan: Plan, config: GuardConfig, about: Mapping[str, Any]) -> RunInfo:
    """Say in the log what was done, with what; the names are those that the analysis asks for."""
    return RunInfo(
        provenance=robot.provenance,
        config={
            "shape": plan.shape,
            "range": plan.range,
            "policy": plan.policy,
            "supervision": "with",
            "repeat": plan.repeat,
            "kp_min": plan.kp_min,
            "kp_max": plan.kp_max,
            "waypoints": [list(map(float, point)) for point in plan.course.waypoints],
            "tracker": {"alpha": ALPHA, "c": STEP_SHARE, "delay": HORIZON},
            "guard": config,
            "robot": {
                "base": robot.base.library,
                "localizer": robot.localizer.library,
                "watchdog": robot.placement,
            },
            **about,
        },
        seed=plan.seed if robot.provenance.startswith("simulated") else None,
        start_unix_ns=0 if robot.provenance.startswith("simulated") else time.time_ns(),
    )


def _seed(seed: int, *names: str | int) -> int:
    return int(stream(seed, "quadruped", *names).integers(2**31))
