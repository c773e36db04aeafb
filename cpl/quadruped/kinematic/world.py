"""The twin as a whole: command in, a tenth of a second of walking and seeing, observation out."""

from __future__ import annotations

import copy
from dataclasses import dataclass, field
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from cpl.quadruped.kinematic.body import DT, STATE, SUBSTEPS, Body, feel, walk
from cpl.quadruped.kinematic.camera import FisheyeCamera
from cpl.quadruped.kinematic.odometry import Odometry, OdometryConfig
from cpl.quadruped.kinematic.render import cast_depth, expose
from cpl.quadruped.kinematic.room import Room, textures
from cpl.quadruped.observation import Observation
from cpl.rng import stream

__all__ = ["ImuConfig", "KinematicWorld", "WorldConfig"]

FRAMES = 3  # pictures a policy step: 30 Hz
PER_FRAME = SUBSTEPS // FRAMES
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


@dataclass(frozen=True, kw_only=True)
class WorldConfig:
    """Everything that makes the twin.

    Args:
        room: The hall.
        body: The robot.
        camera: Lens and sensor.
        imu: Inertial sensor and stereo.
        odometry: The estimator.
        room_seed: Paints the hall; runs of one experiment share a hall as they would in a lab.
    """

    room: Room = field(default_factory=Room)
    body: Body = field(default_factory=Body)
    camera: FisheyeCamera = field(default_factory=FisheyeCamera)
    imu: ImuConfig = field(default_factory=ImuConfig)
    odometry: OdometryConfig = field(default_factory=OdometryConfig)
    room_seed: int = 0


