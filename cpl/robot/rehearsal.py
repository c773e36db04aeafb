"""The whole procedure without a robot: check, walk, collect, train, evaluate, where to look.

One short run goes in real time through all processes: watchdog, bridge, emulator. The 43 training
runs and the evaluation go in accelerated time, through the same drivers and datagrams in lock-step.
"""

from __future__ import annotations

import io
import json
import multiprocessing
import os
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any, TextIO

from cpl.logs import read_run
from cpl.quadruped import Path as Course
from cpl.quadruped import (
    Predictor,
    TrainingConfig,
    dataset,
    decode_predictor,
    encode_predictor,
    train,
)
from cpl.robot.checklist import Item, before, connected, watchdog_trips
from cpl.robot.clock import histogram, urgent
from cpl.robot.go1 import vendor_version
from cpl.robot.interfaces import RobotError
from cpl.robot.live import Emulated, emulated
from cpl.robot.session import Plan, Walked, collection, evaluation, perform
from cpl.robot.view import View
from cpl.store import atomic_write, plain

__all__ = [
    "EDGES_MS",
    "Rehearsal",
    "accelerated",
    "real_time",
    "rehearse",
    "train_on",
    "transcript",
]

EDGES_MS = (0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100)
PREDICTOR = "predictor.safetensors"
TRAINING = TrainingConfig()
ATTEMPTS = 3  # of a rehearsal that a page shows

Say = Callable[[str], None]


@dataclass(frozen=True, kw_only=True)
class Rehearsal:
    """What is rehearsed.

    Args:
        trajectories: Training runs; the paper's 43.
        repeats: Of each evaluation run; the paper's 3.
        seconds: Length of the run in real time [s]; 0 for none.
        placement: Where the watchdog runs in that run.
        faults: Of that run, NAME@START:STOP each.
        library: `auto`, `sdk` or `wire`.
        camera_python: The interpreter whose pyrealsense2 has the software device; None for ours.
        seed: Draws paths and noise.
        workers: Processes for what is accelerated.
    """

    trajectories: int = 43
    repeats: int = 3
    seconds: float = 8.0
    placement: str = "laptop"
    faults: tuple[str, ...] = ()
    library: str = "auto"
    camera_python: str | None = None
    seed: int = 0
    workers: int = 2


def rehearse(rehearsal: Rehearsal, folder: Path, say: Say) -> Path:
    """Play the whole procedure through.

    Args:
        rehearsal: How much of it.
        folder: For logs, predictor and notes; it must not exist yet.
        say: Is told what happens, line by line.

    Returns:
        The folder of the evaluation's logs.

    Raises:
        FileExistsError: The folder exists.
        RobotError: An item of the checklist failed, or a process did not come up.
    """
    folder.mkdir(parents=True)
    begun = time.monotonic()
    notes: dict[str, Any] = {"rehearsal": plain(rehearsal), "base": _base(rehearsal)}
    say(f"The robot is an emulator on loopback, spoken to through {notes['base']}.")
    if rehearsal.seconds > 0:
        walked = real_time(rehearsal, folder, say)
        notes["real_time"] = _told(walked) | walked.timing.told()
    for kind, plans in (
        ("collect", collection(rehearsal.trajectories, rehearsal.seed)),
        ("evaluate", evaluation(rehearsal.repeats, rehearsal.seed)),
    ):
        since = time.monotonic()
        say(f"\n{kind}: {len(plans)} runs in accelerated time")
        made = list(accelerated(plans, folder / kind, rehearsal, _learnt(folder, kind)))
        notes[kind] = [_told(walked) for walked in made]
        say(_summary(made, time.monotonic() - since))
        if kind == "collect":
            rows, positive = train_on(folder / "collect", folder / PREDICTOR, rehearsal.seed)
            say(f"train: {rows} rows, {positive:.1%} of them before a SLAM error")
    notes["seconds"] = round(time.monotonic() - begun, 1)
    atomic_write(folder / "rehearsal.json", json.dumps(notes, indent=1) + "\n")
    say(f"\nAll of it took {notes['seconds']:.0f} s. Simulated, kinematic: no robot has moved.")
    return folder / "evaluate"


