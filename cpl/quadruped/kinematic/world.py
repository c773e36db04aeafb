"""The twin as a whole: command in, a tenth of a second of walking and seeing, observation out."""

from __future__ import annotations

import copy
from dataclasses import dataclass, field
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from cpl.quadruped.kinematic.body import STATE, SUBSTEPS, Body, feel, walk
from cpl.quadruped.kinematic.camera import FisheyeCamera
from cpl.quadruped.kinematic.odometry import Odometry, OdometryConfig
from cpl.quadruped.kinematic.render import expose
from cpl.quadruped.kinematic.room import Room
from cpl.quadruped.kinematic.sensor import (
    POOL,
    ImuConfig,
    noise_pool,
    observation,
    painted,
    stereo,
    sub_exposures,
)
from cpl.quadruped.observation import Observation
from cpl.rng import stream

__all__ = ["KinematicWorld", "WorldConfig"]

FRAMES = 3  # pictures a policy step: 30 Hz
PER_FRAME = SUBSTEPS // FRAMES


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
        self._texture = painted(config.room, config.room_seed)
        self._inside, self._rays = _pixel_rays(config.camera)
        self._body, self._box = config.body.vector, config.room.box
        self._reach = self._box[:2] - 0.5  # [m] the robot's own half length
        camera, light = config.camera, config.room.light
        self._electrons = camera.full_well * light * camera.exposure_s / 0.010
        self._pool = noise_pool()

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
        self._rng = stream(seed, "quadruped", "kinematic")
        self._bias = self._rng.standard_normal(6) * self.config.imu.bias_sigma
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
        x, y, yaw = self._state[:3].tolist()
        return observation(
            self._odometry,
            (self._body[-1], 0.0),
            self._steps / 10,
            code,
            (x, y, yaw),
            touched=self.touched,
        )

    def _photograph(self, poses: NDArray[np.float64]) -> NDArray[np.uint8]:
        """Expose a picture that ends with the last of the poses."""
        camera = self.config.camera
        exposures = sub_exposures(camera, poses)
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
        return stereo(self._box, pose, rays, self.config.imu, self._rng)


@lru_cache(maxsize=4)
def _pixel_rays(camera: FisheyeCamera) -> tuple[NDArray[np.int32], NDArray[np.float32]]:
    return camera.pixel_rays
