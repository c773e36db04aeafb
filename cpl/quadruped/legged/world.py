"""Twin B as a whole: command in, a tenth of a second of legs and pictures, observation out."""

from __future__ import annotations

from dataclasses import dataclass, field

import cv2
import numpy as np
from numpy.typing import NDArray

from cpl.quadruped.kinematic.body import SUBSTEPS, feel
from cpl.quadruped.kinematic.camera import FisheyeCamera
from cpl.quadruped.kinematic.odometry import Odometry, OdometryConfig
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
from cpl.quadruped.kinematic.world import FRAMES, PER_FRAME
from cpl.quadruped.legged.eye import Eye
from cpl.quadruped.legged.robot import Gait, LeggedRobot
from cpl.quadruped.observation import Observation
from cpl.rng import stream

__all__ = ["LeggedConfig", "LeggedWorld"]

REACH_M = 0.5  # [m] the robot's own half length


@dataclass(frozen=True, kw_only=True)
class LeggedConfig:
    """Everything that makes the twin.

    Args:
        room: The hall, the same as twin A's.
        gait: Motors and trim.
        camera: Lens and sensor; MuJoCo's pinholes limit its field.
        imu: Inertial sensor and stereo.
        odometry: The estimator, the same as twin A's.
        mount: Where the camera sits in the body's axes: ahead and above [m].
        blur_px: Motion that one of the summed pictures may cover [px]; MuJoCo's take their time.
        room_seed: Paints the hall.
    """

    room: Room = field(default_factory=Room)
    gait: Gait = field(default_factory=Gait)
    camera: FisheyeCamera = field(default_factory=lambda: FisheyeCamera(field_rad=1.047))
    imu: ImuConfig = field(default_factory=ImuConfig)
    odometry: OdometryConfig = field(default_factory=OdometryConfig)
    mount: tuple[float, float] = (0.28, 0.05)
    blur_px: float = 2.0
    room_seed: int = 0


class LeggedWorld:
    """Twin B. `reset`, then `step` at 10 Hz; `close` it in the end.

    The same configuration and seed give the same run on the same machine with the same MuJoCo; no
    more is promised of somebody else's physics and renderer, which is why its logs are shipped.

    Args:
        config: What the twin is made of.

    Raises:
        ModuleNotFoundError: The extra `legged` is not installed.
    """

    provenance = "simulated-legged"

    def __init__(self, config: LeggedConfig) -> None:
        self.config = config
        self._robot = LeggedRobot(config.gait, config.mount)
        self._eye = Eye(config.room, painted(config.room, config.room_seed), config.camera)
        self._box, self._pool = config.room.box, noise_pool()
        camera, light = config.camera, config.room.light
        self._electrons = camera.full_well * light * camera.exposure_s / 0.010

    def reset(self, start: tuple[float, float, float], seed: int) -> Observation:
        """Put the robot on its legs at a pose that its odometry is told.

        Args:
            start: True x [m], y [m], yaw [rad].
            seed: Draws friction, what the gait senses, sensor noise and biases.

        Returns:
            The first observation, at t = 0.
        """
        cv2.setNumThreads(1)
        cv2.setRNGSeed(seed % 2**31)
        self._rng = stream(seed, "quadruped", "legged")
        self._bias = self._rng.standard_normal(6) * self.config.imu.bias_sigma
        self._robot.reset(start, stream(seed, "quadruped", "legged", "gait"))
        self._steps, self.touched = 0, False
        pose = self._robot.camera()
        self._poses = np.tile(pose, (SUBSTEPS, 1))
        self._odometry = Odometry(
            self.config.camera,
            self.config.odometry,
            pose[:3],
            pose[3:].reshape(3, 3),
            self._photograph(self._poses),
            lambda rays: self._stereo(pose, rays),
        )
        return self._observe(0)

    def step(self, command: tuple[float, float, float]) -> Observation:
        """Walk for 0.1 s, take three pictures, track.

        Args:
            command: v_x [m/s], v_y [m/s], yaw rate [rad/s] in the body frame.

        Returns:
            What is known afterwards; its SLAM error is the last one of the three frames.
        """
        imu, before, poses = self.config.imu, self._poses, self._robot.walk(command)
        gyro, accel = np.empty((SUBSTEPS, 3)), np.empty((SUBSTEPS, 3))
        noise = self._rng.standard_normal((SUBSTEPS, 6))
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
        x, y, _ = self._robot.pose
        at_wall = max(abs(x) - self._box[0], abs(y) - self._box[1]) > -REACH_M
        self.touched |= bool(at_wall)
        return self._observe(code)

    def close(self) -> None:
        """Give the renderer's memory back."""
        self._eye.close()

    def _observe(self, code: int) -> Observation:
        return observation(
            self._odometry,
            self.config.mount,
            self._steps / 10,
            code,
            self._robot.pose,
            touched=self.touched,
            fell=self._robot.fallen,
        )

    def _photograph(self, poses: NDArray[np.float64]) -> NDArray[np.uint8]:
        """Expose a picture that ends with the last of the poses: photons, read noise, gain."""
        camera = self.config.camera
        exposures = sub_exposures(camera, poses, self.config.blur_px)
        reflected = self._eye.expose(exposures).ravel()[self._eye.inside]
        per_level = np.float32(self._electrons / 255.0)
        count = reflected * per_level
        begin = int(self._rng.integers(POOL))
        noise = self._pool.take(np.arange(begin, begin + len(count)), mode="wrap")
        count += np.sqrt(count + np.float32(camera.read_noise**2)) * noise
        image = np.zeros(camera.height * camera.width, dtype=np.uint8)
        image[self._eye.inside] = np.clip(count / per_level + 0.5, 0, 255).astype(np.uint8)
        return image.reshape(camera.height, camera.width)

    def _stereo(self, pose: NDArray[np.float64], rays: NDArray[np.float64]) -> NDArray[np.float64]:
        return stereo(self._box, pose, rays, self.config.imu, self._rng)