class KinematicWorld:
    """Twin A. `reset`, then `step` at 10 Hz; the same configuration and seed give the same run.

    Args:
        config: What the twin is made of.

    >>> world = KinematicWorld(WorldConfig())
    >>> first = world.reset((0.0, 0.0, 0.0), seed=1)
    >>> first.slam_error, first.true_pose
    (0, (0.0, 0.0, 0.0))
    >>> round(world.step((0.5, 0.0, 0.0)).t_s, 3)
    0.1
    """

    provenance = "simulated-kinematic"

    def __init__(self, config: WorldConfig) -> None:
        self.config = config
        self._texture = _painted(config.room, config.room_seed)
        self._inside, self._rays = _pixel_rays(config.camera)
        self._body, self._box = config.body.vector, config.room.box
        self._reach = self._box[:2] - 0.5  # [m] the robot's own half length
        camera, light = config.camera, config.room.light
        self._electrons = camera.full_well * light * camera.exposure_s / 0.010
        self._pool = _noise_pool()

    def reset(self, start: tuple[float, float, float], seed: int) -> Observation:
        """Put the robot at rest at a pose that its odometry is told.

        Args:
            start: True x [m], y [m], yaw [rad].
            seed: Draws slip, jolts, sensor noise and biases.

        Returns:
            The first observation, at t = 0.
        """
        cv2.setNumThreads(1)
        cv2.setRNGSeed(seed % 2**31)
        imu = self.config.imu
        self._rng = stream(seed, "quadruped", "kinematic")
        sigma = np.repeat([imu.gyro_bias_radps, imu.accel_bias_mps2], 3)
        self._bias = self._rng.standard_normal(6) * sigma
        self._state = np.zeros(STATE)
        self._state[:3] = start
        self._steps = 0
        self.touched = False
        standing = np.empty((SUBSTEPS, 12))
        walk(self._state.copy(), np.zeros(3), self._body, self._reach, np.zeros((24, 5)), standing)
        self._poses = standing
        image, camera_pose = self._photograph(standing), standing[-1]
        self._odometry = Odometry(
            self.config.camera,
            self.config.odometry,
            camera_pose[:3],
            camera_pose[3:].reshape(3, 3),
            image,
            lambda rays: self._stereo(camera_pose, rays),
        )
        return self._observe(0)

    def step(self, command: tuple[float, float, float]) -> Observation:
        """Walk for 0.1 s, take three pictures, track.

        Args:
            command: v_x [m/s], v_y [m/s], yaw rate [rad/s] in the body frame.

        Returns:
            What is known afterwards; its SLAM error is the last one of the three frames.
        """
        rng, imu = self._rng, self.config.imu
        before, poses = self._poses, np.empty((SUBSTEPS, 12))
        noise = rng.standard_normal((SUBSTEPS, 5))
        self.touched |= walk(self._state, np.array(command), self._body, self._reach, noise, poses)
        gyro, accel = np.empty((SUBSTEPS, 3)), np.empty((SUBSTEPS, 3))
        noise = rng.standard_normal((SUBSTEPS, 6))
        feel(before[-2:], poses, self._bias, noise, imu.gyro_radps, imu.accel_mps2, gyro, accel)
        both = np.concatenate([before, poses])
        code = 0
        for frame in range(1, FRAMES + 1):
            done = frame * PER_FRAME
            now = slice(done - PER_FRAME, done)
            image, pose = self._photograph(both[: SUBSTEPS + done]), poses[done - 1]
            latest = self._odometry.step(
                image, gyro[now], accel[now], lambda rays, pose=pose: self._stereo(pose, rays)
            )
            code = int(latest) or code
        self._poses = poses
        self._steps += 1
        return self._observe(code)

    def fork(self) -> KinematicWorld:
        """Return a copy with the same future: what the oracle looks into."""
        twin = copy.copy(self)
        for name in ("_rng", "_state", "_poses", "_bias"):
            setattr(twin, name, copy.deepcopy(getattr(self, name)))
        twin._odometry = self._odometry.fork()
        return twin

    def _observe(self, code: int) -> Observation:
        odometry, forward = self._odometry, self._body[-1]
        axes = odometry.rotation
        # The camera looks along the body's x and sits ahead of its centre.
        ahead, left, up = axes[:, 2], -axes[:, 0], -axes[:, 1]
        position = odometry.position - forward * ahead
        x, y, yaw = self._state[:3].tolist()
        return Observation(
            t_s=self._steps / 10,
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
            true_pose=(x, y, yaw),
            touched=self.touched,
        )

    def _photograph(self, poses: NDArray[np.float64]) -> NDArray[np.uint8]:
        """Expose a picture that ends with the last of the poses."""
        camera = self.config.camera
        n = max(1, round(camera.exposure_s / DT))
        first, last = poses[-1 - n, 3:].reshape(3, 3), poses[-1, 3:].reshape(3, 3)
        blur_px = camera.focal_px * np.linalg.norm(first - last) / np.sqrt(2)
        subs = int(np.clip(np.ceil(blur_px / BLUR_PX), 2, MAX_SUB_EXPOSURES))
        at = len(poses) - 1 - camera.exposure_s / DT * (np.arange(subs) + 0.5) / subs
        low = at.astype(int)
        share = (at - low)[:, None]
        exposures = poses[low] * (1 - share) + poses[low + 1] * share
        image = np.zeros(camera.height * camera.width, dtype=np.uint8)
        expose(
            self._texture,
            self._box,
            self._rays,
            self._inside,
            exposures,
            self._electrons,
            camera.read_noise,
            self._pool,
            int(self._rng.integers(POOL)),
            image,
        )
        return image.reshape(camera.height, camera.width)

    def _stereo(self, pose: NDArray[np.float64], rays: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return what a stereo pair measures: true distances with disparity noise [m]."""
        inverse = 1.0 / cast_depth(self._box, pose, rays)
        inverse += self.config.imu.inverse_depth * self._rng.standard_normal(len(rays))
        return 1.0 / np.maximum(inverse, 0.05)


@lru_cache(maxsize=4)
def _painted(room: Room, seed: int) -> NDArray[np.uint8]:
    return textures(room, stream(seed, "quadruped", "room"))


@lru_cache(maxsize=4)
def _pixel_rays(camera: FisheyeCamera) -> tuple[NDArray[np.int32], NDArray[np.float32]]:
    return camera.pixel_rays


@lru_cache(maxsize=1)
def _noise_pool() -> NDArray[np.float32]:
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
