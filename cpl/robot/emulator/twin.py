"""Robot and camera as one: a world that walks what reaches the endpoint and shows what it sees."""

from __future__ import annotations

import socket
from dataclasses import replace
from math import cos, sin

from cpl.quadruped import Observation, World
from cpl.quadruped.kinematic import FisheyeCamera, KinematicWorld, Room, WorldConfig
from cpl.robot import bridge
from cpl.robot.emulator.faults import Faults
from cpl.robot.emulator.go1 import Endpoint
from cpl.robot.interfaces import Pose
from cpl.robot.ports import Address
from cpl.robot.t265 import Mount, camera_pose

__all__ = ["Emulation", "rehearsal_world"]

LIGHT, RICHNESS, EXPOSURE_S = 0.2, 0.35, 0.030  # the lab of the book's quadruped experiments
JUMP_M, OUTSIDE_M = 1.5, 5.0  # [m]


def rehearsal_world(room_seed: int = 0) -> KinematicWorld:
    """Return the hall in which the book's quadruped walks.

    Args:
        room_seed: Paints it.
    """
    room = Room(light=LIGHT, richness=RICHNESS)
    camera = FisheyeCamera(exposure_s=EXPOSURE_S)
    return KinematicWorld(WorldConfig(room=room, camera=camera, room_seed=room_seed))


class Emulation:
    """A Go1 with a T265 on its head, in a world.

    Args:
        world: The twin, or one whose eyes never err.
        camera_to: Where pose packets go: to the localizer, or to a bridge's software device.
        faults: What goes wrong.
        port: Of the robot's endpoint; 0 for any that is free.
        mount: Where the camera sits.
    """

    def __init__(
        self,
        world: World,
        camera_to: Address,
        faults: Faults | None = None,
        *,
        port: int = 0,
        mount: Mount | None = None,
    ) -> None:
        self.faults = faults or Faults()
        self.go1 = Endpoint(port=port, faults=self.faults)
        self._world, self._camera_to = world, camera_to
        self._mount = mount or Mount()
        self._air = self.faults.channel(camera=True)
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._number = 0
        self._now: Observation | None = None
        self._kept: Observation | None = None

    @property
    def touched(self) -> bool:
        """Whether the robot ran into a wall."""
        return self._now is not None and self._now.touched

    def place(self, pose: Pose, seed: int) -> None:
        """Carry the robot to a pose; its camera starts anew."""
        self._now = self._world.reset(pose, seed)
        self._tell()

    def step(self, now: float) -> None:
        """Walk for a tenth of a second and show what is seen then.

        Args:
            now: The time at the end of that tenth [s].
        """
        self.go1.take(now)
        self.advance(now)
        self.go1.answer(now)

    def advance(self, now: float) -> None:
        """Do what `step` does for a robot whose endpoint somebody else serves."""
        self._now = self._world.step(self.go1.drive)
        self._tell()
        self.look(now)
        if self._now.slam_error or self.faults.active("storm", now):
            self._number += 1
            code = self._now.slam_error or 2
            self._send(bridge.encode_warning(bridge.Warned(self._number, now, code)), now)

    def look(self, now: float, ahead_s: float = 0.0) -> None:
        """Send a pose.

        Args:
            now: The time [s].
            ahead_s: How long after the last picture; the pose is carried on by its twist [s].
        """
        seen = self._shown(now)
        position = tuple(
            p + ahead_s * v for p, v in zip(seen.position, _world_velocity(seen), strict=True)
        )
        self._number += 1
        packet = camera_pose(
            self._number,
            now,
            (position[0], position[1], position[2]),
            seen.quaternion,
            seen.twist,
            seen.confidence,
            self._mount,
        )
        self._send(bridge.encode_pose(packet), now)

    def close(self) -> None:
        """Let the ports go."""
        self.go1.close()
        self._socket.close()

    def _send(self, data: bytes, now: float) -> None:
        self._air.put(data, now)
        for each in self._air.take(now):
            self._socket.sendto(each, self._camera_to)

    def _tell(self) -> None:
        """Let the robot's own odometry be the truth."""
        if self._now is not None and self._now.true_pose is not None:
            self.go1.odometry, self.go1.velocity = self._now.true_pose, self._now.twist

    def _shown(self, now: float) -> Observation:
        """Return what the camera says it sees."""
        if self._now is None:
            raise ValueError("place must be called before step")
        seen = self._now
        if self.faults.active("frozen", now):
            seen = self._kept = self._kept or seen
        else:
            self._kept = None
        for fault, metres in (("jump", JUMP_M), ("outside", OUTSIDE_M)):
            if self.faults.active(fault, now):
                x, y, z = seen.position
                seen = replace(seen, position=(x + metres, y, z))
        return replace(seen, confidence=0) if self.faults.active("failed", now) else seen


def _world_velocity(seen: Observation) -> tuple[float, float, float]:
    c, s = cos(seen.yaw), sin(seen.yaw)
    v_x, v_y, _ = seen.twist
    return c * v_x - s * v_y, s * v_x + c * v_y, 0.0
