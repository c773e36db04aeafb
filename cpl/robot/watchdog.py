"""Who stops the robot when the policy cannot? A process of its own that holds the cable.

The policy never speaks to the robot. It sends orders to this process, ten times a second, and this
process streams commands to the robot, 500 times a second. How long an order holds is decided in
:mod:`cpl.robot.lease`. So whatever ends the policy, Ctrl-C, an exception, kill -9, a hung program,
a suspended computer, ends in a robot that stands. What ends the watchdog itself is the business of
its :mod:`cpl.robot.second`, which starts it.

It runs on the controlling computer, or on the robot's own: there it also survives the loss of the
link between the two, which no process on the far side of that link can do anything about.

    python -m cpl.robot --robot 127.0.0.1:8082 --listen 127.0.0.1:9101 --key-file run.key

Without `--key-file` the key is the first line of standard input.
"""

from __future__ import annotations

import argparse
import json
import os
import secrets
import signal
import socket
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cpl.robot.clock import boottime, urgent
from cpl.robot.envelope import Envelope
from cpl.robot.go1 import LIBRARIES, Go1Base
from cpl.robot.interfaces import ZERO, Base, Mode, RobotError
from cpl.robot.lease import LeaseConfig, LeaseState, ask, end, take
from cpl.robot.packets import Order, PacketError, Report, decode_order, encode
from cpl.robot.ports import Address, address, drain_from, free_port, receiver, send
from cpl.robot.seal import key_of_file, key_of_stream
from cpl.robot.second import Beat, Line, Seen, judge, stand_by
from cpl.store import atomic_write

__all__ = ["NO_ANSWER", "Watchdog", "main"]

STREAM_S = 0.002  # [s] 500 Hz
REPORT_S = 0.010  # [s]
DESERTED_S = 5.0  # [s] how long it waits, the robot standing, for a policy that fell silent
UNMET_S, UNMET_APART_S = 60.0, 600.0  # [s] and for one that never came; here, and elsewhere
LINGER_S = 1.5  # [s] how long it streams "stand" before it leaves
PERSIST_S = 60.0  # [s] how much longer, for a robot that does not answer: the link may come back
PATIENCE_S = 0.25  # [s] of silence before its second is believed to hang
NO_ANSWER = 255


class Watchdog:
    """Orders in, commands and reports out; one run, then no more.

    Args:
        base: The robot.
        here: Where orders come in.
        key: The run's.
        envelope: What no command leaves.
        config: How long an order holds.
        clock: The time [s].
        unmet_s: How long to wait for a policy [s].
    """

    def __init__(
        self,
        base: Base,
        here: socket.socket,
        key: bytes,
        envelope: Envelope | None = None,
        *,
        config: LeaseConfig | None = None,
        clock: Callable[[], float] = boottime,
        unmet_s: float = UNMET_S,
    ) -> None:
        self.lease = LeaseState()
        """What is remembered of orders."""
        self.refused = 0
        """Datagrams that were no order of this run."""
        self._base, self._here, self._key = base, here, key
        self._envelope, self._config = envelope or Envelope(), config or LeaseConfig()
        self._clock, self._run = clock, secrets.randbits(63) + 1
        self._unmet_s = unmet_s
        self._policy: tuple[Address, int] | None = None  # address and number of whom we obey
        self._number, self._report_due, self._heard_s = 0, 0.0, clock()
        self._leaving_s, self._walked = float("inf"), False

    def step(self) -> bool:
        """Take what came, ask the robot for what is due; say whether to go on."""
        now = self._clock()
        self._orders(now)
        state = self._base.state()
        answered_s = float("-inf") if state is None else state.received_s
        self.lease, mode, command = ask(self.lease, now, answered_s, self._config)
        self._base.send(mode, command)
        if self._leaving_s == float("inf") and self._over(now):
            self._leaving_s = now + LINGER_S
        if now >= self._report_due and self._policy is not None:
            self._report_due = now + REPORT_S
            self._tell(*self._policy, now)
        self._walked = self._walked or command != ZERO
        unheard = self._walked and now - answered_s > self._config.answer_s
        return now < self._leaving_s + PERSIST_S * unheard

    def end(self, why: str) -> None:
        """Obey no more."""
        self.lease = end(self.lease, self._clock(), why)

    def _over(self, now: float) -> bool:
        """Whether it is time to leave: tripped, or nobody there."""
        patience_s = self._unmet_s if self._policy is None else DESERTED_S
        return bool(self.lease.tripped) or now - self._heard_s > patience_s

    def _orders(self, now: float) -> None:
        for data, sender in drain_from(self._here):
            try:
                order = decode_order(data, self._key)
            except PacketError:
                self.refused += 1  # not for us, or damaged: as a lost datagram
                continue
            if order.run != self._run:  # a greeting, or one of an earlier run
                self._greeted(order, sender, now)
            elif self._policy is None or self._policy == (sender, order.hello):
                self._take(order, sender, now)
            else:
                self.refused += 1

    def _greeted(self, order: Order, sender: Address, now: float) -> None:
        """Tell the run's number to whoever has the key, until one policy is obeyed."""
        if order.run == 0 and self._policy is None:
            self._tell(sender, order.hello, now)
        else:
            self.refused += 1

    def _take(self, order: Order, sender: Address, now: float) -> None:
        if self._policy is None:
            self._policy = (sender, order.hello)
            self._here.connect(sender)  # from now on nobody else is even heard
        self._heard_s = now
        self.lease = take(self.lease, order, now, self._config, self._envelope)

    def _tell(self, to: Address, hello: int, now: float) -> None:
        state = self._base.state()
        self._number += 1
        report = Report(
            run=self._run,
            hello=hello,
            number=self._number,
            sent_s=now,
            obeyed=self.lease.number,
            pid=os.getpid(),
            refused=getattr(self._base, "refused", 0),
            mode=NO_ANSWER if state is None else state.mode,
            battery=0 if state is None else state.battery,
            velocity=ZERO if state is None else state.velocity,
            odometry=ZERO if state is None else state.odometry,
            version=(0, 0) if state is None else state.version,
            age_s=1e3 if state is None else now - state.received_s,
            unsent=getattr(self._base, "unsent", 0) % 2**32,
            tripped=self.lease.tripped,
            library=self._base.library,
        )
        connected = self._policy is not None
        send(self._here, encode(report, self._key), None if connected else to)


