"""What a robot's eyes tell its policy, ten times a second, whichever robot it is."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, Self

__all__ = ["ForkableWorld", "Observation", "World"]


@dataclass(frozen=True, kw_only=True)
class Observation:
    """The state of things at the beginning of a policy step.

    Args:
        t_s: Time since the run began [s].
        position: Estimated position of the body in the world frame [m], x, y, z.
        quaternion: Estimated attitude, body to world, x, y, z, w, of unit length.
        yaw: Estimated heading [rad], in [-pi, pi].
        twist: Velocity in the body frame: v_x [m/s], v_y [m/s], yaw rate [rad/s].
        confidence: The tracker's, 0 failed, 1 low, 2 medium, 3 high.
        slam_error: 0 none, 1 Vision, 2 Speed, 3 Other, since the step before.
        true_pose: x [m], y [m], yaw [rad] where a twin knows it, else None.
        touched: Whether the robot has run into something (twins only).
        fell: Whether the robot lies on the floor (the legged twin only).
    """

    t_s: float
    position: tuple[float, float, float]
    quaternion: tuple[float, float, float, float]
    yaw: float
    twist: tuple[float, float, float]
    confidence: int
    slam_error: int
    true_pose: tuple[float, float, float] | None = None
    touched: bool = False
    fell: bool = False

    @property
    def pose(self) -> tuple[float, float, float]:
        """Estimated x [m], y [m], yaw [rad]."""
        return self.position[0], self.position[1], self.yaw


class World(Protocol):
    """A robot in its surroundings: a twin, an emulator or the real one."""

    provenance: str

    def reset(self, start: tuple[float, float, float], seed: int) -> Observation:
        """Begin a run at a pose and return the first observation."""
        ...

    def step(self, command: tuple[float, float, float]) -> Observation:
        """Obey a body-frame velocity for 0.1 s and return what is seen then."""
        ...


class ForkableWorld(World, Protocol):
    """A world whose future can be looked into."""

    def fork(self) -> Self:
        """Return an independent copy that would go through the same future."""
        ...
