"""When does the robot lose its way? A small visual-inertial odometry on OpenCV's KLT and PnP.

Features are predicted by the IMU, tracked forward and back (KLT), and the camera's pose is solved
from their known points (PnP-RANSAC). A SLAM error is the odometry's own loss of track, with the
T265's codes; no probability of failure is written anywhere:

- 1 Vision: too few features can be tracked;
- 2 Speed: they were lost while the picture moved faster than tracking can follow;
- 3 Other: features there are, but no consistent pose.

While lost it carries on by its IMU alone, tries to recognise stored keyframes, and after a while
starts a new map where it believes it is: the error made meanwhile stays, as real drift does.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum
from typing import Annotated

import cv2
import numpy as np
from numpy.typing import NDArray

from cpl.quadruped.kinematic.camera import FisheyeCamera, project
from cpl.quadruped.kinematic.estimate import angles, predict, refine, to_camera
from cpl.settings.ranges import Count, Positive, Settings, interval

__all__ = ["Odometry", "OdometryConfig", "SlamError"]

Floats = NDArray[np.float64]
Stereo = Callable[[Floats], Floats]


class SlamError(IntEnum):
    """The T265's codes."""

    NONE = 0
    VISION = 1
    SPEED = 2
    OTHER = 3


@dataclass(frozen=True, kw_only=True)
class OdometryConfig(Settings):
    """How the odometry tracks and when it admits that it is lost.

    Args:
        features: Features it tries to keep [-].
        min_features: Fewer tracked ones than this are no basis for a pose [-].
        contrast: Least eigenvalue of a corner's gradient matrix, grey levels scaled to 1 [-].
        cell_px: Least distance between two features [px].
        window_px: KLT's window [px].
        round_trip_px: Largest forward-backward error [px].
        inlier_px: Largest reprojection error of an inlier [px].
        inlier_share: Least share of inliers for a pose to be believed [-].
        registered: How far a feature is put back to where the map says it is, 0 to 1 [-].
        jump_m: Largest difference between vision's position and the IMU's prediction [m].
        jump_rad: Largest difference between vision's attitude and the IMU's prediction [rad].
        speed_px: Median motion of the features a frame from which a loss is one of speed [px].
        restart_frames: Frames without recognition after which a new map is begun [-].
        keyframe_m: A keyframe is stored this far from all others [m].
        keyframe_rad: ... or this much turned [rad].
    """

    features: Count = 70
    min_features: Annotated[int, interval("[6, inf)")] = 12
    contrast: Positive = 0.0003
    cell_px: Count = 10
    window_px: Count = 13
    round_trip_px: Positive = 1.0
    inlier_px: Positive = 2.0
    inlier_share: Positive = 0.5
    registered: Positive = 0.5
    jump_m: Positive = 0.15
    jump_rad: Positive = 0.10
    speed_px: Positive = 6.0
    restart_frames: Count = 9
    keyframe_m: Positive = 0.4
    keyframe_rad: Positive = 0.5


@dataclass(frozen=True)
class _View:
    """A picture with features of known place: the previous frame, or a keyframe."""

    image: NDArray[np.uint8]
    pixels: Floats  # (N, 2)
    points: Floats  # (N, 3), world frame as estimated
    position: Floats  # (3,)
    rotation: Floats  # (3, 3)


