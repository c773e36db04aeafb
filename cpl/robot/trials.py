"""How long until zero? Real processes, hurt at a drawn moment; the robot's endpoint has a clock.

One trial: a policy that orders 0.3 m/s ten times a second, a watchdog and its second, each a
process of its own, and the emulated robot's endpoint in this one. At a drawn moment something is
done to one of them. Then it counts how long velocities other than zero still reach the robot. What
is left out, to have hundreds of trials, is the world: it has no part in who stops whom.
"""

from __future__ import annotations

import os
import signal
import sys
import time
import traceback
from collections.abc import Callable
from contextlib import ExitStack, suppress
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import IO

from cpl.rng import stream
from cpl.robot import watchdog
from cpl.robot.clock import RealClock, boottime, urgent
from cpl.robot.emulator.faults import Fault, Faults
from cpl.robot.emulator.go1 import Endpoint
from cpl.robot.interfaces import ZERO, Mode
from cpl.robot.ports import LOOPBACK, Address, free_port
from cpl.robot.seal import new_key
from cpl.robot.watched import WatchdogConfig, WatchedBase, watchdog_words

__all__ = ["DEEDS", "PHASES", "PLACEMENTS", "Trial", "trial"]

DEEDS: dict[str, str] = {
    "policy_killed": "the policy is killed",
    "policy_hung": "the policy is stopped, for good",
    "policy_continued": "the policy is stopped and goes on 1 s later",
    "watchdog_killed": "the watchdog is killed",
    "watchdog_hung": "the watchdog is stopped, for good",
    "watchdog_starved": "the watchdog gets 5 ms in each 300 ms",
    "second_killed": "the watchdog's second is killed",
    "second_hung": "the watchdog's second is stopped, for good",
    "both_killed": "policy and watchdog are killed at once",
    "suspended": "all of this computer stops and goes on 1 s later",
    "link_flaps": "the cable to the robot is away for 0.4 s",
}
"""What is done to whom."""

PHASES = ("standing", "walking", "stopping")
PLACEMENTS = ("laptop", "robot")
SPEED = 0.3  # [m/s]
PERIOD_S, SERVE_S = 0.1, 0.0005  # [s]
PAUSE_S, AWAY_S = 1.0, 0.4  # [s]
STARVED_S, FED_S = 0.3, 0.005  # [s]
CALM_S = 0.7  # [s] without a velocity: the robot is at rest
WALK_S, DRAW_S = 0.3, 0.2  # [s] of walking before the fault, and the width of its moment
GIVE_UP_S = 6.0  # [s] after a fault
LEAVE_S = 8.0  # [s] for everybody to be gone
START_S = 20.0  # [s]


@dataclass(frozen=True, kw_only=True)
class Trial:
    """What one trial showed.

    Attributes:
        deed: What was done.
        phase: When.
        placement: Whose process the watchdog is: the policy's, or another computer's.
        zero_s: From the deed, or from when the link or the computer was back, until the last
            velocity that reached the robot [s]; 0 if none did.
        stand_s: From then until the robot was asked to stand [s]; NaN if never.
        fastest_mps: The largest velocity that reached the robot.
        left: How many of the processes were still there when all should have gone.
    """

    deed: str
    phase: str
    placement: str
    zero_s: float
    stand_s: float
    fastest_mps: float
    left: int


def trial(deed: str, phase: str, placement: str, seed: int) -> Trial:
    """Make one trial.

    Args:
        deed: One of `DEEDS`.
        phase: One of `PHASES`.
        placement: One of `PLACEMENTS`.
        seed: Draws the moment.

    Raises:
        RuntimeError: The processes did not come up.
    """
    rng = stream(seed, "robot", "trial", deed, phase, placement)
    with _Stage(placement) as stage, urgent(5):
        stage.walk(phase)
        stage.serve(float(rng.uniform(0, DRAW_S)))
        since = stage.do(deed)
        # After a short while without the link the run goes on: what counts is the first zero.
        zero_s, stand_s = (stage.told if deed == "link_flaps" else stage.rest)(since)
        left = stage.leave(deed)
        fastest = max((abs(each.velocity[0]) for each in stage.robot.seen), default=0.0)
    return Trial(
        deed=deed,
        phase=phase,
        placement=placement,
        zero_s=zero_s,
        stand_s=stand_s,
        fastest_mps=fastest,
        left=left,
    )


