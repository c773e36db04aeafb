"""The other processes of a session: the camera's bridge, and an emulator in the robot's place."""

from __future__ import annotations

import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import IO

from cpl.optional import look
from cpl.robot import bridge
from cpl.robot.interfaces import Pose, RobotError
from cpl.robot.ports import Address, free_port

__all__ = [
    "CAMERA_PYTHONS",
    "Companion",
    "camera_library",
    "here_is_camera_library",
    "start_bridge",
    "start_emulator",
]

CAMERA_PYTHONS = ("python3.10",)
"""Names under which a Python for the camera is looked for."""
NEEDED = "2.53.1"  # the last pyrealsense2 that knows the T265
START_S = 180.0  # [s] an emulator compiles its twin when it runs for the first time


class Companion:
    """A process that belongs to a session and ends with it.

    Args:
        words: Its command.
        ready: What it says when it is ready.
        log: Where everything it says is kept.
        key: What its packets are sealed with; it goes over a pipe.

    Raises:
        RobotError: It ended, or never said it was ready; its words are in the message.
    """

    def __init__(self, words: list[str], ready: str, log: Path, key: bytes) -> None:
        self._log = log
        log.parent.mkdir(parents=True, exist_ok=True)
        self._file: IO[bytes] = log.open("ab")
        self._process = subprocess.Popen(
            words,
            stdin=subprocess.PIPE,
            stdout=self._file,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )
        assert self._process.stdin is not None  # it is a pipe
        with suppress(BrokenPipeError):  # it ended already, and its words say why
            self._process.stdin.write(key.hex().encode() + b"\n")
            self._process.stdin.close()
        deadline = time.monotonic() + START_S
        while ready not in self._said():
            if self._process.poll() is not None or time.monotonic() > deadline:
                self.stop()
                raise RobotError(f"{Path(words[0]).name} did not start: {self._said().strip()}")
            time.sleep(0.02)

    @property
    def pid(self) -> int:
        """Its number."""
        return self._process.pid

    def running(self) -> bool:
        """Whether it is there."""
        return self._process.poll() is None

    def stop(self) -> None:
        """Ask it to end, and wait."""
        if self._process.poll() is None:
            self._process.terminate()
            self._process.send_signal(signal.SIGCONT)  # one that was stopped does not hear
            try:
                self._process.wait(timeout=5)
            except subprocess.TimeoutExpired:
                self._process.kill()
                self._process.wait()
        self._file.close()

    def _said(self) -> str:
        return self._log.read_text(encoding="utf-8", errors="replace")


def start_emulator(
    folder: Path,
    camera_to: Address,
    start: Pose,
    key: bytes,
    *,
    seed: int = 0,
    world: str = "twin",
    faults: Iterable[str] = (),
) -> tuple[Companion, Address]:
    """Put an emulator where a robot would be.

    Args:
        folder: For what it says and for its black box.
        camera_to: Where its camera sends poses.
        start: Where it stands.
        key: What its camera's packets are sealed with.
        seed: Its noise.
        world: `twin` or `ideal`.
        faults: NAME@START:STOP each, in seconds since it was first asked to walk.

    Returns:
        The process and the robot's address.
    """
    port = free_port()
    folder.mkdir(parents=True, exist_ok=True)
    words = [sys.executable, "-m", "cpl.robot.emulator", "--port", str(port), "--world", world]
    words += ["--camera", "{}:{}".format(*camera_to), "--seed", str(seed)]
    words += [f"--start={start[0]!r},{start[1]!r},{start[2]!r}"]
    words += ["--black-box", str(folder / "black_box.jsonl")]
    words += [word for fault in faults for word in ("--fault", fault)]
    made = Companion(words, "the emulator is there", folder / "emulator.txt", key)
    return made, ("127.0.0.1", port)


def start_bridge(
    folder: Path, to: Address, python: str, key: bytes, *, software: bool = False
) -> tuple[Companion, Address]:
    """Start the camera's bridge.

    Args:
        folder: For what it says.
        to: The localizer's address.
        python: The interpreter that has pyrealsense2.
        key: What its packets are sealed with.
        software: Whether the library's software device stands in for a camera.

    Returns:
        The process, and where the software device takes poses (port 0 with a camera).
    """
    port = free_port() if software else 0
    words = [python, str(Path(bridge.__file__)), "--to", "{}:{}".format(*to)]
    words += ["--software", str(port)] if software else []
    ready = "the software device streams" if software else "the camera streams"
    return Companion(words, ready, folder / "bridge.txt", key), ("127.0.0.1", port)


def camera_library(python: str) -> str:
    """Return the version of pyrealsense2 that an interpreter has.

    Raises:
        RobotError: There is no such interpreter, or no pyrealsense2 that it can load.
    """
    if shutil.which(python) is None:
        raise RobotError(f"there is no {python}: the T265 needs Python 3.10")
    found = look("pyrealsense2", python)
    if found.state == "absent":
        raise RobotError(
            f"{python} has no pyrealsense2: {python} -m pip install pyrealsense2=={NEEDED}.4623"
        )
    if not found:
        raise RobotError(f"{python}: {found}")
    return found.version


def here_is_camera_library() -> str | None:
    """Return the version of pyrealsense2 beside this program; None if it cannot be used.

    It is too new for a T265, and good enough for the software device.
    """
    found = look("pyrealsense2")
    return found.version if found else None
