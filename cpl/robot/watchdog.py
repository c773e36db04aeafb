"""Who stops the robot when the policy cannot? A process of its own that holds the cable.

The policy never speaks to the robot. It sends orders to this process, ten times a second, and this
process streams commands to the robot, 500 times a second. When no order comes for `lease_s` it
streams zero velocity; `zero_s` later it lets the robot stand, and obeys no more. So whatever ends
the policy, Ctrl-C, an exception, kill -9, a hung computer program, ends in a robot that stands.

It runs on the controlling computer, or on the robot's own: there it also survives the loss of the
link between the two, which no process on the far side of that link can do anything about.

    python -m cpl.robot --robot 127.0.0.1:8082 --listen 127.0.0.1:9101 --token 7
"""

from __future__ import annotations

import argparse
import json
import signal
import socket
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cpl.robot.clock import urgent
from cpl.robot.envelope import Envelope, clamp
from cpl.robot.go1 import LIBRARIES, Go1Base
from cpl.robot.interfaces import ZERO, Base, Command, Mode, RobotError
from cpl.robot.packets import Order, PacketError, Report, decode_order, encode
from cpl.robot.ports import Address, address, drain_from, receiver
from cpl.store import atomic_write

__all__ = ["Lease", "LeaseConfig", "main"]

STREAM_S = 0.002  # [s] 500 Hz
REPORT_S = 0.010  # [s]
DESERTED_S = 30.0  # [s] how long it waits, the robot standing, for anybody
LINGER_S = 1.5  # [s] how long it streams "stand" before it leaves
NO_ANSWER = 255


@dataclass(frozen=True, kw_only=True)
class LeaseConfig:
    """How long an order holds.

    Args:
        lease_s: Without a new order for this long, zero velocity [s].
        zero_s: After so long at zero velocity, stand, for good [s].
    """

    lease_s: float = 0.2
    zero_s: float = 0.5

    def __post_init__(self) -> None:
        for name in ("lease_s", "zero_s"):
            if not 0 < getattr(self, name) < 60:
                raise ValueError(f"{name} must be in (0, 60), not {getattr(self, name)}")


class Lease:
    """What the robot may be asked for now, given when which order came.

    Args:
        config: How long an order holds.
        envelope: No larger velocity is ever asked for.

    >>> lease = Lease(LeaseConfig(lease_s=0.2, zero_s=0.5), Envelope())
    >>> lease.order(0.0, Mode.WALK, (0.5, 0.0, 0.0))
    >>> [(lease.ask(t)[0].name, lease.ask(t)[1][0]) for t in (0.1, 0.3, 0.8)]
    [('WALK', 0.5), ('WALK', 0.0), ('STAND', 0.0)]
    >>> lease.tripped
    'no order came in time'
    """

    def __init__(self, config: LeaseConfig, envelope: Envelope) -> None:
        self.tripped = ""
        """Why nothing is obeyed any more; empty while orders are."""
        self._config, self._envelope = config, envelope
        self._since_s, self._mode, self._command = float("-inf"), Mode.STAND, ZERO

    def order(self, now: float, mode: Mode, command: Command) -> None:
        """Take an order at a time [s]; after a trip there are none."""
        if not self.tripped:
            self._since_s, self._mode = now, mode
            self._command = clamp(command, self._envelope) if mode is Mode.WALK else ZERO

    def end(self, now: float, why: str) -> None:
        """Obey no more: zero velocity from now on, then stand."""
        if not self.tripped:
            self.tripped = why
            self._since_s = min(self._since_s, now - self._config.lease_s)

    def ask(self, now: float) -> tuple[Mode, Command]:
        """Return what to ask the robot for at a time [s]."""
        if self._mode is not Mode.WALK:
            return Mode.STAND, ZERO
        age = now - self._since_s
        if age >= self._config.lease_s + self._config.zero_s:
            self.tripped, self._mode = self.tripped or "no order came in time", Mode.STAND
            return Mode.STAND, ZERO
        fresh = 0 <= age < self._config.lease_s and not self.tripped
        return Mode.WALK, self._command if fresh else ZERO


