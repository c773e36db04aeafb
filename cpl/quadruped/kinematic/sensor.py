"""What both twins share between a body and its odometry: exposure, noise, stereo, observation.

The kinematic twin renders its hall itself, the legged one has MuJoCo render it; from a mean
reflectance to what the policy is told they are one robot.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from cpl.quadruped.kinematic.body import DT
from cpl.quadruped.kinematic.camera import FisheyeCamera
from cpl.quadruped.kinematic.odometry import Odometry
from cpl.quadruped.kinematic.render import cast_depth
from cpl.quadruped.kinematic.room import Room, textures
from cpl.quadruped.observation import Observation
from cpl.rng import stream

__all__ = ["POOL", "ImuConfig", "noise_pool", "observation", "painted", "stereo", "sub_exposures"]

BLUR_PX = 1.0  # [px] of motion that one sub-exposure may cover
MAX_SUB_EXPOSURES = 6
POOL = 2**18  # standard normal draws for the sensor, used again and again from a drawn place


@dataclass(frozen=True, kw_only=True)
class ImuConfig:
    """The inertial sensor (of the T265's kind) and the stereo pair.

    Args:
        gyro_radps: Noise of a gyro reading at 240 Hz [rad/s].
        accel_mps2: Noise of an accelerometer reading at 240 Hz [m/s2].
        gyro_bias_radps: Standard deviation of the gyro's constant bias [rad/s].
        accel_bias_mps2: Standard deviation of the accelerometer's constant bias [m/s2].
        inverse_depth: Noise of stereo [1/m]: 0.3 px of disparity at 284 px and a 64 mm baseline.
    """

    gyro_radps: float = 0.004
    accel_mps2: float = 0.05
    gyro_bias_radps: float = 0.002
    accel_bias_mps2: float = 0.03
    inverse_depth: float = 0.0165

    @property
    def bias_sigma(self) -> NDArray[np.float64]:
        """Standard deviations of the constant biases, gyro then accelerometer, shape (6,)."""
        return np.repeat([self.gyro_bias_radps, self.accel_bias_mps2], 3)


def sub_exposures(
    camera: FisheyeCamera, poses: NDArray[np.float64], blur_px: float = BLUR_PX
) -> NDArray[np.float64]:
    """Return the poses whose pictures are summed to one that ends with the last of the poses.

    Args:
        camera: Whose exposure it is.
        poses: Camera position and rotation (row-major, camera to world) at 240 Hz, (n, 12).
        blur_px: Motion that one of them may cover [px].

    Returns:
        Two to six poses, spread over the exposure, the more the farther the picture moves.
    """
    n = max(1, round(camera.exposure_s / DT))
    first, last = poses[-1 - n, 3:].reshape(3, 3), poses[-1, 3:].reshape(3, 3)
    moved_px = camera.focal_px * np.linalg.norm(first - last) / np.sqrt(2)
    subs = int(np.clip(np.ceil(moved_px / blur_px), 2, MAX_SUB_EXPOSURES))
    at = len(poses) - 1 - camera.exposure_s / DT * (np.arange(subs) + 0.5) / subs
    low = at.astype(int)
    share = (at - low)[:, None]
    return poses[low] * (1 - share) + poses[low + 1] * share


def stereo(
    box: NDArray[np.float64],
    pose: NDArray[np.float64],
    rays: NDArray[np.float64],
    imu: ImuConfig,
    rng: np.random.Generator,
) -> NDArray[np.float64]:
    """Return what a stereo pair measures along rays: true distances with disparity noise [m].

    Args:
        box: `Room.box`.
        pose: Camera position and rotation (row-major, camera to world), (12,).
        rays: Unit rays in camera axes, (N, 3).
        imu: How noisy.
        rng: Draws the noise.
    """
    inverse = 1.0 / cast_depth(box, pose, rays)
    inverse += imu.inverse_depth * rng.standard_normal(len(rays))
    return 1.0 / np.maximum(inverse, 0.05)


def observation(
    odometry: Odometry,
    mount: tuple[float, float],
    t_s: float,
    code: int,
    true_pose: tuple[float, float, float],
    *,
    touched: bool,
    fell: bool = False,
) -> Observation:
    """Return what the policy is told: the odometry's pose, carried from the camera to the body.

    Args:
        odometry: The estimator.
        mount: How far the camera sits ahead of the body's centre and above the place whose height
            is told [m].
        t_s: Time since the run began [s].
        code: SLAM error since the observation before.
        true_pose: x [m], y [m], yaw [rad].
        touched: Whether the robot has run into something.
        fell: Whether it lies on the floor.
    """
    axes = odometry.rotation
    # The camera looks along the body's x.
    ahead, left, up = axes[:, 2], -axes[:, 0], -axes[:, 1]
    position = odometry.position - mount[0] * ahead - mount[1] * up
    return Observation(
        t_s=t_s,
        position=tuple(position.tolist()),
        quaternion=_quaternion(np.column_stack([ahead, left, up])),
        yaw=float(np.arctan2(ahead[1], ahead[0])),
        twist=(
            float(ahead @ odometry.velocity),
            float(left @ odometry.velocity),
            float(odometry.turning[2]),
        ),
        confidence=odometry.confidence,
        slam_error=code,
        true_pose=true_pose,
        touched=touched,
        fell=fell,
    )


@lru_cache(maxsize=4)
def painted(room: Room, seed: int) -> NDArray[np.uint8]:
    """Return the hall's textures; painting takes a while."""
    return textures(room, stream(seed, "quadruped", "room"))


@lru_cache(maxsize=1)
def noise_pool() -> NDArray[np.float32]:
    """Return the sensor's standard normal draws, shape (POOL,)."""
    return stream(0, "quadruped", "sensor").standard_normal(POOL).astype(np.float32)


def _quaternion(r: NDArray[np.float64]) -> tuple[float, float, float, float]:
    """Return x, y, z, w of a rotation (Shepperd's method, w >= 0)."""
    four = np.array(
        [
            1 + r[0, 0] - r[1, 1] - r[2, 2],
            1 - r[0, 0] + r[1, 1] - r[2, 2],
            1 - r[0, 0] - r[1, 1] + r[2, 2],
            1 + r[0, 0] + r[1, 1] + r[2, 2],
        ]
    )
    rows = np.array(
        [
            [four[0], r[0, 1] + r[1, 0], r[0, 2] + r[2, 0], r[2, 1] - r[1, 2]],
            [r[0, 1] + r[1, 0], four[1], r[1, 2] + r[2, 1], r[0, 2] - r[2, 0]],
            [r[0, 2] + r[2, 0], r[1, 2] + r[2, 1], four[2], r[1, 0] - r[0, 1]],
            [r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1], four[3]],
        ]
    )
    q = rows[int(np.argmax(four))]
    q = q / np.linalg.norm(q)
    x, y, z, w = (q if q[3] >= 0 else -q).tolist()
    return x, y, z, w
