"""What happens when something goes wrong? Each fault, in each phase, with each place of a watchdog.

Runs go in lock-step through the real drivers, the real watchdog and real datagrams. Faults that end
a process are not for here: `cpl.robot.trials` kills real ones.
"""

from __future__ import annotations

import resource
import tempfile
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from math import hypot, nan
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from cpl.logs import read_run
from cpl.robot.emulator.faults import FAULTS, STRANGERS, Fault
from cpl.robot.interfaces import ZERO, RobotError
from cpl.robot.session import evaluation, perform

if TYPE_CHECKING:
    from cpl.robot.emulator import LockStep

__all__ = ["LOCAL", "PHASES", "PLACEMENTS", "WHAT", "WHAT_TO_DO", "Cell", "drill", "suffer"]

LOCAL: dict[str, str] = {
    "operator": "the operator presses Enter",
    "clock_forward": "this computer's clock jumps forward by 5 s",
    "clock_back": "this computer's clock jumps back by 5 s",
    "slow_policy": "the policy thinks for 0.5 s about each step",
    "no_number": "the policy predicts NaN",
    "exception": "the policy raises an exception",
    "hung": "the policy hangs for 3 s",
    "suspended": "this computer sleeps for 3 s",
    "disk_full": "the disk is full",
}
"""What goes wrong in the policy's process, and in its computer."""

WHAT: dict[str, str] = FAULTS | STRANGERS | LOCAL
"""What each fault is."""

WHAT_TO_DO: dict[str, str] = {
    "dropped": "look for a loose plug; go wired if it was radio",
    "late": "find what else uses the link; go wired",
    "duplicated": "nothing: numbers and checksums sort it out",
    "replayed": "nothing; find the loop in the network",
    "reordered": "nothing; go wired if it was radio",
    "corrupted": "replace the cable",
    "flapping": "fasten the plug",
    "cut": "damp with the remote at once; then the cable",
    "firmware": "do not walk: its firmware speaks another protocol than SDK 3.8",
    "babble": "something else sends to this port: find it",
    "battery": "let it lie down, change the battery",
    "damped": "somebody had a reason: ask before you go on",
    "odometry_drifts": "look at its feet and at the floor",
    "odometry_frozen": "start the robot again",
    "frozen": "unplug and replug the camera, start the bridge again",
    "jump": "more light and texture; begin the run again",
    "lost": "fasten the plug, start the bridge again",
    "failed": "light, texture, lens; then begin the run again",
    "storm": "slower gains, more light; the log is valid",
    "camera_late": "close what else uses the camera's computer",
    "camera_queue": "close what else uses the camera's computer; USB 3",
    "camera_drags": "close what else uses the camera's computer; USB 3",
    "camera_fast": "replace the camera",
    "camera_set": "start the bridge again",
    "camera_replugged": "fasten the plug; begin the run again",
    "camera_moved": "begin the run again",
    "camera_duplicated": "nothing: numbers sort it out",
    "camera_replayed": "find out who does that",
    "camera_reordered": "nothing: numbers sort it out",
    "camera_corrupted": "start the bridge again",
    "outside": "carry it back to the start; is the start where the path begins?",
    "orders_forged": "find out who does that; a new key",
    "orders_replayed": "find out who does that; a new key",
    "orders_flood": "find out who does that; take this computer off that network",
    "poses_forged": "find out who does that; a new key",
    "operator": "ask why",
    "clock_forward": "close what else runs on this computer",
    "clock_back": "close what else runs on this computer",
    "slow_policy": "close what else runs on this computer",
    "no_number": "train the predictor again",
    "exception": "read the traceback",
    "hung": "close what else runs on this computer",
    "suspended": "switch suspend off",
    "disk_full": "make room; the log holds what was written",
}
"""What a person does, fault by fault."""

