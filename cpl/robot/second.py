"""Who stops the robot when the watchdog cannot? Its second: the process that started it.

The two tell each other a hundred times a second that they are there. A watchdog that died, hangs or
is starved is killed, so that its port is free, and the second asks the robot for zero velocity and
then to stand. A second that is gone ends the watchdog's run. Neither trusts the other, and both
outlive the policy.

The second holds no key and takes no orders: it can only stop.
"""

from __future__ import annotations

import os
import select
import signal
import socket
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from enum import StrEnum

from cpl.robot.clock import boottime
from cpl.robot.go1 import Go1Base
from cpl.robot.interfaces import ZERO, Mode, RobotError
from cpl.robot.ports import Address

__all__ = [
    "PATIENCE_S",
    "TOOK_OVER",
    "Beat",
    "Line",
    "Pulse",
    "Seen",
    "judge",
    "stand_by",
    "take_over",
]

BEAT_S = 0.01  # [s]
PATIENCE_S = 0.12  # [s] of silence before a watchdog is believed to hang
ZERO_S = 0.5  # [s] of zero velocity when the second has taken over
STAND_S = 1.0  # [s] of "stand" after it
PERSIST_S = 60.0  # [s] how long a robot that does not answer is asked
PORT_S = 5.0  # [s] how long the port may be held by somebody else who stops the robot
TOOK_OVER = 3  # exit status


class Beat:
    """What is said between watchdog and second, one byte each."""

    HERE = b"."
    IDLE = b"i"  # here, and the robot was not asked for anything yet
    LEAVING = b"l"
    END = b"e"  # please end


class Seen(StrEnum):
    """What a second makes of its watchdog."""

    WELL = "well"
    LEFT = "left"  # it let the robot stand, said so and went
    FAILED = "failed"  # it never began
    GONE = "gone"  # it died, or says nothing


@dataclass(frozen=True, kw_only=True)
class Pulse:
    """What is known of the other one.

    Args:
        heard_s: When it last said something [s]; None before it ever did.
        closed: Whether its end is closed: it is no more.
        leaving: Whether it said that it leaves.
        idle: Whether it asked the robot for nothing yet.
    """

    heard_s: float | None = None
    closed: bool = False
    leaving: bool = False
    idle: bool = True

    def after(self, said: bytes, closed: bool, now: float) -> Pulse:
        """Return what is known when this was read at a time [s]."""
        return Pulse(
            heard_s=now if said else self.heard_s,
            closed=self.closed or closed,
            leaving=self.leaving or Beat.LEAVING in said,
            idle=self.idle and Beat.HERE not in said,
        )


def judge(pulse: Pulse, now: float, patience_s: float = PATIENCE_S) -> Seen:
    """Say what has become of the other one.

    Args:
        pulse: What is known of it.
        now: The time [s].
        patience_s: How long it may be silent [s].

    >>> judge(Pulse(heard_s=1.0), 1.05).value, judge(Pulse(heard_s=1.0), 1.2).value
    ('well', 'gone')
    >>> judge(Pulse(heard_s=1.0, closed=True, leaving=True), 1.01).value
    'left'
    """
    if pulse.closed:
        if pulse.leaving:
            return Seen.LEFT
        return Seen.FAILED if pulse.heard_s is None else Seen.GONE
    if pulse.heard_s is None or now - pulse.heard_s <= patience_s:
        return Seen.WELL
    return Seen.GONE


class Line:
    """One end of the line between watchdog and second."""

    def __init__(self, end: socket.socket) -> None:
        self._end = end
        end.setblocking(False)
        self._due_s = 0.0
        self.here = Beat.HERE
        """What is said as long as all is well."""
        self.pulse = Pulse()
        """What is known of the other one."""
        self.told_to_end = False
        """Whether it asked for the end."""

    def tell(self, what: bytes) -> None:
        """Say something, if anybody is there to hear it."""
        with suppress(OSError):  # a full or a closed line: the other one hangs, or is no more
            self._end.send(what)

    def beat(self, now: float) -> None:
        """Say that one is here, if it is time to, and read what the other one said."""
        if now >= self._due_s:
            self._due_s = now + BEAT_S
            self.tell(self.here)
        self.read(now)

    def read(self, now: float) -> None:
        """Read what the other one said."""
        said, closed = b"", False
        with suppress(BlockingIOError):
            while part := self._receive():
                said += part
            closed = True
        self.pulse = self.pulse.after(said, closed, now)
        self.told_to_end = self.told_to_end or Beat.END in said

    def wait(self, seconds: float) -> None:
        """Sleep until the other one says something, at most for so long."""
        select.select([self._end], [], [], seconds)

    def _receive(self) -> bytes:
        try:
            return self._end.recv(4096)
        except ConnectionError:
            return b""  # as closed


def stand_by(line: Line, child: int, to: Address, local_port: int) -> int:
    """Watch over a watchdog until it leaves; if it cannot stop the robot, do it.

    Args:
        line: To the watchdog.
        child: Its process.
        to: The robot's address.
        local_port: Where the watchdog sends from: the robot listens to one sender at a time.

    Returns:
        The exit status: 0 if all went as it should, `TOOK_OVER`, or the watchdog's own if it never
        began.
    """
    while (seen := judge(line.pulse, boottime())) is Seen.WELL:
        line.wait(BEAT_S)
        line.beat(boottime())
    if seen is Seen.GONE:
        os.kill(child, signal.SIGKILL)  # it is our child and not yet waited for: no other process
    _, status = os.waitpid(child, 0)
    if seen is Seen.GONE and not line.pulse.idle:
        take_over(to, local_port)
        return TOOK_OVER
    return 0 if seen is Seen.LEFT else os.waitstatus_to_exitcode(status)


def take_over(
    to: Address,
    local_port: int,
    *,
    clock: Callable[[], float] = boottime,
    persist_s: float = PERSIST_S,
    port_s: float = PORT_S,
) -> bool:
    """Ask a robot for zero velocity, then to stand, until it has heard it.

    A link that is away may come back: zero is the first thing that it carries then.

    Args:
        to: The robot's address.
        local_port: The port of the watchdog that is no more.
        clock: The time [s].
        persist_s: How long to go on while nothing answers [s].
        port_s: How long to try for the port [s].

    Returns:
        Whether the robot answered.

    Raises:
        RobotError: The port is held: by a watchdog, or by somebody else who stops the robot.
    """
    base = _base(to, local_port, clock, port_s)
    begun = now = clock()
    answered_s = None
    while now - begun < persist_s:
        since = now - (begun if answered_s is None else answered_s)
        stands = answered_s is not None and since >= ZERO_S
        base.send(Mode.STAND if stands else Mode.WALK, ZERO)
        time.sleep(0.002)
        now = clock()
        if answered_s is None and base.state() is not None:
            answered_s = now
        if answered_s is not None and now - answered_s >= ZERO_S + STAND_S:
            break
    base.close()
    return answered_s is not None


def _base(to: Address, local_port: int, clock: Callable[[], float], port_s: float) -> Go1Base:
    """Take the port, which its last owner has just let go."""
    end = clock() + port_s
    while True:
        try:
            return Go1Base(to, library="wire", local_port=local_port, clock=clock)
        except ValueError as error:
            if clock() > end:
                raise RobotError(f"the robot cannot be stopped from here: {error}") from error
            time.sleep(0.002)
