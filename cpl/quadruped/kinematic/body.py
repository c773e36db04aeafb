"""How does the robot move, and what does its IMU feel?

A first-order response to body-frame velocity commands, and on top of it the gait: the head bounces,
rolls and pitches at the stride frequency, more so the faster the robot goes, and every stride is a
little different. The camera is bolted to the head.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numba import njit
from numpy.typing import NDArray

from cpl.settings.ranges import Positive, Settings, interval

__all__ = ["GRAVITY", "Body", "feel", "walk"]

GRAVITY = 9.81  # [m/s2]
SUBSTEPS = 24  # a policy step of 0.1 s
DT = 0.1 / SUBSTEPS  # [s] 240 Hz, the rate of the IMU
STATE = 12  # x, y, yaw, v_x, v_y, yaw rate, phase, slip x, slip y, slip yaw, jolt roll, jolt pitch


@dataclass(frozen=True, kw_only=True)
class Body(Settings):
    """The robot's response, gait and mounting.

    Args:
        lag_s: Time constant of the linear velocity [s].
        yaw_lag_s: Time constant of the yaw rate [s].
        stride_hz: Stride frequency when it starts to walk [Hz].
        stride_hz_per_mps: How much faster it strides per m/s [1/m].
        turn_m: One rad/s of turning shakes the head like this many m/s of walking [m].
        bounce_m: Amplitude of the vertical bounce per m/s [s].
        sway_m: Amplitude of the sideways sway per m/s [s].
        roll_rad: Amplitude of the roll per m/s [rad s/m].
        pitch_rad: Amplitude of the pitch per m/s [rad s/m].
        jolt_rad: Standard deviation of the irregular roll and pitch per m/s [rad s/m].
        slip: Standard deviation of the share of the velocity that is not followed [-].
        camera_height_m: Height of the camera [m].
        camera_forward_m: How far the camera sits ahead of the body's centre [m].
    """

    lag_s: Positive = 0.20
    yaw_lag_s: Positive = 0.15
    stride_hz: Annotated[float, interval("[0, inf)")] = 1.6
    stride_hz_per_mps: Annotated[float, interval("[0, inf)")] = 1.0
    turn_m: Annotated[float, interval("[0, inf)")] = 0.25
    bounce_m: Annotated[float, interval("[0, inf)")] = 0.008
    sway_m: Annotated[float, interval("[0, inf)")] = 0.010
    roll_rad: Annotated[float, interval("[0, inf)")] = 0.065
    pitch_rad: Annotated[float, interval("[0, inf)")] = 0.090
    jolt_rad: Annotated[float, interval("[0, inf)")] = 0.020
    slip: Annotated[float, interval("[0, inf)")] = 0.05
    camera_height_m: Positive = 0.35
    camera_forward_m: Annotated[float, interval("[0, inf)")] = 0.28

    @property
    def vector(self) -> NDArray[np.float64]:
        """The parameters in their order, as the kernel takes them, shape (13,)."""
        return np.array([getattr(self, name) for name in self.__dataclass_fields__])


@njit(cache=True)
def walk(state, command, body, reach, noise, poses):  # noqa: ANN001, ANN201
    """Move for one policy step and write the camera's pose after each substep.

    Args:
        state: The 12 numbers of the body, changed in place; zero but for x, y, yaw at the start.
        command: v_x [m/s], v_y [m/s], yaw rate [rad/s].
        body: `Body.vector`.
        reach: |x| and |y| at which the robot runs into a wall [m], (2,).
        noise: Standard normal draws, (24, 5).
        poses: Camera position and rotation (row-major, camera to world), written, (24, 12).

    Returns:
        Whether a wall was touched.
    """
    lag, yaw_lag, stride, stride_per, turn = body[0], body[1], body[2], body[3], body[4]
    bounce, sway, roll_a, pitch_a, jolt, slip = body[5:11]
    height, forward = body[11], body[12]
    touched = False
    for k in range(poses.shape[0]):
        # Slip and jolt are Ornstein-Uhlenbeck processes (1 s and 0.05 s) of unit variance.
        for i in range(3):
            state[7 + i] += -state[7 + i] * DT + np.sqrt(2 * DT) * noise[k, i]
        for i in range(2):
            state[10 + i] += -state[10 + i] * DT / 0.05 + np.sqrt(2 * DT / 0.05) * noise[k, 3 + i]
        for i in range(3):
            wanted = command[i] * (1 + slip * state[7 + i])
            state[3 + i] += (wanted - state[3 + i]) * DT / (yaw_lag if i == 2 else lag)
        c, s = np.cos(state[2]), np.sin(state[2])
        state[0] += (c * state[3] - s * state[4]) * DT
        state[1] += (s * state[3] + c * state[4]) * DT
        state[2] += state[5] * DT
        for i in range(2):
            if abs(state[i]) > reach[i]:
                state[i] = np.sign(state[i]) * reach[i]
                touched = True
        pace = np.hypot(state[3], state[4]) + turn * abs(state[5])
        state[6] += 2 * np.pi * (stride + stride_per * pace) * DT
        phase = state[6]
        # Below 0.1 m/s the gait fades: a standing robot does not shake.
        shake = pace * min(1.0, pace / 0.1)
        roll = shake * (roll_a * np.sin(phase) + jolt * state[10])
        pitch = shake * (pitch_a * np.sin(2 * phase + 0.7) + jolt * state[11])
        side = shake * sway * np.sin(phase + 0.4)
        c, s = np.cos(state[2]), np.sin(state[2])
        cr, sr, cp, sp = np.cos(roll), np.sin(roll), np.cos(pitch), np.sin(pitch)
        # Body to world: Rz(yaw) Ry(pitch) Rx(roll); the camera looks along the body's x.
        r00, r01, r02 = c * cp, c * sp * sr - s * cr, c * sp * cr + s * sr
        r10, r11, r12 = s * cp, s * sp * sr + c * cr, s * sp * cr - c * sr
        r20, r21, r22 = -sp, cp * sr, cp * cr
        poses[k, 0] = state[0] + forward * r00 - s * side
        poses[k, 1] = state[1] + forward * r10 + c * side
        poses[k, 2] = height + shake * bounce * np.sin(2 * phase) + forward * r20
        # Camera axes: x = -body y, y = -body z, z = body x.
        poses[k, 3], poses[k, 4], poses[k, 5] = -r01, -r02, r00
        poses[k, 6], poses[k, 7], poses[k, 8] = -r11, -r12, r10
        poses[k, 9], poses[k, 10], poses[k, 11] = -r21, -r22, r20
    return touched


@njit(cache=True)
def feel(before, poses, bias, noise, gyro_sigma, accel_sigma, gyro, accel):  # noqa: ANN001, ANN201
    """Write what the IMU in the camera reads over each substep.

    Args:
        before: The two camera poses before `poses`, (2, 12).
        poses: Camera poses, (n, 12).
        bias: Gyro [rad/s] and accelerometer [m/s2] biases, (6,).
        noise: Standard normal draws, (n, 6).
        gyro_sigma: Noise of a gyro reading [rad/s].
        accel_sigma: Noise of an accelerometer reading [m/s2].
        gyro: Angular velocity in camera axes [rad/s], written, (n, 3).
        accel: Specific force in camera axes [m/s2], written, (n, 3).
    """
    for k in range(poses.shape[0]):
        one = poses[k - 1] if k >= 1 else before[1]
        two = poses[k - 2] if k >= 2 else before[k]
        now = poses[k]
        # The angle of the rotation one^T now, small: its antisymmetric part.
        for i in range(3):
            a, b = (i + 1) % 3, (i + 2) % 3
            dot_ba, dot_ab = 0.0, 0.0
            for j in range(3):
                dot_ba += one[3 + 3 * j + b] * now[3 + 3 * j + a]
                dot_ab += one[3 + 3 * j + a] * now[3 + 3 * j + b]
            gyro[k, i] = 0.5 * (dot_ba - dot_ab) / DT + bias[i] + gyro_sigma * noise[k, i]
        for i in range(3):
            force = 0.0
            for j in range(3):
                world = (now[j] - 2 * one[j] + two[j]) / (DT * DT)
                if j == 2:
                    world += GRAVITY
                force += one[3 + 3 * j + i] * world
            accel[k, i] = force + bias[3 + i] + accel_sigma * noise[k, 3 + i]