PHASES = {"standing": (0.0, 0.6), "walking": (2.0, 3.5), "stopping": (4.25, 9.0)}
"""From when to when a fault is there [s]."""
PLACEMENTS = ("laptop", "robot")
LENGTH_S = 4.0  # [s] of each run
SKEW_S = {"clock_forward": 5.0, "clock_back": -5.0}
SLOW_S, SLEEP_S = 0.5, 3.0  # [s]
FORECAST = 0.3  # [-] what the policy predicts


@dataclass(frozen=True, kw_only=True)
class Cell:
    """What one fault did.

    Attributes:
        fault: Its name.
        phase: When it began.
        placement: Where the watchdog was.
        outcome: Why the run ended; `refused` if it never began, `raised` after an exception.
        reason: What the guard said most often.
        zero_s: From the fault's beginning until the robot was first asked for zero [s]; NaN if it
            walked on to its planned end.
        blind_s: Of that, how long nothing could reach the robot [s].
        fastest_mps: The largest velocity that reached the robot.
        moved_m: How far the robot was at most from where it was when the fault began [m]; NaN if it
            walked on.
        rests: Whether the last thing that reached the robot was no velocity.
        rows: In the log.
        log: `whole`, `recovered` or `none`.
    """

    fault: str
    phase: str
    placement: str
    outcome: str
    reason: str
    zero_s: float
    blind_s: float
    fastest_mps: float
    moved_m: float
    rests: bool
    rows: int
    log: str


def drill(names: Iterable[str] | None = None, placement: str = "laptop") -> pd.DataFrame:
    """Let each fault happen for 1.5 s in the middle of a short run.

    Args:
        names: Of faults; all unless given.
        placement: Where the watchdog is.

    Returns:
        One row a fault: what `Cell` has, `what` it is and what a person is to `do`.
    """
    cells = [suffer(name, "walking", placement) for name in (WHAT if names is None else names)]
    rows = [vars(cell) | {"what": WHAT[cell.fault], "do": WHAT_TO_DO[cell.fault]} for cell in cells]
    return pd.DataFrame(rows)


def suffer(name: str, phase: str, placement: str, library: str = "wire") -> Cell:
    """Let one fault happen in one phase of a short run.

    Args:
        name: One of `WHAT`.
        phase: One of `PHASES`.
        placement: One of `PLACEMENTS`.
        library: What speaks to the emulated robot.

    Raises:
        ValueError: No such fault, phase or placement.
    """
    from cpl.robot.emulator import Ideal, LockStep

    known = {"fault": (name, WHAT), "phase": (phase, PHASES), "placement": (placement, PLACEMENTS)}
    for what, (given, names) in known.items():
        if given not in names:
            raise ValueError(f"{what} must be one of {', '.join(names)}, not {given!r}")
    start, stop = PHASES[phase]
    planned = [] if name in LOCAL else [Fault(name=name, start_s=start, stop_s=stop)]
    robot = LockStep(Ideal(), planned, library=library, placement=placement)
    plan = replace(evaluation(1)[0], max_s=LENGTH_S)
    robot.place(plan.course.start, plan.seed)
    outcome, reasons = "raised", dict[str, int]()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"{plan.name}.mcap"
        local = _Local(name, start, stop, robot, path)
        try:
            with local.hurt():
                walked = perform(
                    robot.robot, plan, Path(folder), predictor=local.predict, watch=local.watch
                )
            outcome, reasons = walked.outcome, walked.reasons
        except RobotError:
            outcome = "refused"
        except (ZeroDivisionError, OSError):
            outcome = "raised"
        rows, log = _read(path)
    robot.close()
    reasons.pop("speed_clamp", None)
    moves = [each for each in robot.seen if any(each.velocity)]
    stilled = [each.t_s for each in robot.seen if each.t_s >= start and each.velocity == ZERO]
    ended = outcome == "timeout" and (not stilled or stilled[0] > start + LENGTH_S / 2)
    walks = phase == "walking"
    zero_s = nan if ended or not stilled else stilled[0] - start
    return Cell(
        fault=name,
        phase=phase,
        placement=placement,
        outcome=outcome,
        reason=max(reasons, key=lambda each: reasons[each]) if reasons else "",
        zero_s=zero_s if walks else _still(robot.seen, start),
        blind_s=_blind(name, placement) if walks else 0.0,
        fastest_mps=max((hypot(*each.velocity[:2]) for each in moves), default=0.0),
        moved_m=nan if ended or phase != "walking" else local.moved_m(),
        rests=not robot.seen or robot.seen[-1].velocity == ZERO,
        rows=rows,
        log=log,
    )


