"""Is everything as it must be before a robot walks? The pre-flight list, item by item.

What can be measured is measured; what cannot is asked. An item that fails ends the list.
"""

from __future__ import annotations

import os
import shutil
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cpl.optional import look
from cpl.quadruped import Path as Course
from cpl.robot.clock import urgent
from cpl.robot.go1 import SDK
from cpl.robot.guard import GuardConfig
from cpl.robot.interfaces import ZERO, Fix, Mode, RobotError
from cpl.robot.lease import LeaseConfig
from cpl.robot.loop import READY_S, Robot, prepare
from cpl.robot.processes import NEEDED, camera_library

__all__ = ["QUESTIONS", "Item", "before", "connected", "watchdog_trips"]

BATTERY = 40  # [%] to begin with
SPACE_MB = 200  # [MB] for the logs of a day
MARGIN_M = 0.5  # [m] between path and fence
SLEEP_P99_MS = 5.0  # [ms]
POSES_HZ = 100.0  # [1/s] at least; the T265 gives 200
DRIFT_M = 0.05  # [m] at rest
REST_S = 2.0  # [s]
CONFIDENCE = 2  # medium

QUESTIONS = (
    "Is the floor clear to at least 1 m outside of the fence, without stairs, people or animals?",
    "Is the robot on a slack tether whose holder has read the safety briefing?",
    "Does a second person hold the remote, and has its damping been tried today?",
    "Does the robot stand on the path's first waypoint, looking along the first leg?",
)
"""What no program can see."""


@dataclass(frozen=True, kw_only=True)
class Item:
    """One line of the list.

    Attributes:
        name: What was looked at.
        ok: Whether one may go on.
        said: What was found, or what to do.
    """

    name: str
    ok: bool
    said: str

    def __str__(self) -> str:
        return f"[{'ok' if self.ok else 'NO'}] {self.name}: {self.said}"


def before(
    folder: Path, *, hardware: bool, library: str = "auto", camera_python: str | None = None
) -> Iterator[Item]:
    """Look at this computer, before anything is connected.

    Args:
        folder: Where logs go.
        hardware: Whether a physical robot is meant: then the vendor's library is needed.
        library: What is to speak to the robot.
        camera_python: The interpreter for the camera; None if a bridge runs elsewhere.

    Yields:
        Items, until one fails.
    """
    yield from _until_no(
        lambda: _vendor(library, hardware),
        lambda: _camera(camera_python, hardware),
        lambda: _disk(folder),
        lambda: _sleep(hardware),
    )


def connected(robot: Robot, course: Course, config: GuardConfig) -> Iterator[Item]:
    """Look at a robot that is connected, standing, and at its camera.

    Args:
        robot: The robot.
        course: Where it is to go.
        config: The guard's, whose fence is compared with the path.

    Yields:
        Items, until one fails.
    """
    fixes: list[tuple[float, Fix]] = []

    def rest() -> Item:
        fixes.extend(_rest(robot))
        return _poses(fixes)

    yield from _until_no(
        lambda: _answers(robot, course),
        lambda: _battery(robot),
        rest,
        lambda: _tracker(fixes),
        lambda: _fence(course, config),
    )


def watchdog_trips(robot: Robot) -> Item:
    """Fall silent on purpose, at zero velocity, and see whether the watchdog lets the robot stand.

    Afterwards this watchdog obeys no more: connect again.

    Args:
        robot: A robot behind a watchdog.
    """
    name = "the watchdog stops a robot whose policy is silent"
    limits = LeaseConfig()
    robot.base.send(Mode.WALK, ZERO)
    begun = time.monotonic()
    while (waited := time.monotonic() - begun) < 3:
        time.sleep(0.01)
        state = robot.base.state()
        if state is not None and state.tripped:
            due = limits.lease_s + limits.zero_s
            said = f"stands after {waited:.2f} s of silence, {due:.2f} s are allowed for"
            return Item(name=name, ok=waited < due + 0.3, said=said)
    return Item(name=name, ok=False, said="nothing happened in 3 s: do not walk")


def _until_no(*looks: Callable[[], Item]) -> Iterator[Item]:
    for each in looks:
        item = each()
        yield item
        if not item.ok:
            return


def _vendor(library: str, hardware: bool) -> Item:
    name, found = "the robot's library", look(SDK)
    if found and library != "wire":
        return Item(name=name, ok=True, said=str(found))
    what = "our own datagrams (cpl.robot.wire); "
    what += "the vendor's library is not asked for" if found else str(found)
    ok = library != "sdk" and not hardware
    return Item(name=name, ok=ok, said=what)