def real_time(rehearsal: Rehearsal, folder: Path, say: Say, screen: TextIO | None = None) -> Walked:
    """Walk the pre-flight list and then a short run, in real time, through all processes.

    Args:
        rehearsal: How.
        folder: For the logs.
        say: Is told what happens.
        screen: Where the run is shown; standard error unless given.

    Raises:
        RobotError: An item failed, a process did not come up, or a run without a fault ended
            otherwise than planned.
    """
    plan = replace(
        collection(1, rehearsal.seed)[0], name="real-time", max_s=rehearsal.seconds, repeat=0
    )
    place = folder / "real_time"
    stage = Emulated(
        start=plan.course.start,
        seed=plan.seed,
        placement=rehearsal.placement,
        library=rehearsal.library,
        camera_python=rehearsal.camera_python,
    )
    say("\nPre-flight list")
    items = before(place, hardware=False, library=rehearsal.library)
    _all_ok(items, say)
    with emulated(stage, place / "check") as there:
        _all_ok(connected(there.robot, plan.course, stage.guard), say)
        _all_ok([watchdog_trips(there.robot)], say)
    say(f"\nA run in real time, at most {rehearsal.seconds:g} s, watchdog on the {stage.placement}")
    with emulated(replace(stage, faults=rehearsal.faults), place) as there:
        view = View(plan.course, (plan.kp_min, plan.kp_max), out=screen)
        with urgent() as priority:
            walked = perform(there.robot, plan, place, watch=view)
        stream = there.base
    say(f"{_line(walked)}")
    told = walked.timing.told()
    say(
        f"period off by {told['period_error_p99_ms']:.2f} ms (99th percentile), policy takes "
        f"{told['policy_p99_ms']:.2f} ms, the whole step {told['loop_p99_ms']:.2f} ms"
        + ("" if priority else "; the scheduler gave no priority")
    )
    if sent := stream.stats():
        say(
            f"the watchdog sent {sent['rate_hz']:g} commands a second, off by "
            f"{sent['period_error_p99_ms']:.2f} ms (99th percentile)"
        )
    say("period error\n" + histogram(walked.timing.error_s, EDGES_MS))
    say("policy time\n" + histogram(walked.timing.policy_s, EDGES_MS))
    if not rehearsal.faults and walked.outcome not in ("arrived", "timeout"):
        raise RobotError(f"a run in which nothing was to go wrong ended with {walked.outcome!r}")
    return walked


def transcript(rehearsal: Rehearsal) -> str:
    """Return what the real-time part of a rehearsal says.

    A computer that is busy with other things may come too late for its own robot; then it is
    rehearsed once more, and the page says so.

    Args:
        rehearsal: How.

    Raises:
        RobotError: It failed, and again: a page that shows a rehearsal shows one that succeeded.
    """
    lines: list[str] = []
    for left in reversed(range(ATTEMPTS)):
        with tempfile.TemporaryDirectory() as folder:
            try:
                real_time(rehearsal, Path(folder), lines.append, _Page(lines))
                break
            except RobotError as error:
                if not left:
                    raise
                lines.append(f"\nfailed: {error}. Once more.")
    return "\n".join(lines).strip()


class _Page(io.StringIO):
    """A screen that is a list of lines."""

    def __init__(self, lines: list[str]) -> None:
        super().__init__()
        self._lines = lines

    def write(self, text: str, /) -> int:
        self._lines.append(text.rstrip("\n"))
        return len(text)


def accelerated(
    plans: Sequence[Plan], folder: Path, rehearsal: Rehearsal, predictor: Path | None
) -> Iterator[Walked]:
    """Make runs in lock-step, as fast as the computer can.

    Args:
        plans: What is to be done.
        folder: For the logs.
        rehearsal: Library and processes.
        predictor: The trained network's file; None if no run needs it.

    Yields:
        The runs, in order.
    """
    jobs = [(plan, folder, rehearsal.library, predictor) for plan in plans]
    if rehearsal.workers == 1:
        yield from map(_walk, jobs)
        return
    spawn = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(min(rehearsal.workers, len(jobs)), mp_context=spawn) as pool:
        yield from pool.map(_walk, jobs)