class Odometry:
    """Track one camera from a known start.

    Args:
        camera: Its lens.
        config: How.
        position: Where the camera is at the start [m], (3,).
        rotation: How it is turned, camera to world, (3, 3).
        image: The first picture.
        stereo: Returns the (noisy) distance along given unit rays for the present picture [m].
    """

    def __init__(
        self,
        camera: FisheyeCamera,
        config: OdometryConfig,
        position: Floats,
        rotation: Floats,
        image: NDArray[np.uint8],
        stereo: Stereo,
    ) -> None:
        self.position, self.rotation = position.copy(), np.ascontiguousarray(rotation)
        self.velocity = np.zeros(3)
        self.turning = np.zeros(3)  # [rad/s], world frame, by the gyro
        self.code = SlamError.NONE
        self.tracked = 0  # inliers of the last pose
        self._camera, self._config = camera, config
        self._intrinsics = camera.intrinsics
        self._lost_frames = 0
        self._keyframes: list[_View] = []
        self._field = np.zeros_like(image)
        centre = tuple(np.round(self._intrinsics[1:3]).astype(int).tolist())
        cv2.circle(self._field, centre, int(self._rim_px), 255, -1)
        image = _smooth(image)
        self._view = _View(image, np.empty((0, 2)), np.empty((0, 3)), position, rotation)
        self._replenish(image, stereo)

    @property
    def confidence(self) -> int:
        """0 lost, 1 low, 2 medium, 3 high, from the number of inliers."""
        if self.code:
            return 0
        return 1 + (self.tracked >= 2 * self._config.min_features) + (self.tracked >= 36)

    def step(
        self, image: NDArray[np.uint8], gyro: Floats, accel: Floats, stereo: Stereo
    ) -> SlamError:
        """Take one picture and the IMU readings since the last one.

        Args:
            image: Grey levels, (height, width); it is kept, so the caller must not write to it.
            gyro: Angular velocity in camera axes [rad/s], (n, 3).
            accel: Specific force in camera axes [m/s2], (n, 3).
            stereo: Returns the distance along given unit rays for this picture [m].

        Returns:
            The code of this frame.
        """
        image = _smooth(image)
        predict(self.position, self.velocity, self.rotation, gyro, accel)
        self.turning = self.rotation @ gyro.mean(axis=0)
        if self.code:
            self._recover(image, stereo)
            return self.code
        self.code = self._locate(self._view, image, trust_prediction=True)
        if self.code:
            self._lost_frames = 0
            self.tracked = 0
            return self.code
        self._replenish(image, stereo)
        self._remember()
        return self.code

    def fork(self) -> Odometry:
        """Return an independent copy; pictures are shared, because nobody writes to them."""
        twin = copy.copy(self)
        for name in ("position", "rotation", "velocity", "_keyframes"):
            setattr(twin, name, getattr(self, name).copy())
        return twin

    def _locate(
        self, view: _View, image: NDArray[np.uint8], *, trust_prediction: bool
    ) -> SlamError:
        """Find the features of a view in the picture and solve the pose; change nothing on loss."""
        config = self._config
        if len(view.pixels) < config.min_features:
            return SlamError.VISION
        expected = project(self._intrinsics, to_camera(self.position, self.rotation, view.points))
        pixels, kept = self._follow(view, image, expected)
        motion_px = float(np.median(np.linalg.norm(expected - view.pixels, axis=1)))
        fast = trust_prediction and motion_px > config.speed_px
        if len(kept) < config.min_features:
            return SlamError.SPEED if fast else SlamError.VISION
        points, rays = view.points[kept], self._camera.rays(pixels)
        pose = self._solve(points, rays, trust_prediction=trust_prediction)
        if pose is None:
            return SlamError.SPEED if fast else SlamError.OTHER
        position, rotation, inliers = pose
        if trust_prediction:
            # The IMU's prediction and vision's fix: an alpha-beta filter on the position.
            innovation = position - self.position
            self.position += 0.7 * innovation
            self.velocity += 0.2 * innovation * 30.0
        else:
            self.position = position
        self.rotation = rotation
        self.tracked = len(inliers)
        # Where the rigid map says a feature is, not where KLT slid to: errors do not pile up.
        points = points[inliers]
        mapped = project(self._intrinsics, to_camera(self.position, rotation, points))
        pixels = pixels[inliers] + config.registered * (mapped - pixels[inliers])
        self._view = _View(image, pixels, points, self.position.copy(), rotation.copy())
        return SlamError.NONE

    def _follow(
        self, view: _View, image: NDArray[np.uint8], expected: Floats
    ) -> tuple[Floats, NDArray[np.intp]]:
        """Return the features' new pixels and which of the view's features they are."""
        config = self._config
        before = view.pixels.astype(np.float32)[:, None]
        guess = expected.astype(np.float32)[:, None]
        options = {
            "winSize": (config.window_px, config.window_px),
            "maxLevel": 2,
            "criteria": (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 15, 0.03),
            "flags": cv2.OPTFLOW_USE_INITIAL_FLOW,
            "minEigThreshold": 1e-3,
        }
        after, found, _ = cv2.calcOpticalFlowPyrLK(
            view.image, image, before, guess.copy(), **options
        )
        # The way back starts from the predicted motion reversed, not from the answer.
        back, refound, _ = cv2.calcOpticalFlowPyrLK(
            image, view.image, after, after - (guess - before), **options
        )
        error = np.linalg.norm(back - before, axis=2)[:, 0]
        centre = self._intrinsics[1:3]
        radius = np.linalg.norm(after[:, 0] - centre, axis=1)
        inside = radius < self._rim_px
        good = (found[:, 0] == 1) & (refound[:, 0] == 1) & (error < config.round_trip_px) & inside
        kept = np.flatnonzero(good)
        return after[kept, 0].astype(np.float64), kept

    @property
    def _rim_px(self) -> float:
        """Features beyond this distance from the centre are too near the rim of the field."""
        return self._camera.focal_px * min(1.25, self._camera.field_rad - 0.1)

    def _solve(
        self, points: Floats, rays: Floats, *, trust_prediction: bool
    ) -> tuple[Floats, Floats, NDArray[np.intp]] | None:
        """Return position, rotation and inliers, or None where there is no consistent pose."""
        config = self._config
        tolerance = config.inlier_px / self._camera.focal_px
        position, rotation = self.position.copy(), self.rotation.copy()
        chosen = np.flatnonzero(angles(position, rotation, points, rays) < tolerance)
        # Where the IMU's prediction already explains most features there is nothing to vote on.
        if not trust_prediction or len(chosen) < 0.8 * len(points):
            vote = _ransac(points, rays, 2 * tolerance)
            if vote is None:
                return None
            position, rotation, chosen = vote
        if len(chosen) < config.min_features:
            return None
        refine(position, rotation, points[chosen], rays[chosen], 0.5 * tolerance)
        chosen = np.flatnonzero(angles(position, rotation, points, rays) < tolerance)
        if len(chosen) < max(config.min_features, config.inlier_share * len(points)):
            return None
        jump_m = np.linalg.norm(position - self.position)
        jump_rad = np.linalg.norm(rotation - self.rotation) / np.sqrt(2)
        if trust_prediction and (jump_m > config.jump_m or jump_rad > config.jump_rad):
            return None
        return position, rotation, chosen

    def _recover(self, image: NDArray[np.uint8], stereo: Stereo) -> None:
        """Recognise a stored view, or after a while begin a new map at the predicted pose."""
        self._lost_frames += 1
        nearest = sorted(self._keyframes, key=lambda view: sum(self._apart(view)))[:2]
        for view in [self._view, *nearest]:
            if self._locate(view, image, trust_prediction=False) == SlamError.NONE:
                self.code = SlamError.NONE
                self._replenish(image, stereo)
                return
        if self._lost_frames < self._config.restart_frames:
            return
        old = self._view
        self._view = _View(
            image, np.empty((0, 2)), np.empty((0, 3)), self.position.copy(), self.rotation.copy()
        )
        self._replenish(image, stereo)
        if len(self._view.pixels) >= 2 * self._config.min_features:
            self.code = SlamError.NONE
            self.tracked = len(self._view.pixels)
        else:
            self._view = old

    def _apart(self, view: _View) -> tuple[float, float]:
        """How far [m] and how much turned [rad] a stored view is from the present pose."""
        (x, y, z), (a, b, c) = (view.position - self.position).tolist(), view.rotation[:, 2]
        p, q, r = self.rotation[:, 2].tolist()
        return math.sqrt(x * x + y * y + z * z), math.acos(
            min(1.0, max(-1.0, a * p + b * q + c * r))
        )

    def _remember(self) -> None:
        """Store the present view as a keyframe where there is none near it."""
        config = self._config
        if self.tracked < 2 * config.min_features:
            return
        for view in self._keyframes:
            shift_m, turn_rad = self._apart(view)
            if shift_m < config.keyframe_m and turn_rad < config.keyframe_rad:
                return
        self._keyframes.append(self._view)

    def _replenish(self, image: NDArray[np.uint8], stereo: Stereo) -> None:
        """Add corners in cells that hold no feature, with the distance that stereo gives them."""
        config, view, cell = self._config, self._view, self._config.cell_px
        if len(view.pixels) > 0.8 * config.features:
            return
        free = self._field.copy()
        for u, v in view.pixels.astype(int).tolist():
            free[max(v - cell, 0) : v + cell + 1, max(u - cell, 0) : u + cell + 1] = 0
        corners, quality = cv2.goodFeaturesToTrackWithQuality(
            image, config.features, 0.01, cell, free, blockSize=5
        )[:2]
        fresh = [] if corners is None else corners[quality[:, 0] > config.contrast]
        pixels = np.reshape(fresh, (-1, 2)).astype(np.float64)[: config.features - len(view.pixels)]
        if not len(pixels):
            return
        rays = self._camera.rays(pixels)
        points = self.position + stereo(rays)[:, None] * rays @ self.rotation.T
        self._view = _View(
            image,
            np.concatenate([view.pixels, pixels]),
            np.concatenate([view.points, points]),
            self.position.copy(),
            self.rotation.copy(),
        )


def _ransac(
    points: Floats, rays: Floats, tolerance: float
) -> tuple[Floats, Floats, NDArray[np.intp]] | None:
    """Return position, rotation and inliers by OpenCV's PnP-RANSAC, or None.

    On its flat picture plane an angle grows by 1 / cos^2: the test is stricter towards the rim.
    """
    found, turn, shift, inliers = cv2.solvePnPRansac(
        points,
        rays[:, :2] / rays[:, 2:],
        np.eye(3),
        None,
        iterationsCount=50,
        reprojectionError=tolerance,
        confidence=0.99,
        flags=cv2.SOLVEPNP_AP3P,
    )
    if not found or inliers is None:
        return None
    rotation = np.ascontiguousarray(cv2.Rodrigues(turn)[0].T, dtype=np.float64)
    return -rotation @ shift[:, 0], rotation, inliers[:, 0].astype(np.intp)


def _smooth(image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Take the sensor's noise down by a small Gaussian before anything is looked for."""
    return cv2.GaussianBlur(image, (3, 3), 0).astype(np.uint8, copy=False)