class _Forked:
    """A process that was forked: what is used of `subprocess.Popen`."""

    def __init__(self, pid: int) -> None:
        self.pid, self._status = pid, None

    def poll(self) -> int | None:
        if self._status is None:
            pid, status = os.waitpid(self.pid, os.WNOHANG)
            self._status = os.waitstatus_to_exitcode(status) if pid else None
        return self._status

    def wait(self, timeout: float | None = None) -> int:
        del timeout
        while self.poll() is None:
            time.sleep(0.002)
        return self.poll() or 0


def _fork(body: Callable[[], object]) -> int:
    """Run something in a process and a session of its own."""
    pid = os.fork()
    if pid:
        return pid
    status = 1
    try:
        os.setsid()
        result = body()
        status = result if isinstance(result, int) else 0
    except BaseException:
        traceback.print_exc()
    finally:
        os._exit(status)  # nothing of the parent's is to be tidied up here


def _launch(config: WatchdogConfig, listen: Address, stats: Path | None) -> _Forked:
    """Start watchdog and second without the second that an interpreter takes to start."""
    read, write = os.pipe()

    def body() -> int:
        os.close(write)
        with os.fdopen(read) as sys.stdin:
            return watchdog.main(watchdog_words(config, listen, stats))

    pid = _fork(body)
    os.close(read)
    with os.fdopen(write, "w") as key:
        key.write(config.key.hex() + "\n")
    return _Forked(pid)


