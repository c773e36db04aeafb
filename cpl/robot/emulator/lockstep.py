"""As fast as the computer can: robot, camera, watchdog and loop take turns, and time waits.

One thread, real datagrams on loopback, the vendor's SDK if it is here: what is left out is only
waiting. With a placement the watchdog takes its turns too, a hundred times a second: the very
object that its process runs. What ends processes is not for here: `cpl.robot.trials` kills real
ones.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from contextlib import ExitStack

from cpl.quadruped import World
from cpl.robot.emulator.faults import Fault, Faults
from cpl.robot.emulator.go1 import Seen
from cpl.robot.emulator.stranger import Stranger
from cpl.robot.emulator.twin import Emulation
from cpl.robot.go1 import Go1Base
from cpl.robot.guard import GuardConfig
from cpl.robot.interfaces import Base, Pose
from cpl.robot.loop import PERIOD_S, Robot
from cpl.robot.ports import Address, drain_from, free_port, receiver, send
from cpl.robot.seal import new_key
from cpl.robot.t265 import T265Localizer
from cpl.robot.watchdog import Watchdog
from cpl.robot.watched import WatchdogConfig, WatchedBase

__all__ = ["LockStep", "StepClock"]

PLACEMENTS = ("none", "laptop", "robot")
TURNS = 10  # of a watchdog in a tenth of a second


class StepClock:
    """A clock that goes on when it is waited for, and a world that goes on with it.

    Args:
        step: Is called with each new time, and with whether a tenth of a second is full.
        turns: How often in a tenth of a second.
    """

    def __init__(self, step: Callable[[float, bool], None], turns: int = 1) -> None:
        self._step, self._turns, self._ticks = step, turns, 0
        self.skew_s = 0.0
        """What the clock is off [s]: a fault, if it changes."""

    @property
    def true_s(self) -> float:
        """The world's time [s]."""
        return self._ticks * PERIOD_S / self._turns

    def now(self) -> float:
        """Return the time [s]."""
        return self.true_s + self.skew_s

    def wait(self, until: float) -> None:
        """Let tenths of a second pass, at least one: as many as are missing when it is called."""
        for _ in range(max(1, round((until - self.now()) / PERIOD_S))):
            for turn in range(self._turns):
                self._ticks += 1
                self._step(self.true_s, turn == self._turns - 1)


class LockStep:
    """An emulated robot in accelerated time, with everything that `cpl.robot.drive` needs.

    Args:
        world: The twin, or one whose eyes never err.
        faults: What goes wrong; times count from here.
        library: `auto`, `sdk` or `wire`.
        config: The guard's, whose envelope the base keeps too.
        seed: Of the faults' draws.
        placement: Where a watchdog is: `none`, `laptop` or `robot`. The cable, on which faults act,
            lies between the two computers.

    Attributes:
        emulation: The robot and its camera.
        clock: The time.
        robot: What the loop is given.
        asleep: Whether this computer is suspended: nothing on it takes a turn.
    """

    def __init__(
        self,
        world: World,
        faults: Iterable[Fault] = (),
        *,
        library: str = "auto",
        config: GuardConfig | None = None,
        seed: int = 0,
        placement: str = "none",
    ) -> None:
        if placement not in PLACEMENTS:
            raise ValueError(f"placement must be one of {', '.join(PLACEMENTS)}, not {placement!r}")
        self.asleep = False
        self._placement, self._stack = placement, ExitStack()
        self.clock = StepClock(self._step, 1 if placement == "none" else TURNS)
        localizer = T265Localizer(clock=self.clock.now)
        self.emulation = Emulation(
            world,
            localizer.address,
            Faults(faults, seed),
            key=localizer.key,
            far=placement != "robot",
            host=self.clock.now,
        )
        self._localizer = localizer
        self._watchdog: Watchdog | None = None
        self._link: _Link | None = None
        self.stranger: Stranger | None = None
        """Who has no key, where there is a watchdog."""
        self._turn = 0
        config = config or GuardConfig()
        base = (
            self._base(library, config) if placement == "none" else self._watched(library, config)
        )
        self.robot = Robot(
            base=base,
            localizer=localizer,
            clock=self.clock,
            odometry_is_truth=True,
            provenance=world.provenance,
            placement=placement,
        )

    @property
    def seen(self) -> list[Seen]:
        """Every command that the robot obeyed."""
        return self.emulation.go1.seen

    def place(self, pose: Pose, seed: int) -> None:
        """Carry the robot to a pose."""
        self.emulation.place(pose, seed)

    def close(self) -> None:
        """Let the ports go."""
        self.robot.close()
        self._stack.close()
        self.emulation.close()

    def _base(self, library: str, config: GuardConfig) -> Go1Base:
        return Go1Base(
            self.emulation.go1.address,
            library=library,
            envelope=config.envelope,
            clock=self._host_of_watchdog,
        )

    def _host_of_watchdog(self) -> float:
        """Return the time of the computer that speaks to the robot [s]."""
        return self.clock.true_s if self._placement == "robot" else self.clock.now()

    def _watched(self, library: str, config: GuardConfig) -> Base:
        there, key = receiver(free_port()), new_key()
        base = self._base(library, config)
        self._watchdog = Watchdog(base, there, key, config.envelope, clock=self._host_of_watchdog)
        faults = self.emulation.faults if self._placement == "robot" else Faults()
        self._link = _Link(there.getsockname(), faults)
        for each in (there, base, self._link):
            self._stack.callback(each.close)
        camera = self._localizer.address
        self.stranger = Stranger(self.emulation.faults, self._link.to, camera, (0.0, 0.0, 0.0))
        self._stack.callback(self.stranger.close)
        self._link.overheard = self.stranger.heard
        watched = WatchdogConfig(
            robot=self.emulation.go1.address,
            envelope=config.envelope,
            elsewhere=self._link.address,
            key=key,
        )
        return WatchedBase(watched, clock=self.clock)

    def _step(self, now: float, full: bool) -> None:
        if self._watchdog is None or self._link is None or self.stranger is None:
            self.emulation.step(now)
            return
        self._turn = 0 if full else self._turn + 1
        self.stranger.act(now)
        self._link.carry(now)
        if not (self.asleep and self._placement == "laptop"):
            self._watchdog.step()
        if full and self.emulation.placed:
            self.emulation.step(now)
            return
        self.emulation.go1.serve(now)
        if self.emulation.placed:
            self.emulation.look(now, self._turn * PERIOD_S / TURNS)


class _Link:
    """The way between policy and watchdog: the cable, where the watchdog is on the robot."""

    def __init__(self, to: Address, faults: Faults) -> None:
        self.to = to
        self.overheard: list[bytes] = []
        self._front, self._back = receiver(), receiver()
        self._there, self._return = faults.cable(), faults.cable()
        self._client: Address | None = None

    @property
    def address(self) -> Address:
        """Where the policy sends to."""
        return self._front.getsockname()

    def carry(self, now: float) -> None:
        """Carry what is there, both ways."""
        for data, sender in drain_from(self._front):
            self._client = sender
            self.overheard.append(data)
            self._there.put(data, now)
        for data in self._there.take(now):
            send(self._back, data, self.to)
        for data, _ in drain_from(self._back):
            self._return.put(data, now)
        for data in self._return.take(now):
            if self._client is not None:
                send(self._front, data, self._client)

    def close(self) -> None:
        """Let the ports go."""
        self._front.close()
        self._back.close()
