"""Where is the robot? The T265's poses and SLAM errors, as its bridge streams them over UDP.

The camera gives its own pose in its own axes from where it was switched on. The loop wants the
body's pose in the world of the path: axes are turned, the mounting is taken off, and the world is
laid so that the robot stands on the path's first waypoint when `anchor` is called.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import atan2, cos, isfinite, sin

import numpy as np
from numpy.typing import NDArray

from cpl.robot import bridge
from cpl.robot.camera_clock import CameraClock, hear
from cpl.robot.clock import boottime
from cpl.robot.interfaces import Fix, Pose, RobotError
from cpl.robot.ports import Address, drain_from, receiver
from cpl.robot.seal import new_key

__all__ = ["Mount", "T265Localizer", "camera_pose"]

Array = NDArray[np.float64]
AHEAD_S = 0.05  # [s] that a packet may seem to come from the future
# From ROS axes (x forward, y left, z up) to the camera's (x right, y up, z backward).
_TO_CAMERA = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, 1.0], [-1.0, 0.0, 0.0]])


@dataclass(frozen=True, kw_only=True)
class Mount:
    """Where the camera sits: ahead of and above the body's centre, looking ahead, level.

    Args:
        forward_m: How far ahead of the centre [m].
        up_m: How far above the floor [m]; tells nothing but z.
    """

    forward_m: float = 0.28
    up_m: float = 0.35

    def __post_init__(self) -> None:
        for name in ("forward_m", "up_m"):
            if not isfinite(getattr(self, name)):
                raise ValueError(f"{name} must be finite, not {getattr(self, name)}")


class T265Localizer:
    """Listen to the bridge, and to it alone.

    Before `anchor` any bridge with the key is heard. Then its address, its run and the camera's
    start are pinned: what counts from another origin is a fault for the rest of the run.

    Args:
        port: Of the loopback interface, where the bridge sends to; 0 for any that is free.
        mount: Where the camera sits.
        key: The bridge's; drawn unless given.
        clock: The computer's time [s].
    """

    def __init__(
        self,
        port: int = 0,
        mount: Mount | None = None,
        *,
        key: bytes | None = None,
        clock: Callable[[], float] = boottime,
    ) -> None:
        self.library = "cpl.robot.bridge"
        self.key = key or new_key()
        """What the bridge must seal its packets with."""
        self.refused = 0
        """Packets that were damaged or none of the bridge's."""
        self.late = 0
        """Packets that came twice or after a later one."""
        self._socket = receiver(port)
        self._mount, self._clock = mount or Mount(), clock
        self._last: bridge.Pose | None = None
        self._from: tuple[Address, int, int] | None = None  # sender, its run, the camera's start
        self._anchored, self._fault = False, ""
        self._times = CameraClock()
        self._number, self._changed_s, self._slam_error = -1, 0.0, 0
        self._offset: Pose = (0.0, 0.0, 0.0)

    @property
    def address(self) -> Address:
        """Where the bridge is to send to."""
        return self._socket.getsockname()

    def fix(self) -> Fix | None:
        """Return where the robot is now; None before there is a pose."""
        self._read()
        if self._last is None:
            return None
        error, self._slam_error = self._slam_error, 0
        position, turn, twist = _body(self._last, self._mount)
        position, turn = _moved(position, turn, self._offset)
        x, y, z = position.tolist()
        return Fix(
            position=(x, y, z),
            quaternion=turn,
            twist=twist,
            confidence=self._last.confidence,
            slam_error=error,
            changed_s=self._changed_s,
            fault=self._fault or (self._times.fault if self._anchored else ""),
        )

    def anchor(self, pose: Pose) -> None:
        """Let the present place be this pose of the world."""
        self._read()
        if self._last is None or self._from is None:
            raise RobotError("the camera has sent no pose yet: is the bridge running?")
        position, turn, _ = _body(self._last, self._mount)
        yaw = pose[2] - _yaw(turn)
        x = pose[0] - (cos(yaw) * position[0] - sin(yaw) * position[1])
        y = pose[1] - (sin(yaw) * position[0] + cos(yaw) * position[1])
        self._offset = (float(x), float(y), yaw)
        self._slam_error = 0
        self._anchored, self._times = True, self._times.settled()
        self._socket.connect(self._from[0])  # from now on nobody else is even heard

    def close(self) -> None:
        """Stop listening."""
        self._socket.close()

    def _read(self) -> None:
        now = self._clock()
        for data, sender in drain_from(self._socket):
            try:
                packet, stamp = bridge.decode(data, self.key)
            except bridge.CameraPacketError:
                self.refused += 1
                continue
            if stamp.sent_s > now + AHEAD_S:
                self.refused += 1  # from the future: not of this computer
            elif self._known((sender, stamp.run, stamp.start)):
                self._hear(packet, stamp)

    def _known(self, source: tuple[Address, int, int]) -> bool:
        """Whether a packet counts from the origin that is counted from; before a run, any may."""
        if source == self._from:
            return True
        if self._anchored:
            self._fault = "the camera or its bridge was started again: its origin is another one"
            return False
        self._from, self._number, self._times = source, -1, CameraClock()
        return True

    def _hear(self, packet: bridge.Pose | bridge.Warned, stamp: bridge.Stamp) -> None:
        if packet.number <= self._number:
            self.late += 1
            return
        self._number = packet.number
        if isinstance(packet, bridge.Warned):
            self._slam_error = packet.code
            return
        self._times = hear(self._times, packet.t_s, stamp.sent_s)
        before, self._last = self._last, packet
        if before is None or _numbers(before) != _numbers(packet):
            self._changed_s = self._times.taken_s