def _still(seen: list, start: float) -> float:
    """Return how long after a fault in standing or stopping the last velocity came [s]."""
    moved = [each.t_s for each in seen if any(each.velocity) and each.t_s >= start]
    return 0.0 if start == 0.0 or not moved else moved[-1] - start


def _blind(name: str, placement: str) -> float:
    """Return for how long the fault keeps everything from the robot [s]."""
    start, stop = PHASES["walking"]
    if placement == "laptop":
        return {
            "cut": stop - start, "corrupted": stop - start, "late": 0.4, "flapping": 0.3,
            "suspended": SLEEP_S,
        }.get(name, 0.0)  # fmt: skip
    return 0.0


def _read(path: Path) -> tuple[int, str]:
    if not path.exists():
        return 0, "none"
    run = read_run(path)
    return len(run.table), "whole" if run.recovery.whole else "recovered"


class _Local:
    """What goes wrong in the policy's own process."""

    def __init__(
        self,
        name: str,
        start: float,
        stop: float,
        robot: LockStep,
        log: Path,
    ) -> None:
        self._name, self._start, self._stop = name, start, stop
        self._robot, self._log, self._slept = robot, log, False
        self._places: list[tuple[float, float]] = []
        robot.robot.operator = lambda: name == "operator" and self._now()

    def predict(self, features: NDArray[np.float64]) -> float:
        """Be the policy's predictor, and whatever goes wrong while it is asked."""
        del features
        if self._now():
            self._suffer()
        return nan if self._name == "no_number" and self._now() else FORECAST

    def watch(self, row: dict[str, object]) -> None:
        """Keep where the robot really is, from the fault's beginning on."""
        del row
        if self._robot.clock.true_s >= self._start:
            self._places.append(self._robot.emulation.true_place)

    def moved_m(self) -> float:
        """Return how far the robot went from where the fault began [m]."""
        if not self._places:
            return 0.0
        x, y = self._places[0]
        return max(
            hypot(u - x, v - y) for u, v in [*self._places, self._robot.emulation.true_place]
        )

    @contextmanager
    def hurt(self) -> Iterator[None]:
        """Let the clock jump, and the disk be full, while this goes on."""
        before = resource.getrlimit(resource.RLIMIT_FSIZE)
        self._jump()
        try:
            yield
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, before)

    def _now(self) -> bool:
        return self._start <= self._robot.clock.true_s < self._stop

    def _suffer(self) -> None:
        if self._name == "exception":
            raise ZeroDivisionError("a policy that is wrong")
        if self._name == "slow_policy":
            self._robot.clock.skew_s += SLOW_S
        if self._name in ("hung", "suspended") and not self._slept:
            self._slept = True
            self._robot.asleep = self._name == "suspended"
            self._robot.clock.wait(self._robot.clock.now() + SLEEP_S)
            self._robot.asleep = False
        if self._name == "disk_full":
            size = self._log.stat().st_size if self._log.exists() else 0
            with suppress(ValueError):
                resource.setrlimit(
                    resource.RLIMIT_FSIZE, (size, resource.getrlimit(resource.RLIMIT_FSIZE)[1])
                )

    def _jump(self) -> None:
        skew, clock = SKEW_S.get(self._name), self._robot.clock
        if skew is None:
            return
        step: Callable[[float, bool], None] = clock._step

        def jump(t_s: float, full: bool) -> None:
            if t_s >= self._start:
                clock.skew_s = skew if t_s < self._stop else clock.skew_s
            step(t_s, full)

        clock._step = jump
