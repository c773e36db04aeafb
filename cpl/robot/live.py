"""A robot in real time: watchdog, camera and operator put together, and taken apart again."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path

from cpl.robot.guard import GuardConfig
from cpl.robot.interfaces import Pose
from cpl.robot.loop import Robot
from cpl.robot.ports import Address, free_port
from cpl.robot.processes import (
    Companion,
    camera_library,
    here_is_camera_library,
    start_bridge,
    start_emulator,
)
from cpl.robot.seal import new_key
from cpl.robot.t265 import Mount, T265Localizer
from cpl.robot.watched import WatchdogConfig, WatchedBase, launch_watchdog

__all__ = ["PLACEMENTS", "Emulated", "Hardware", "emulated", "hardware"]

PLACEMENTS = ("laptop", "robot")


def _nobody() -> bool:
    return False


@dataclass(frozen=True, kw_only=True)
class Hardware:
    """Where a robot and its camera are.

    Args:
        robot: Address of the Go1, as the watchdog sees it.
        local_port: Where the watchdog sends from.
        watchdog: Address of a watchdog on the robot's own computer; None for one on this one.
        key: What a watchdog elsewhere, or a bridge that is running, seals its packets with; None
            to draw one for processes of this run.
        camera_python: The interpreter that has pyrealsense2 2.53.1; None if a bridge is running.
        camera_port: Where the bridge sends poses to.
        library: `auto`, `sdk` or `wire`.
        mount: Where the camera sits.
        guard: What stands between policy and robot.
        provenance: Where the logs come from.
    """

    robot: Address
    local_port: int = 0
    watchdog: Address | None = None
    key: bytes | None = field(default=None, repr=False)
    camera_python: str | None = None
    camera_port: int = 0
    library: str = "auto"
    mount: Mount = field(default_factory=Mount)
    guard: GuardConfig = field(default_factory=GuardConfig)
    provenance: str = "real-Go1"

    def __post_init__(self) -> None:
        if self.key is None and (self.watchdog or self.camera_python is None):
            raise ValueError(
                "key must be given with a watchdog elsewhere, or with a bridge that runs already"
            )


@dataclass(frozen=True, kw_only=True)
class Emulated:
    """An emulator in the robot's place.

    Args:
        start: Where it stands.
        seed: Its noise.
        world: `twin` or `ideal`.
        faults: NAME@START:STOP each, in seconds since it was first asked to walk.
        placement: Where the watchdog runs: `laptop` or `robot`.
        library: `auto`, `sdk` or `wire`.
        camera_python: The interpreter whose pyrealsense2 has the software device; None for ours.
        software_camera: Whether poses go through pyrealsense2's software device; None for
            "if it is here".
        guard: What stands between policy and robot.
    """

    start: Pose
    seed: int = 0
    world: str = "twin"
    faults: tuple[str, ...] = ()
    placement: str = "laptop"
    library: str = "auto"
    camera_python: str | None = None
    software_camera: bool | None = None
    guard: GuardConfig = field(default_factory=GuardConfig)

    def __post_init__(self) -> None:
        if self.placement not in PLACEMENTS:
            known = ", ".join(PLACEMENTS)
            raise ValueError(f"placement must be one of {known}, not {self.placement!r}")


@contextmanager
def hardware(
    config: Hardware, folder: Path, operator: Callable[[], bool] = _nobody
) -> Iterator[Robot]:
    """Connect to a robot; at the end let it stand and let it go.

    Args:
        config: Where it is.
        folder: For what the processes say.
        operator: Says whether somebody asked to stop.

    Raises:
        RobotError: Watchdog or bridge do not come up.
    """
    folder.mkdir(parents=True, exist_ok=True)
    with ExitStack() as stack:
        key = config.key or new_key()
        camera_key = new_key() if config.camera_python else key
        localizer = T265Localizer(config.camera_port, config.mount, key=camera_key)
        stack.callback(localizer.close)
        if config.camera_python is not None:
            bridge, _ = start_bridge(folder, localizer.address, config.camera_python, camera_key)
            stack.callback(bridge.stop)
        base = WatchedBase(
            WatchdogConfig(
                robot=config.robot,
                library=config.library,
                local_port=config.local_port,
                envelope=config.guard.envelope,
                elsewhere=config.watchdog,
                key=key,
                folder=folder,
            )
        )
        stack.callback(base.close)
        yield Robot(
            base=base,
            localizer=localizer,
            operator=operator,
            provenance=config.provenance,
            odometry_is_truth=config.provenance.startswith("simulated"),
            placement="robot" if config.watchdog else "laptop",
        )


@dataclass(kw_only=True)
class Stage:
    """An emulated session and what a test or a rehearsal may want to hold of it.

    Attributes:
        robot: What the loop is given.
        base: Its base, which knows the watchdog.
        emulator: The robot's process.
        bridge: The camera's process; None where poses come straight from the emulator.
        second: The process of the watchdog's second.
        cut: Cuts the link between policy and robot side.
    """

    robot: Robot
    base: WatchedBase
    emulator: Companion
    bridge: Companion | None
    second: int
    cut: Callable[[], None]


@contextmanager
def emulated(
    config: Emulated, folder: Path, operator: Callable[[], bool] = _nobody
) -> Iterator[Stage]:
    """Put up an emulator, its camera and a watchdog in real time; take them down at the end.

    Args:
        config: What is emulated.
        folder: For black box, logs of the processes and the watchdog's numbers.
        operator: Says whether somebody asked to stop.

    Raises:
        RobotError: A process does not come up.
    """
    folder.mkdir(parents=True, exist_ok=True)
    here = here_is_camera_library()
    wanted = config.software_camera
    software = here is not None if wanted is None else wanted
    with ExitStack() as stack:
        localizer = T265Localizer()
        stack.callback(localizer.close)
        bridge, camera_to = None, localizer.address
        if software or config.camera_python:
            bridge, camera_to = start_bridge(
                folder,
                localizer.address,
                config.camera_python or sys.executable,
                localizer.key,
                software=True,
            )
            stack.callback(bridge.stop)
            localizer.library = f"pyrealsense2 {_camera_version(config, here)} software device"
        else:
            localizer.library = "cpl.robot.emulator"
        emulator, address = start_emulator(
            folder,
            camera_to,
            config.start,
            localizer.key,
            seed=config.seed,
            world=config.world,
            faults=config.faults,
        )
        stack.callback(emulator.stop)
        wanted_dog = WatchdogConfig(
            robot=address,
            library=config.library,
            envelope=config.guard.envelope,
            folder=folder,
        )
        dog, second, cut = _placed(config, wanted_dog, emulator, folder, stack)
        base = WatchedBase(dog)
        stack.callback(base.close)
        robot = Robot(
            base=base,
            localizer=localizer,
            operator=operator,
            provenance="simulated-kinematic",
            odometry_is_truth=True,
            placement=config.placement,
        )
        second = second or base.second or 0
        yield Stage(
            robot=robot, base=base, emulator=emulator, bridge=bridge, second=second, cut=cut
        )


def _placed(
    config: Emulated, dog: WatchdogConfig, emulator: Companion, folder: Path, stack: ExitStack
) -> tuple[WatchdogConfig, int | None, Callable[[], None]]:
    """Lay the link: before the watchdog if it is on the robot, behind it if it is on the laptop."""
    from cpl.robot.emulator.relay import Relay  # needs the extra `quadruped`, hardware does not

    if config.placement == "laptop":
        return dog, None, lambda: os.kill(emulator.pid, signal.SIGUSR1)
    listen = ("127.0.0.1", free_port())
    process = launch_watchdog(dog, listen, folder / "watchdog.json")
    stack.callback(_end, process)
    relay = Relay(listen)
    stack.callback(relay.close)
    there = replace(dog, elsewhere=relay.address)
    return there, process.pid, lambda: relay.suffer("cut")


def _end(process: subprocess.Popen[bytes]) -> None:
    """Wait for a watchdog that was told good-bye; end one that was not."""
    try:
        process.wait(timeout=5)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()
    if process.stderr is not None:
        process.stderr.close()


def _camera_version(config: Emulated, here: str | None) -> str:
    return here or "" if config.camera_python is None else camera_library(config.camera_python)
