"""The policy's end of the string: a base that is reached through the watchdog.

Orders are sealed and say what they rest on: the newest report that was read before the policy
decided. If watchdog and second are both silent, this end kills what is left of them and takes the
cable over, to stop.
"""

from __future__ import annotations

import json
import os
import secrets
import signal
import subprocess
import sys
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Protocol

from cpl.robot.clock import Clock, RealClock
from cpl.robot.envelope import Envelope
from cpl.robot.interfaces import ZERO, BaseState, Command, Mode, RobotError
from cpl.robot.packets import Order, PacketError, Report, decode_report, encode
from cpl.robot.ports import LOOPBACK, Address, drain_from, free_port, receiver, send
from cpl.robot.seal import new_key
from cpl.robot.second import take_over
from cpl.robot.watchdog import NO_ANSWER

__all__ = ["WatchdogConfig", "WatchedBase", "launch_watchdog"]

START_S = 60.0  # [s] for the process to come up; a busy computer is slow
SILENT_S = 0.3  # [s] without a report; the second has acted by then, if there is one
HAND_OVER_S = 0.1  # [s] for the second to take the port that its watchdog had
LEAVE_S = 75.0  # [s] for the watchdog to let the robot stand and go; it persists while unheard


@dataclass(frozen=True, kw_only=True)
class WatchdogConfig:
    """Where robot and watchdog are.

    Args:
        robot: The robot's address, as the watchdog sees it.
        library: `auto`, `sdk` or `wire`.
        local_port: Where the watchdog sends from; 0 for one that is free. Its successor's too.
        envelope: No larger velocity ever leaves.
        elsewhere: Address of a watchdog that runs on another computer; None to start one here.
        key: Of this run; drawn unless given. A watchdog elsewhere must have the same.
        folder: For what the watchdog counts; None to drop it.
    """

    robot: Address
    library: str = "auto"
    local_port: int = 0
    envelope: Envelope = field(default_factory=Envelope)
    elsewhere: Address | None = None
    key: bytes = field(default_factory=new_key, repr=False)
    folder: Path | None = None


class Process(Protocol):
    """What is used of `subprocess.Popen`."""

    pid: int

    def poll(self) -> int | None:
        """Return its exit status; None while it runs."""
        ...

    def wait(self, timeout: float | None = None) -> int:
        """Wait for its end."""
        ...


def launch_watchdog(
    config: WatchdogConfig, listen: Address, stats: Path | None = None
) -> subprocess.Popen[bytes]:
    """Start a watchdog and its second on this computer.

    Args:
        config: Where the robot is, and the key, which goes over a pipe.
        listen: Where it takes orders.
        stats: Where it writes how regular its stream was.

    Returns:
        The second's process, in a session of its own: what a terminal sends to the policy, Ctrl-C
        or a hang-up, does not reach it.
    """
    process = subprocess.Popen(
        [sys.executable, "-m", "cpl.robot", *watchdog_words(config, listen, stats)],
        stdin=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        start_new_session=True,
    )
    assert process.stdin is not None  # it is a pipe
    with suppress(BrokenPipeError):  # it ended already; what it said is asked for later
        process.stdin.write(config.key.hex().encode() + b"\n")
        process.stdin.close()
    return process


def watchdog_words(config: WatchdogConfig, listen: Address, stats: Path | None) -> list[str]:
    """Return the words of a watchdog's command line; there is nothing secret in them."""
    words = ["--robot", "{}:{}".format(*config.robot), "--listen", "{}:{}".format(*listen)]
    words += ["--library", config.library, "--local-port", str(config.local_port)]
    words += ["--v-max", repr(config.envelope.v_max_mps)]
    words += ["--yaw-max", repr(config.envelope.yaw_rate_max_radps)]
    return words + ([] if stats is None else ["--stats", str(stats)])


Launch = Callable[[WatchdogConfig, Address, Path | None], Process]


