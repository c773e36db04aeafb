"""Robot and camera as one: a world that walks what reaches the endpoint and shows what it sees."""

from __future__ import annotations

import socket
from collections.abc import Callable
from dataclasses import replace
from math import cos, nan, sin

from cpl.quadruped import Observation, World
from cpl.quadruped.kinematic import FisheyeCamera, KinematicWorld, Room, WorldConfig
from cpl.robot import bridge
from cpl.robot.clock import boottime
from cpl.robot.emulator.faults import Faults
from cpl.robot.emulator.go1 import Endpoint
from cpl.robot.interfaces import Pose
from cpl.robot.ports import Address, send
from cpl.robot.t265 import Mount, camera_pose

__all__ = ["Emulation", "rehearsal_world"]

LIGHT, RICHNESS, EXPOSURE_S = 0.2, 0.35, 0.030  # the lab of the book's quadruped experiments
JUMP_M, OUTSIDE_M = 1.5, 5.0  # [m]
FAST, SET_S = 0.1, 2.0  # [s/s], [s] of a camera's clock that is fast, or was set
BOOTED_S = 1000.0  # [s] on the camera's clock when the emulation begins
RUN = 1  # the emulated bridge's number


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
        key: What the camera's packets are sealed with.
        port: Of the robot's endpoint; 0 for any that is free.
        far: Whether the cable lies before the robot's endpoint.
        mount: Where the camera sits.
        host: The computer's time, which the bridge stamps packets with [s].
    """

    def __init__(
        self,
        world: World,
        camera_to: Address,
        faults: Faults | None = None,
        *,
        key: bytes,
        port: int = 0,
        far: bool = True,
        mount: Mount | None = None,
        host: Callable[[], float] = boottime,
    ) -> None:
        self.faults = faults or Faults()
        self.go1 = Endpoint(port=port, faults=self.faults, far=far)
        self._key, self._host, self._start = key, host, 1
        self._world, self._camera_to = world, camera_to
        self._mount = mount or Mount()
        self._queue, self._air = self.faults.queue(), self.faults.camera()
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._number = 0
        self._now: Observation | None = None
        self._kept: Observation | None = None
        self._origin: Pose | None = None  # of a camera that was plugged in again

    @property
    def placed(self) -> bool:
        """Whether the robot stands anywhere."""
        return self._now is not None

    @property
    def true_place(self) -> tuple[float, float]:
        """Where the robot really is: x [m], y [m]; NaN before it stands anywhere."""
        pose = None if self._now is None else self._now.true_pose
        return (nan, nan) if pose is None else (pose[0], pose[1])

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
            self._send(bridge.Warned(self._number, self._device_s(now), code), now)

    def look(self, now: float, ahead_s: float = 0.0) -> None:
        """Send a pose.

        Args:
            now: The time [s].
            ahead_s: How long after the last picture; the pose is carried on by its twist [s].
        """
        seen = self._shown(now)
        ahead_s = 0.0 if self.faults.active("frozen", now) else ahead_s
        position = tuple(
            p + ahead_s * v for p, v in zip(seen.position, _world_velocity(seen), strict=True)
        )
        self._number += 1
        packet = camera_pose(
            self._number,
            self._device_s(now),
            (position[0], position[1], position[2]),
            seen.quaternion,
            seen.twist,
            seen.confidence,
            self._mount,
        )
        self._send(packet, now)

    def close(self) -> None:
        """Let the ports go."""
        self.go1.close()
        self._socket.close()

    def _send(self, packet: bridge.Pose | bridge.Warned, now: float) -> None:
        """Let the bridge have it, sooner or later, and the localizer what the bridge says."""
        self._queue.put(packet, now)
        for each in self._queue.take(now):
            stamp = bridge.Stamp(RUN, self._start, self._host())
            self._air.put(bridge.encode(each, stamp, self._key), now)
        for data in self._air.take(now):
            send(self._socket, data, self._camera_to)

    def _device_s(self, now: float) -> float:
        """Return the camera's own time [s]."""
        fast_s = FAST * (self.faults.since("camera_fast", now) or 0.0)
        return self._host() + BOOTED_S + fast_s + SET_S * self.faults.active("camera_set", now)

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
        seen = self._counted(seen, now)
        return replace(seen, confidence=0) if self.faults.active("failed", now) else seen

    def _counted(self, seen: Observation, now: float) -> Observation:
        """Count from where the camera was plugged in again, if it was."""
        said = self.faults.begun("camera_replugged", now)
        if not (said or self.faults.begun("camera_moved", now)):
            return seen
        if self._origin is None:
            self._origin = (*seen.position[:2], seen.yaw)
            self._start += said
        x0, y0, yaw0 = self._origin
        x, y, z = seen.position
        c, s = cos(yaw0), sin(yaw0)
        position = (c * (x - x0) + s * (y - y0), c * (y - y0) - s * (x - x0), z)
        turn = _turned(seen.quaternion, -yaw0)
        return replace(seen, position=position, quaternion=turn, yaw=seen.yaw - yaw0)


def _world_velocity(seen: Observation) -> tuple[float, float, float]:
    c, s = cos(seen.yaw), sin(seen.yaw)
    v_x, v_y, _ = seen.twist
    return c * v_x - s * v_y, s * v_x + c * v_y, 0.0


Quaternion = tuple[float, float, float, float]


def _turned(quaternion: Quaternion, yaw: float) -> Quaternion:
    """Turn about the vertical."""
    x, y, z, w = quaternion
    a, b = cos(yaw / 2), sin(yaw / 2)
    return a * x - b * y, a * y + b * x, a * z + b * w, a * w - b * z