def main(words: Sequence[str] | None = None) -> int:
    """Hold the cable until the policy says good-bye, or is silent for too long."""
    chosen = _chosen(words)
    if chosen.local_port == 0:
        chosen.local_port = free_port()  # the second must know it too
    ours, theirs = socket.socketpair()
    sys.stderr.flush()
    child = os.fork()
    if child == 0:
        ours.close()
        os._exit(_watch(chosen, Line(theirs)))
    theirs.close()
    line = Line(ours)
    for name in (signal.SIGTERM, signal.SIGHUP):
        signal.signal(name, lambda *_: line.tell(Beat.END))
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # a terminal's Ctrl-C is for the policy
    try:
        with urgent():
            return stand_by(line, child, chosen.robot, chosen.local_port)
    except RobotError as error:
        sys.stderr.write(f"watchdog's second: {error}\n")
        return 1


def _chosen(words: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="watchdog", description="Hold the cable to the robot.")
    parser.add_argument("--robot", type=address, required=True, metavar="HOST:PORT")
    parser.add_argument("--listen", type=address, required=True, metavar="HOST:PORT")
    parser.add_argument(
        "--key-file", type=Path, metavar="FILE", help="the run's key, mode 600 (default: stdin)"
    )
    parser.add_argument("--library", choices=LIBRARIES, default="auto")
    parser.add_argument("--local-port", type=int, default=0)
    parser.add_argument("--v-max", type=float, default=Envelope().v_max_mps)
    parser.add_argument("--yaw-max", type=float, default=Envelope().yaw_rate_max_radps)
    parser.add_argument("--stats", type=Path, help="where to write how regular the stream was")
    return parser.parse_args(words)


@dataclass
class _Stream:
    """When commands were sent."""

    sent_s: list[float]

    def stats(self) -> dict[str, float]:
        """Return how regular the stream was [ms]."""
        periods = np.diff(self.sent_s)
        error = np.abs(periods - STREAM_S)
        return {
            "datagrams": len(self.sent_s),
            "rate_hz": round(1 / float(np.mean(periods)), 1),
            "period_error_p99_ms": round(1e3 * float(np.quantile(error, 0.99)), 3),
            "period_error_max_ms": round(1e3 * float(error.max()), 3),
        }


def _watch(chosen: argparse.Namespace, line: Line) -> int:
    """Be the watchdog; return its exit status."""
    parent = os.getppid()
    try:
        envelope = Envelope(v_max_mps=chosen.v_max, yaw_rate_max_radps=chosen.yaw_max)
        key = key_of_file(chosen.key_file) if chosen.key_file else key_of_stream(sys.stdin.buffer)
        here = receiver(chosen.listen[1], chosen.listen[0])
        base = Go1Base(
            chosen.robot, library=chosen.library, local_port=chosen.local_port, envelope=envelope
        )
    except (RobotError, ValueError, OSError) as error:
        sys.stderr.write(f"watchdog: {error}\n")
        sys.stderr.flush()
        return 1
    unmet_s = UNMET_APART_S if chosen.key_file else UNMET_S
    dog = Watchdog(base, here, key, envelope, unmet_s=unmet_s)
    for name in (signal.SIGTERM, signal.SIGHUP):
        signal.signal(name, lambda *_: dog.end("told to end"))
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    stream = _Stream([])
    with urgent():
        due = time.monotonic()
        line.here = Beat.IDLE
        while dog.step():
            now = time.monotonic()
            stream.sent_s.append(now)
            line.here = Beat.IDLE if dog.lease.mode is Mode.IDLE else Beat.HERE
            _listen(line, dog)
            due = max(due + STREAM_S, now - 10 * STREAM_S)
            time.sleep(max(0.0, due - time.monotonic()))
    line.tell(Beat.LEAVING)
    if judge(line.pulse, boottime(), PATIENCE_S) is Seen.GONE and os.getppid() == parent:
        os.kill(parent, signal.SIGKILL)  # it hangs: nothing is left behind
    base.close()
    here.close()
    if chosen.stats is not None:
        atomic_write(chosen.stats, json.dumps(stream.stats()) + "\n")
    return 0


def _listen(line: Line, dog: Watchdog) -> None:
    """Hear what the second says, and that it is there."""
    line.beat(boottime())
    if line.told_to_end:
        dog.end("told to end")
    if judge(line.pulse, boottime(), PATIENCE_S) in (Seen.GONE, Seen.FAILED):
        dog.end("its second is gone")