class WatchedBase:
    """A robot behind a watchdog.

    Args:
        config: Where both are.
        clock: The time.
        launch: Starts a watchdog that is not elsewhere.

    Raises:
        RobotError: The watchdog does not come up; its own words are in the message.
    """

    def __init__(
        self,
        config: WatchdogConfig,
        *,
        clock: Clock | None = None,
        launch: Launch = launch_watchdog,
    ) -> None:
        self.library = "none yet"
        self.refused = 0
        """Datagrams of the robot that the watchdog could not read."""
        self._clock = clock or RealClock()
        self._hello, self._number = secrets.randbits(63) + 1, 0
        self._report: Report | None = None
        self._report_s = self._basis_s = 0.0
        self._state: BaseState | None = None
        self._gone, self._closed, self._asked = "", False, False
        if config.elsewhere is None and config.local_port == 0:
            config = replace(config, local_port=free_port())
        self._config = config
        self._socket = receiver(0, "" if config.elsewhere else LOOPBACK)
        self._to = config.elsewhere or (LOOPBACK, free_port())
        self._process: Process | None = None
        if config.elsewhere is None:
            self._process = launch(config, self._to, self._stats)
        self._meet()

    @property
    def pid(self) -> int | None:
        """The watchdog's process, on the computer that it runs on."""
        return self._report.pid if self._report else None

    @property
    def second(self) -> int | None:
        """The process of the watchdog's second; None if it runs elsewhere."""
        return self._process.pid if self._process else None

    def send(self, mode: Mode, command: Command = ZERO) -> None:
        """Order; if the watchdog is gone, stop the robot from here and order nothing.

        A velocity rests on what `state` returned last. Zero rests on nothing but this moment.
        """
        self._look()
        if self._gone or self._report is None:
            return
        if command == ZERO:
            self._basis_s = self._report.sent_s
        self._asked = True
        self._order(mode, command)

    def state(self) -> BaseState | None:
        """Return the newest state that was reported; None before there is one."""
        self._look()
        if self._report is not None:
            self._basis_s = self._report.sent_s
        if self._state is not None and self._gone and not self._state.tripped:
            self._state = replace(self._state, tripped=self._gone)
        return self._state

    def close(self) -> None:
        """Say good-bye and wait until the watchdog has let the robot stand."""
        if self._closed:
            return
        self._look()
        self._closed = True
        for _ in range(3):
            self._order(Mode.STAND, last=True)
        if self._process is not None:
            self._see_off(self._process)
            _shut(self._process)
        self._socket.close()

    def _see_off(self, process: Process) -> None:
        """Wait until watchdog and second have left; end what hangs."""
        end = self._clock.now() + LEAVE_S
        while process.poll() is None:
            now = self._clock.now()
            self._clock.wait(now + 0.02)
            self._read()
            done = self._gone or (self._report is not None and self._report.tripped)
            if not done and now - self._report_s > SILENT_S:
                self._gone = "the watchdog is silent"
                self._take_over()
            if now > end or (self._gone and _about(process.pid)[0] == "T"):
                self._kill()

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

    def _meet(self) -> None:
        """Greet until a report comes. Nothing is asked of the robot."""
        begun = due = self._clock.now()
        while self._report is None:
            self._order(Mode.IDLE)
            due += 0.02
            self._clock.wait(due)
            self._read()
            died = self._process is not None and self._process.poll() is not None
            if self._report is None and (died or self._clock.now() - begun > START_S):
                said = self._said() if died else f"nothing heard from {self._to} in {START_S} s"
                self._closed = True
                self._socket.close()
                self._kill()
                raise RobotError(f"the watchdog did not come up: {said}")
        self._order(Mode.IDLE)  # from now on it obeys nobody else

    def _said(self) -> str:
        words = getattr(self._process, "stderr", None)
        said = b"" if words is None else words.read()
        return said.decode(errors="replace").strip() or "it said nothing"

    def _order(self, mode: Mode, command: Command = ZERO, *, last: bool = False) -> None:
        self._number += 1
        order = Order(
            run=self._report.run if self._report else 0,
            hello=self._hello,
            number=self._number,
            heard_s=self._basis_s,
            mode=mode,
            command=command,
            last=last,
        )
        send(self._socket, encode(order, self._config.key), self._to)

    def _read(self) -> None:
        now = self._clock.now()
        for data, sender in drain_from(self._socket):
            try:
                report = decode_report(data, self._config.key)
            except PacketError:
                continue
            if sender != self._to or report.hello != self._hello:
                continue
            if self._report is not None and (
                report.run != self._report.run or report.number <= self._report.number
            ):
                continue
            self._report, self._report_s = report, now
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
        silent_s = self._clock.now() - self._report_s
        dead = self._process is not None and self._process.poll() is not None
        if silent_s <= (SILENT_S / 3 if dead else SILENT_S):
            return
        self._gone = "the watchdog died" if dead else "the watchdog is silent"
        if not (self._report and self._report.tripped):
            self._take_over()

    def _take_over(self) -> None:
        """Kill the watchdog, so that its port is free; its second has it now, or else this end.

        The second is left alone: if this process ends here and now, it is the one that is left.
        """
        if self._process is None:
            return  # it is elsewhere, and so is its second
        dog = self._report.pid if self._report else 0
        if dog and _about(dog)[1] == str(self._process.pid):  # it has not left, and is ours
            os.kill(dog, signal.SIGKILL)
        if self._asked:
            with suppress(RobotError):  # somebody else has the port, and stops the robot
                take_over(
                    self._config.robot,
                    self._config.local_port,
                    clock=self._clock.now,
                    port_s=HAND_OVER_S,
                )

    def _kill(self) -> None:
        """Kill watchdog and second: they are a session of their own."""
        if self._process is None:
            return
        with suppress(ProcessLookupError):
            os.killpg(self._process.pid, signal.SIGKILL)
        self._process.wait()
        _shut(self._process)


def _shut(process: Process) -> None:
    words = getattr(process, "stderr", None)
    if words is not None:
        words.close()


def _about(pid: int) -> tuple[str, str]:
    """Return a process's state (T: stopped) and its session; empty if there is none."""
    try:
        words = Path(f"/proc/{pid}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()
    except OSError:
        return "", ""
    return words[0], words[3]
