"""What is a robot to the loop? A base that takes velocities and a localizer that says where it is.

Every backend is one of each: the twin in lock-step, a recorded log, the Go1 through its vendor's
SDK, the T265 through its bridge. Times are those of the controlling computer's clock, which goes
on in suspend.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import Protocol

__all__ = ["ZERO", "Base", "BaseState", "Command", "Fix", "Localizer", "Mode", "Pose", "RobotError"]

Command = tuple[float, float, float]
Pose = tuple[float, float, float]

ZERO: Command = (0.0, 0.0, 0.0)


class RobotError(RuntimeError):
    """Something outside this program is not as it must be; the message says what to do."""


class Mode(IntEnum):
    """High-level modes of the Go1 that are used here."""

    IDLE = 0
    STAND = 1
    WALK = 2  # at a velocity in the body frame
    DOWN = 5
    UP = 6
    DAMPED = 7  # motors give way: the remote's emergency stop
    RECOVER = 8


@dataclass(frozen=True, kw_only=True)
class BaseState:
    """What the robot last said of itself.

    Args:
        mode: Its mode, as in `Mode` where that knows it.
        battery: State of charge [%].
        velocity: v_x [m/s], v_y [m/s], yaw rate [rad/s] in the body frame, by its own odometry.
        odometry: x [m], y [m], yaw [rad] by its own odometry, which drifts. An emulator reports
            the truth here.
        version: Version numbers of hardware and software.
        received_s: When this came [s].
        tripped: Why the watchdog no longer obeys; empty while it does.
    """

    mode: int
    battery: int
    velocity: Command
    odometry: Pose
    version: tuple[int, int]
    received_s: float
    tripped: str = ""


@dataclass(frozen=True, kw_only=True)
class Fix:
    """Where the robot believes to be.

    Args:
        position: Of the body's centre in the world frame [m].
        quaternion: Body to world, x, y, z, w.
        twist: v_x [m/s], v_y [m/s], yaw rate [rad/s] in the body frame.
        confidence: The tracker's, 0 failed .. 3 high.
        slam_error: 0 none, 1 Vision, 2 Speed, 3 Other: the last since the fix before was taken.
        changed_s: When the pose that last changed was taken [s]; neither a frozen stream nor a late
            one makes a pose fresh.
        fault: Why no pose of this camera counts any more in this run; empty while they do.
    """

    position: tuple[float, float, float]
    quaternion: tuple[float, float, float, float]
    twist: Command
    confidence: int
    slam_error: int
    changed_s: float
    fault: str = ""


class Base(Protocol):
    """Legs."""

    library: str
    """What speaks to the robot, with its version."""

    def send(self, mode: Mode, command: Command = ZERO) -> None:
        """Ask for a mode and, in `Mode.WALK`, for a velocity in the body frame."""
        ...

    def state(self) -> BaseState | None:
        """Return the newest state; None before there is one."""
        ...

    def close(self) -> None:
        """Let go. Closing twice is allowed."""
        ...


class Localizer(Protocol):
    """Eyes."""

    library: str
    """What speaks to the camera, with its version."""

    def fix(self) -> Fix | None:
        """Return where the robot is now; None before there is a pose."""
        ...

    def anchor(self, pose: Pose) -> None:
        """Let the present place be this pose: x [m], y [m], yaw [rad] of the world frame.

        Raises:
            RobotError: There is no pose yet.
        """
        ...

    def close(self) -> None:
        """Let go. Closing twice is allowed."""
        ...