def train_on(folder: Path, out: Path, seed: int = 0) -> tuple[int, float]:
    """Train the predictor on the logs of a folder and keep it.

    Args:
        folder: Logs of the training runs.
        out: The predictor's file.
        seed: Draws first weights and order.

    Returns:
        Rows, and the share of them with a SLAM error two steps later.

    Raises:
        ValueError: No log, a log without its path, or no SLAM error at all.
    """
    paths = sorted(folder.glob("*.mcap"))
    if not paths:
        raise ValueError(f"folder must hold logs, not none: {folder}")
    runs = []
    for path in paths:
        run = read_run(path)
        if "waypoints" not in run.info.config:
            raise ValueError(f"folder must hold training runs, not {path.name}: it has no path")
        course = Course(name="zigzag", waypoints=run.info.config["waypoints"])
        runs.append(dataset(run.table.to_dict("records"), course))
    predictor = train(runs, TRAINING, seed)
    about = {"logs": [path.name for path in paths], "training": plain(TRAINING), "seed": seed}
    atomic_write(out, encode_predictor(predictor, about))
    rows = sum(len(labels) for _, labels in runs)
    return rows, float(sum(labels.sum() for _, labels in runs)) / rows


Job = tuple[Plan, Path, str, Path | None]


def _walk(job: Job) -> Walked:
    """Make one run in a world of this process."""
    from cpl.robot.emulator import LockStep

    plan, folder, library, file = job
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    lockstep = LockStep(_world(), library=library)
    try:
        lockstep.place(plan.course.start, plan.seed)
        return perform(lockstep.robot, plan, folder, predictor=_loaded(file))
    finally:
        lockstep.close()


@lru_cache(maxsize=1)
def _world() -> Any:  # noqa: ANN401 - a twin
    from cpl.robot.emulator import rehearsal_world

    return rehearsal_world()


@lru_cache(maxsize=1)
def _loaded(file: Path | None) -> Predictor | None:
    return None if file is None else decode_predictor(file.read_bytes())[0]


def _learnt(folder: Path, kind: str) -> Path | None:
    return folder / PREDICTOR if kind == "evaluate" else None


def _base(rehearsal: Rehearsal) -> str:
    vendor = vendor_version()
    if vendor is None or rehearsal.library == "wire":
        return "cpl.robot.wire, without the vendor's library"
    return f"the vendor's unitree-legged-sdk {vendor}"


def _all_ok(items: Any, say: Say) -> None:  # noqa: ANN401 - items
    item: Item
    for item in items:
        say(f"  {item}")
        if not item.ok:
            raise RobotError(f"{item.name}: {item.said}")


def _told(walked: Walked) -> dict[str, Any]:
    return {
        "log": walked.path.name,
        "outcome": walked.outcome,
        "rows": walked.rows,
        "duration_s": round(walked.duration_s, 2),
        "slam_errors": walked.slam_errors,
        "reasons": walked.reasons,
    }


def _line(walked: Walked) -> str:
    why = ", ".join(f"{name} {count}" for name, count in walked.reasons.items()) or "never"
    return (
        f"{walked.path.name}: {walked.outcome} after {walked.duration_s:.1f} s, {walked.rows} "
        f"rows, {walked.slam_errors} SLAM errors; the guard acted: {why}"
    )


def _summary(made: Sequence[Walked], seconds: float) -> str:
    outcomes: dict[str, int] = {}
    for walked in made:
        outcomes[walked.outcome] = outcomes.get(walked.outcome, 0) + 1
    rows = sum(walked.rows for walked in made)
    errors = sum(walked.slam_errors for walked in made) / rows
    ended = ", ".join(f"{count} {name}" for name, count in sorted(outcomes.items()))
    walked_s = sum(walked.duration_s for walked in made)
    return (
        f"{len(made)} runs, {rows} rows, SLAM errors in {errors:.1%}; {ended}. "
        f"{walked_s:.0f} s of walking in {seconds:.0f} s"
    )