class _Stage:
    """The processes of a trial, and the robot's endpoint."""

    def __init__(self, placement: str) -> None:
        self._placement, self._stack = placement, ExitStack()
        self._faults = Faults()
        self.robot = Endpoint(faults=self._faults)
        self._stack.callback(self.robot.close)
        self.pids: dict[str, int] = {}
        self._line: IO[str] | None = None

    def __enter__(self) -> _Stage:
        config = WatchdogConfig(
            robot=self.robot.address, library="wire", local_port=free_port(), key=new_key()
        )
        far = None
        if self._placement == "robot":
            listen = (LOOPBACK, free_port())
            far = _launch(config, listen, None)
            config = replace(config, elsewhere=listen)
        said, say = os.pipe()
        hear, tell = os.pipe()

        def body() -> None:
            for each in (said, tell):
                os.close(each)
            with os.fdopen(say, "w", buffering=1) as out:
                _policy(config, out, hear)

        self.pids["policy"] = _fork(body)
        for each in (say, hear):
            os.close(each)
        self._said, self._tell = said, tell
        os.set_blocking(said, False)
        self._stack.callback(os.close, said)
        self._stack.callback(os.close, tell)
        words = self._words()
        self.pids["watchdog"] = int(words[0])
        self.pids["second"] = far.pid if far is not None else int(words[1])
        return self

    def __exit__(self, *exception: object) -> None:
        for pid in self.pids.values():
            with suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        self._reap(1.0)
        self._stack.close()

    def walk(self, phase: str) -> None:
        """Serve until the robot is in a phase."""
        if phase == "standing":
            self.serve(0.1)
            return
        os.write(self._tell, b"w")
        self.serve(WALK_S)
        if phase == "stopping":
            os.write(self._tell, b"s")

    def serve(self, seconds: float) -> None:
        """Be the robot for so long."""
        end = boottime() + seconds
        while (now := boottime()) < end:
            self.robot.serve(now)
            time.sleep(SERVE_S)

    def do(self, deed: str) -> float:
        """Do it; return from when on one counts."""
        who, _, what = deed.partition("_")
        if deed == "link_flaps":
            now = boottime()
            self._faults.planned.append(Fault(name="cut", start_s=now, stop_s=now + AWAY_S))
            self.serve(AWAY_S)
            return now + AWAY_S
        if deed == "suspended":
            for number in (signal.SIGSTOP, signal.SIGCONT):
                for pid in self.pids.values():
                    os.kill(pid, number)
                self.serve(PAUSE_S if number == signal.SIGSTOP else 0.0)
            return boottime()
        begun = boottime()
        for whom in ("policy", "watchdog") if who == "both" else (who,):
            os.kill(self.pids[whom], signal.SIGKILL if what == "killed" else signal.SIGSTOP)
        if what == "continued":
            self.serve(PAUSE_S)
            os.kill(self.pids[who], signal.SIGCONT)
        if what == "starved":
            self._starve(self.pids[who])
        return begun

    def rest(self, since: float) -> tuple[float, float]:
        """Serve until the robot is at rest; return when it was asked for zero, and to stand."""
        end = since + GIVE_UP_S
        while boottime() < end:
            self.serve(0.05)
            moved = self._moved(since)
            stood = [each.t_s for each in self.robot.seen if each.t_s > moved and _stands(each)]
            if stood and boottime() - moved > CALM_S:
                return max(0.0, moved - since), max(0.0, stood[0] - since)
        moved = self._moved(since)
        calm = boottime() - moved > CALM_S
        return (max(0.0, moved - since) if calm else float("inf")), float("nan")

    def told(self, since: float) -> tuple[float, float]:
        """Serve until the robot was asked for zero; return when, and NaN."""
        while boottime() < since + GIVE_UP_S:
            self.serve(0.01)
            zeros = [e.t_s for e in self.robot.seen if e.t_s > since and e.velocity == ZERO]
            if zeros:
                return zeros[0] - since, float("nan")
        return float("inf"), float("nan")

    def leave(self, deed: str) -> int:
        """Let a policy that still can end its run; return how many processes do not go away."""
        with suppress(BrokenPipeError):
            os.write(self._tell, b"q")
        hung = {"policy"} if deed == "policy_hung" else set[str]()
        if hung:  # nobody is there to kill it but a person, and it holds nothing
            os.kill(self.pids["policy"], signal.SIGKILL)
        end = boottime() + LEAVE_S
        while boottime() < end and self._alive():
            self.serve(0.02)
            self._reap(0.0)
        return len(self._alive())

    def _moved(self, since: float) -> float:
        """Return when the last velocity came that the robot obeyed; `since` if none did."""
        last = self.robot.seen[-1] if self.robot.seen else None
        if last is not None and last.velocity != ZERO:
            return boottime()  # it holds until something else comes
        times = [
            after.t_s
            for before, after in pairwise(self.robot.seen)
            if before.velocity != ZERO and after.t_s > since
        ]
        return max(times, default=since)

    def _starve(self, pid: int) -> None:
        for _ in range(4):
            self.serve(STARVED_S)
            with suppress(ProcessLookupError):
                os.kill(pid, signal.SIGCONT)
                self.serve(FED_S)
                os.kill(pid, signal.SIGSTOP)

    def _alive(self) -> list[str]:
        return [name for name, pid in self.pids.items() if _state(pid) not in ("Z", "gone")]

    def _reap(self, seconds: float) -> None:
        end = boottime() + seconds
        while True:
            with suppress(ChildProcessError):
                while os.waitpid(-1, os.WNOHANG)[0]:
                    pass
            if boottime() >= end or not self._alive():
                return
            time.sleep(0.005)

    def _words(self) -> list[str]:
        """Serve until the policy has said who is who."""
        end, said = boottime() + START_S, b""
        while boottime() < end and b"\n" not in said:
            self.serve(0.01)
            with suppress(BlockingIOError):
                said += os.read(self._said, 1000)
        if b"\n" not in said:
            raise RuntimeError("the processes of a trial did not come up")
        return [word.decode() for word in said.split()]


def _policy(config: WatchdogConfig, out: IO[str], hear: int) -> None:
    """Be a policy that walks when it is told to, and until it is told otherwise."""
    os.set_blocking(hear, False)
    clock = RealClock()
    with urgent():
        base = WatchedBase(config, launch=_launch)
        out.write(f"{base.pid} {base.second or 0}\n")
        due, mode, told = clock.now(), Mode.STAND, b""
        while not (b"s" in told or b"q" in told):
            with suppress(BlockingIOError):
                told = os.read(hear, 10)
            mode = Mode.WALK if b"w" in told else mode
            state = base.state()
            if state is not None and state.tripped:
                break
            base.send(mode, (SPEED, 0.0, 0.0) if mode is Mode.WALK and state else ZERO)
            due += PERIOD_S
            clock.wait(due)
        for mode, times in ((Mode.WALK, 3), (Mode.STAND, 2)):
            for _ in range(times):
                base.send(mode, ZERO)
                due += PERIOD_S
                clock.wait(due)
        base.close()


def _stands(seen: object) -> bool:
    return getattr(seen, "mode", None) == Mode.STAND


def _state(pid: int) -> str:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
    except (FileNotFoundError, ProcessLookupError):
        return "gone"