def _camera(python: str | None, hardware: bool) -> Item:
    name = "the camera's library"
    if python is None:
        return Item(name=name, ok=True, said="not needed here: poses come over UDP")
    try:
        found = camera_library(python)
    except RobotError as error:
        return Item(name=name, ok=False, said=str(error))
    fits = found.startswith(NEEDED) or not hardware
    said = f"pyrealsense2 {found} of {python}"
    said += "" if fits else f", but the last that knows the T265 is {NEEDED}"
    return Item(name=name, ok=fits, said=said)


def _disk(folder: Path) -> Item:
    name = "room for logs"
    existing = next(each for each in (folder, *folder.resolve().parents) if each.exists())
    free = shutil.disk_usage(existing).free / 1e6
    if not os.access(existing, os.W_OK):
        return Item(name=name, ok=False, said=f"{existing} cannot be written")
    return Item(name=name, ok=free >= SPACE_MB, said=f"{free:,.0f} MB free, {SPACE_MB} needed")


def _sleep(hardware: bool) -> Item:
    """Whether this computer wakes up in time; an emulator may be late, a robot may not."""
    late = []
    with urgent() as granted:  # as the loop will be
        for _ in range(50):
            begun = time.monotonic()
            time.sleep(0.01)
            late.append(1e3 * (time.monotonic() - begun - 0.01))
    p99 = float(np.quantile(late, 0.99))
    said = f"wakes up {p99:.2f} ms late (99th percentile), {SLEEP_P99_MS:g} ms are allowed"
    said += "" if granted else "; the scheduler gives no priority"
    ok = p99 <= SLEEP_P99_MS
    said += "" if ok else "; too late for a robot"
    return Item(name="the computer keeps time", ok=ok or not hardware, said=said)


def _answers(robot: Robot, course: Course) -> Item:
    name = "robot and camera answer"
    try:
        prepare(robot, course, READY_S)
    except RobotError as error:
        return Item(name=name, ok=False, said=str(error))
    state = robot.base.state()
    number = state.version if state is not None else (0, 0)
    said = f"through {robot.base.library} and {robot.localizer.library}, versions {number}"
    return Item(name=name, ok=True, said=said)


def _battery(robot: Robot) -> Item:
    state = robot.base.state()
    charge = 0 if state is None else state.battery
    said = f"{charge} %, {BATTERY} % needed"
    return Item(name="battery", ok=charge >= BATTERY, said=said)


def _rest(robot: Robot) -> Iterator[tuple[float, Fix]]:
    """Watch the camera while the robot stands."""
    begun = told = robot.clock.now()
    while (now := robot.clock.now()) - begun < REST_S:
        if now >= told:
            robot.base.send(Mode.STAND)
            told = now + 0.05
        fix = robot.localizer.fix()
        if fix is not None:
            yield now, fix
        robot.clock.wait(now + 0.002)


def _poses(fixes: list[tuple[float, Fix]]) -> Item:
    changes = len({fix.changed_s for _, fix in fixes})
    rate = changes / REST_S
    said = f"{rate:.0f} poses a second, {POSES_HZ:g} needed"
    return Item(name="poses", ok=rate >= POSES_HZ, said=said)


def _tracker(fixes: list[tuple[float, Fix]]) -> Item:
    confidence = min(fix.confidence for _, fix in fixes)
    errors = sum(fix.slam_error != 0 for _, fix in fixes)
    places = np.array([fix.position[:2] for _, fix in fixes])
    drift = float(np.linalg.norm(places[-10:].mean(axis=0) - places[:10].mean(axis=0)))
    ok = confidence >= CONFIDENCE and errors == 0 and drift <= DRIFT_M
    said = f"confidence {confidence}, {errors} SLAM errors, {100 * drift:.1f} cm drift at rest"
    return Item(name="the tracker at rest", ok=ok, said=said)


def _fence(course: Course, config: GuardConfig) -> Item:
    reach = float(np.abs(course.waypoints[:, :2]).max())
    half = config.supervisor.fence_half_width_m
    said = f"path within {reach:.2f} m, fence at {half:.2f} m, {MARGIN_M} m between them needed"
    return Item(name="the fence", ok=reach + MARGIN_M <= half, said=said)