def camera_pose(
    number: int,
    t_s: float,
    position: tuple[float, float, float],
    quaternion: tuple[float, float, float, float],
    twist: tuple[float, float, float],
    confidence: int,
    mount: Mount,
) -> bridge.Pose:
    """Return what a camera on the robot would say: the inverse of what the localizer does.

    Args:
        number: The packet's number.
        t_s: The device's clock [s].
        position: Of the body's centre in the world (ROS axes) [m].
        quaternion: Body to world, x, y, z, w.
        twist: v_x [m/s], v_y [m/s], yaw rate [rad/s] in the body frame.
        confidence: The tracker's.
        mount: Where the camera sits.
    """
    to_world = _matrix(quaternion)
    camera = np.array(position) + mount.forward_m * to_world[:, 0]
    linear = to_world @ np.array([twist[0], twist[1], 0.0])
    angular = to_world @ np.array([0.0, 0.0, twist[2]])
    turned = (_TO_CAMERA @ np.array(quaternion[:3])).tolist()
    return bridge.Pose(
        number,
        t_s,
        tuple((_TO_CAMERA @ camera).tolist()),
        (*turned, quaternion[3]),
        tuple((_TO_CAMERA @ linear).tolist()),
        tuple((_TO_CAMERA @ angular).tolist()),
        confidence,
    )


def _body(
    pose: bridge.Pose, mount: Mount
) -> tuple[Array, tuple[float, float, float, float], tuple[float, float, float]]:
    """Return position, attitude and body twist of the body's centre in ROS axes."""
    x, y, z = (_TO_CAMERA.T @ np.array(pose.quaternion[:3])).tolist()
    norm = float(np.linalg.norm(pose.quaternion))
    turn = (x / norm, y / norm, z / norm, pose.quaternion[3] / norm)
    to_world = _matrix(turn)
    position = _TO_CAMERA.T @ np.array(pose.position) - mount.forward_m * to_world[:, 0]
    linear = to_world.T @ _TO_CAMERA.T @ np.array(pose.velocity)
    angular = to_world.T @ _TO_CAMERA.T @ np.array(pose.angular_velocity)
    return position, turn, (float(linear[0]), float(linear[1]), float(angular[2]))


def _moved(
    position: Array, turn: tuple[float, float, float, float], offset: Pose
) -> tuple[Array, tuple[float, float, float, float]]:
    """Turn about the vertical, then shift."""
    x, y, yaw = offset
    c, s = cos(yaw), sin(yaw)
    there = np.array(
        [c * position[0] - s * position[1] + x, s * position[0] + c * position[1] + y, position[2]]
    )
    a, b = cos(yaw / 2), sin(yaw / 2)
    q_x, q_y, q_z, q_w = turn
    return there, (
        a * q_x - b * q_y,
        a * q_y + b * q_x,
        a * q_z + b * q_w,
        a * q_w - b * q_z,
    )


def _matrix(quaternion: tuple[float, float, float, float]) -> Array:
    x, y, z, w = quaternion
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def _yaw(quaternion: tuple[float, float, float, float]) -> float:
    x, y, z, w = quaternion
    return atan2(2 * (w * z + x * y), w * w + x * x - y * y - z * z)


def _numbers(pose: bridge.Pose) -> tuple[tuple[float, ...], tuple[float, ...]]:
    return pose.position, pose.quaternion
