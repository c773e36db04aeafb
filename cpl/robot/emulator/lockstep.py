"""As fast as the computer can: robot, camera and loop take turns, and time waits for them.

One thread, real datagrams on loopback, the vendor's SDK if it is here: what is left out is only
waiting. The watchdog, which lives by the real clock, has no place in it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable

from cpl.quadruped import World
from cpl.robot.emulator.faults import Fault, Faults
from cpl.robot.emulator.go1 import Seen
from cpl.robot.emulator.twin import Emulation
from cpl.robot.go1 import Go1Base
from cpl.robot.guard import GuardConfig
from cpl.robot.interfaces import Pose
from cpl.robot.loop import PERIOD_S, Robot
from cpl.robot.t265 import T265Localizer

__all__ = ["LockStep", "StepClock"]


class StepClock:
    """A clock that goes on when it is waited for, and a world that goes on with it.

    Args:
        step: Is called with each new tenth of a second.
    """

    def __init__(self, step: Callable[[float], None]) -> None:
        self._step, self._ticks = step, 0
        self.skew_s = 0.0
        """What the clock is off [s]: a fault, if it changes."""

    @property
    def true_s(self) -> float:
        """The world's time [s]."""
        return self._ticks * PERIOD_S

    def now(self) -> float:
        """Return the time [s]."""
        return self.true_s + self.skew_s

    def wait(self, until: float) -> None:
        """Let tenths of a second pass, at least one: as many as are missing when it is called."""
        for _ in range(max(1, round((until - self.now()) / PERIOD_S))):
            self._ticks += 1
            self._step(self.true_s)


class LockStep:
    """An emulated robot in accelerated time, with everything that `cpl.robot.drive` needs.

    Args:
        world: The twin, or one whose eyes never err.
        faults: What goes wrong; times count from here.
        library: `auto`, `sdk` or `wire`.
        config: The guard's, whose envelope the base keeps too.
        seed: Of the faults' draws.

    Attributes:
        emulation: The robot and its camera.
        clock: The time.
        robot: What the loop is given.
    """

    def __init__(
        self,
        world: World,
        faults: Iterable[Fault] = (),
        *,
        library: str = "auto",
        config: GuardConfig | None = None,
        seed: int = 0,
    ) -> None:
        self.clock = StepClock(self._step)
        localizer = T265Localizer(clock=self.clock.now)
        self.emulation = Emulation(world, localizer.address, Faults(faults, seed))
        base = Go1Base(
            self.emulation.go1.address,
            library=library,
            envelope=(config or GuardConfig()).envelope,
            clock=self.clock.now,
        )
        self.robot = Robot(
            base=base,
            localizer=localizer,
            clock=self.clock,
            odometry_is_truth=True,
            provenance=world.provenance,
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
        self.emulation.close()

    def _step(self, now: float) -> None:
        self.emulation.step(now)
