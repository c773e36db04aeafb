"""The policy's end of the string: a base that is reached through the watchdog.

If the watchdog itself dies, this end sees it within a step and takes the cable over, to stop.
"""

from __future__ import annotations

import json
import subprocess
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from cpl.robot.envelope import Envelope
from cpl.robot.go1 import Go1Base
from cpl.robot.interfaces import ZERO, BaseState, Command, Mode, RobotError
from cpl.robot.packets import Order, PacketError, decode_report, encode
from cpl.robot.ports import LOOPBACK, Address, drain, free_port, receiver
from cpl.robot.watchdog import GOOD_BYE, NO_ANSWER

__all__ = ["WatchdogConfig", "WatchedBase", "launch_watchdog"]

START_S = 60.0  # [s] for the process to come up; a busy computer is slow
SILENT_S = 0.25  # [s] without a report
RESCUE_S = 0.3  # [s] of zero velocity from this process


@dataclass(frozen=True, kw_only=True)
class WatchdogConfig:
    """Where robot and watchdog are.

    Args:
        robot: The robot's address, as the watchdog sees it.
        library: `auto`, `sdk` or `wire`.
        local_port: Where the watchdog sends from; the same for its successor.
        envelope: No larger velocity ever leaves.
        elsewhere: Address of a watchdog that runs on another computer; None to start one here.
        token: The session's number.
        folder: For what the watchdog says and counts; None to drop it.
        rescue: The robot's address as *this* process sees it, for when the watchdog dies.
    """

    robot: Address
    library: str = "auto"
    local_port: int = 0
    envelope: Envelope = field(default_factory=Envelope)
    elsewhere: Address | None = None
    token: int = 1
    folder: Path | None = None
    rescue: Address | None = None


def launch_watchdog(
    config: WatchdogConfig, listen: Address, stats: Path | None = None
) -> subprocess.Popen[bytes]:
    """Start the watchdog on this computer.

    Args:
        config: Where the robot is.
        listen: Where it takes orders.
        stats: Where it writes how regular its stream was.

    Returns:
        The process, in a session of its own: what a terminal sends to the policy, Ctrl-C or a
        hang-up, does not reach it.
    """
    words = [sys.executable, "-m", "cpl.robot", "--token", str(config.token)]
    words += ["--robot", "{}:{}".format(*config.robot), "--listen", "{}:{}".format(*listen)]
    words += ["--library", config.library, "--local-port", str(config.local_port)]
    words += ["--v-max", repr(config.envelope.v_max_mps)]
    words += ["--yaw-max", repr(config.envelope.yaw_rate_max_radps)]
    words += [] if stats is None else ["--stats", str(stats)]
    return subprocess.Popen(
        words,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        start_new_session=True,
    )