def main(words: Sequence[str] | None = None) -> int:
    """Hold the cable until the policy says good-bye, or is silent for too long."""
    parser = argparse.ArgumentParser(prog="watchdog", description="Hold the cable to the robot.")
    parser.add_argument("--robot", type=address, required=True, metavar="HOST:PORT")
    parser.add_argument("--listen", type=address, required=True, metavar="HOST:PORT")
    parser.add_argument("--token", type=int, required=True, help="the session's number")
    parser.add_argument("--library", choices=LIBRARIES, default="auto")
    parser.add_argument("--local-port", type=int, default=0)
    parser.add_argument("--v-max", type=float, default=Envelope().v_max_mps)
    parser.add_argument("--yaw-max", type=float, default=Envelope().yaw_rate_max_radps)
    parser.add_argument("--stats", type=Path, help="where to write how regular the stream was")
    chosen = parser.parse_args(words)
    envelope = Envelope(v_max_mps=chosen.v_max, yaw_rate_max_radps=chosen.yaw_max)
    try:
        here = receiver(chosen.listen[1], chosen.listen[0])
        base = Go1Base(
            chosen.robot,
            library=chosen.library,
            local_port=chosen.local_port,
            envelope=envelope,
        )
    except (RobotError, ValueError, OSError) as error:
        sys.stderr.write(f"watchdog: {error}\n")
        return 1
    dog = _Watchdog(base, here, Lease(LeaseConfig(), envelope), chosen.token)
    for name in (signal.SIGTERM, signal.SIGHUP):
        signal.signal(name, lambda *_: dog.lease.end(time.monotonic(), "told to end"))
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # a terminal's Ctrl-C is for the policy
    try:
        with urgent():
            dog.run()
    finally:
        for _ in range(10):
            base.send(Mode.STAND)
        base.close()
        here.close()
    if chosen.stats is not None:
        atomic_write(chosen.stats, json.dumps(dog.stats()) + "\n")
    return 0


class _Watchdog:
    """The process: orders in, commands and reports out."""

    def __init__(self, base: Base, here: socket.socket, lease: Lease, token: int) -> None:
        self.lease = lease
        self._base, self._here, self._token = base, here, token
        self._to: Address | None = None
        self._number = self._obeyed = 0
        self._sent_s: list[float] = []
        self._leaving_s, self._heard_s = float("inf"), 0.0

    def run(self) -> None:
        """Stream until a while after the end."""
        due = report_due = self._heard_s = time.monotonic()
        while (now := time.monotonic()) < self._leaving_s:
            self._orders(now)
            self._base.send(*self.lease.ask(now))
            self._sent_s.append(now)
            if self._leaving_s == float("inf") and self._over(now):
                self._leaving_s = now + LINGER_S
            if now >= report_due:
                self._report(now)
                report_due = now + REPORT_S
            due = max(due + STREAM_S, now - 10 * STREAM_S)
            time.sleep(max(0.0, due - time.monotonic()))

    def stats(self) -> dict[str, float]:
        """Return how regular the stream was [ms]."""
        error = np.abs(np.diff(self._sent_s) - STREAM_S)
        return {
            "datagrams": len(self._sent_s),
            "rate_hz": round(1 / float(np.mean(np.diff(self._sent_s))), 1),
            "period_error_p99_ms": round(1e3 * float(np.quantile(error, 0.99)), 3),
            "period_error_max_ms": round(1e3 * float(error.max()), 3),
        }

    def _over(self, now: float) -> bool:
        """Whether it is time to leave: tripped, or nobody there."""
        return bool(self.lease.tripped) or now - self._heard_s > DESERTED_S

    def _orders(self, now: float) -> None:
        for data, sender in drain_from(self._here):
            try:
                order: Order = decode_order(data)
            except PacketError:
                continue  # not for us, or damaged: as a lost datagram
            if order.token != self._token or order.number <= self._obeyed:
                continue
            self._obeyed, self._to = order.number, sender
            self._heard_s = now
            if order.number == GOOD_BYE:
                self.lease.end(now, "told to end")
            self.lease.order(now, order.mode, order.command)

    def _report(self, now: float) -> None:
        if self._to is None:
            return
        state = self._base.state()
        self._number += 1
        report = Report(
            token=self._token,
            number=self._number,
            obeyed=min(self._obeyed, GOOD_BYE - 1),
            mode=NO_ANSWER if state is None else state.mode,
            battery=0 if state is None else state.battery,
            velocity=ZERO if state is None else state.velocity,
            odometry=ZERO if state is None else state.odometry,
            version=(0, 0) if state is None else state.version,
            age_s=1e3 if state is None else now - state.received_s,
            refused=getattr(self._base, "refused", 0),
            tripped=self.lease.tripped,
            library=self._base.library,
        )
        try:
            self._here.sendto(encode(report), self._to)
        except (BlockingIOError, ConnectionRefusedError):
            return  # a lost report; the policy may be gone


GOOD_BYE = 2**32 - 1  # number of the order after which there is none