class WatchedBase:
    """A robot behind a watchdog.

    Args:
        config: Where both are.

    Raises:
        RobotError: The watchdog does not come up; its own words are in the message.
    """

    def __init__(self, config: WatchdogConfig) -> None:
        self.library = "none yet"
        self._config, self._number = config, 0
        self._socket = receiver(0, "" if config.elsewhere else LOOPBACK)
        self._process: subprocess.Popen[bytes] | None = None
        self._state: BaseState | None = None
        self._report_s = time.monotonic()
        self._last_report = 0
        self.refused = 0
        """Datagrams of the robot that the watchdog could not read."""
        self._gone, self._closed = "", False
        self._to = config.elsewhere or (LOOPBACK, free_port())
        if config.elsewhere is None:
            self._process = self._start()
        self._meet()

    @property
    def pid(self) -> int | None:
        """The watchdog's process; None if it runs elsewhere."""
        return self._process.pid if self._process else None

    def send(self, mode: Mode, command: Command = ZERO) -> None:
        """Order; if the watchdog is gone, stop the robot from here and order nothing."""
        self._look()
        if self._gone:
            return
        self._number += 1
        order = Order(token=self._config.token, number=self._number, mode=mode, command=command)
        self._send(order)

    def state(self) -> BaseState | None:
        """Return the newest state that was reported; None before there is one."""
        self._look()
        if self._state is not None and self._gone and not self._state.tripped:
            self._state = BaseState(**{**self._state.__dict__, "tripped": self._gone})
        return self._state

    def close(self) -> None:
        """Say good-bye and wait until the watchdog has let the robot stand."""
        if self._closed:
            return
        self._closed = True
        bye = Order(token=self._config.token, number=GOOD_BYE, mode=Mode.STAND, command=ZERO)
        for _ in range(3):
            self._send(bye)
        if self._process is not None:
            try:
                self._process.wait(timeout=10)
            except subprocess.TimeoutExpired:
                self._process.terminate()
            if self._process.stderr is not None:
                self._process.stderr.close()
        self._socket.close()

    def stats(self) -> dict[str, float]:
        """Return how regular the watchdog's stream was; empty if it did not say."""
        path = self._stats
        told: dict[str, Any] = {}
        if path is not None and path.exists():
            told = json.loads(path.read_text(encoding="utf-8"))
        return told

    @property
    def _stats(self) -> Path | None:
        return None if self._config.folder is None else self._config.folder / "watchdog.json"

    def _start(self) -> subprocess.Popen[bytes]:
        return launch_watchdog(self._config, self._to, self._stats)

    def _meet(self) -> None:
        """Order "stand" until a report comes."""
        begun = time.monotonic()
        while self._last_report == 0:
            self._number += 1
            self._send(
                Order(token=self._config.token, number=self._number, mode=Mode.STAND, command=ZERO)
            )
            time.sleep(0.02)
            self._read()
            died = self._process is not None and self._process.poll() is not None
            if died or time.monotonic() - begun > START_S:
                said = self._said() if died else f"nothing heard from {self._to} in {START_S} s"
                self._closed = True
                self._socket.close()
                if self._process is not None:
                    self._process.kill()
                    self._process.communicate()
                raise RobotError(f"the watchdog did not come up: {said}")

    def _said(self) -> str:
        words = self._process.stderr if self._process is not None else None
        said = b"" if words is None else words.read()
        return said.decode(errors="replace").strip() or "it said nothing"

    def _send(self, order: Order) -> None:
        try:
            self._socket.sendto(encode(order), self._to)
        except (BlockingIOError, ConnectionRefusedError, OSError):
            return  # a lost order; silence is noticed by both ends

    def _read(self) -> None:
        now = time.monotonic()
        for data in drain(self._socket):
            try:
                report = decode_report(data)
            except PacketError:
                continue
            if report.token != self._config.token or report.number <= self._last_report:
                continue
            self._last_report, self._report_s = report.number, now
            self.library, self.refused = report.library, report.refused
            if report.mode != NO_ANSWER:
                self._state = BaseState(
                    mode=report.mode,
                    battery=report.battery,
                    velocity=report.velocity,
                    odometry=report.odometry,
                    version=report.version,
                    received_s=now - report.age_s,
                    tripped=report.tripped,
                )

    def _look(self) -> None:
        """Read reports; notice a watchdog that is gone, once, and stop the robot from here."""
        if self._gone or self._closed:
            return
        self._read()
        dead = self._process is not None and self._process.poll() is not None
        silent = time.monotonic() - self._report_s > SILENT_S
        if not (dead or silent):
            return
        self._gone = "the watchdog died" if dead else "the watchdog is silent"
        if dead and not (self._state and self._state.tripped):
            self._rescue()

    def _rescue(self) -> None:
        """Take the cable over and stop the robot."""
        base = Go1Base(
            self._config.rescue or self._config.robot,
            library=self._config.library,
            local_port=self._config.local_port,
            envelope=self._config.envelope,
        )
        end = time.monotonic() + RESCUE_S
        while time.monotonic() < end:
            base.send(Mode.WALK, ZERO)
            time.sleep(0.005)
        for _ in range(20):
            base.send(Mode.STAND)
            time.sleep(0.005)
        base.close()
