"""What does a pixel of the fisheye look at? The Kannala-Brandt model with four coefficients.

    r(theta) = f (theta + k1 theta^3 + k2 theta^5 + k3 theta^7 + k4 theta^9)

The numbers are those of a T265 at a quarter of its resolution. Camera axes: x right, y down,
z along the view.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Annotated

import numpy as np
from numba import njit
from numpy.typing import NDArray

from cpl.settings.ranges import Count, Positive, Settings, interval

__all__ = ["FisheyeCamera", "project", "unproject"]


@dataclass(frozen=True, kw_only=True)
class FisheyeCamera(Settings):
    """A fisheye camera and its sensor.

    Args:
        width: Columns [px].
        height: Rows [px].
        focal_px: Focal length [px]; the T265's 284 px divided by four.
        k: The four Kannala-Brandt coefficients [-].
        field_rad: Largest angle from the axis that is seen [rad]; half the T265's 163 deg.
        exposure_s: Exposure time [s].
        full_well: Electrons of a white pixel in full light at 10 ms [e-].
        read_noise: Standard deviation of the read noise [e-].
    """

    width: Count = 212
    height: Count = 200
    focal_px: Positive = 71.5
    k: tuple[float, float, float, float] = (-0.0077, 0.0449, -0.0421, 0.0079)
    field_rad: Positive = 1.42
    exposure_s: Positive = 0.010
    full_well: Positive = 1500.0
    read_noise: Annotated[float, interval("[0, inf)")] = 6.0

    @property
    def intrinsics(self) -> NDArray[np.float64]:
        """f, c_x, c_y [px] and the four coefficients, as the kernels take them, shape (7,)."""
        centre = ((self.width - 1) / 2, (self.height - 1) / 2)
        return np.array([self.focal_px, *centre, *self.k])

    @cached_property
    def pixel_rays(self) -> tuple[NDArray[np.int32], NDArray[np.float32]]:
        """The flat indices of the pixels inside the field of view and their unit rays, (M, 3)."""
        v, u = np.mgrid[: self.height, : self.width]
        rays = self.rays(np.column_stack([u.ravel(), v.ravel()]).astype(np.float64))
        inside = np.flatnonzero(rays[:, 2] > np.cos(self.field_rad))
        return inside.astype(np.int32), np.ascontiguousarray(rays[inside], dtype=np.float32)

    def rays(self, pixels: NDArray[np.floating]) -> NDArray[np.float64]:
        """Return the unit rays of pixels.

        Args:
            pixels: u, v [px], shape (N, 2).

        Returns:
            Unit vectors in camera axes, shape (N, 3).

        >>> camera = FisheyeCamera()
        >>> ray = np.array([[0.6, 0.0, 0.8]])
        >>> bool(np.allclose(camera.rays(project(camera.intrinsics, ray)), ray))
        True
        """
        return unproject(self.intrinsics, np.ascontiguousarray(pixels, dtype=np.float64))


@njit(cache=True)
def unproject(intrinsics, pixels):  # noqa: ANN001, ANN201 (compiled: types come from the call)
    """Return the unit rays of pixels: the model inverted by Newton's method.

    Args:
        intrinsics: `FisheyeCamera.intrinsics`, shape (7,).
        pixels: u, v [px], shape (N, 2).

    Returns:
        Unit vectors in camera axes, shape (N, 3).
    """
    rays = np.empty((pixels.shape[0], 3))
    f, c_x, c_y = intrinsics[0], intrinsics[1], intrinsics[2]
    k1, k2, k3, k4 = intrinsics[3], intrinsics[4], intrinsics[5], intrinsics[6]
    for i in range(pixels.shape[0]):
        du, dv = (pixels[i, 0] - c_x) / f, (pixels[i, 1] - c_y) / f
        radius = np.sqrt(du * du + dv * dv)
        theta = radius
        for _ in range(8):
            s = theta * theta
            value = theta * (1 + s * (k1 + s * (k2 + s * (k3 + s * k4))))
            slope = 1 + s * (3 * k1 + s * (5 * k2 + s * (7 * k3 + s * 9 * k4)))
            change = (value - radius) / slope
            theta -= change
            if abs(change) < 1e-12:
                break
        scale = np.sin(theta) / radius if radius > 1e-12 else 0.0
        rays[i, 0], rays[i, 1], rays[i, 2] = du * scale, dv * scale, np.cos(theta)
    return rays


@njit(cache=True, fastmath=True)
def project(intrinsics, points):  # noqa: ANN001, ANN201 (compiled: types come from the call)
    """Return the pixels of points in camera axes.

    Args:
        intrinsics: `FisheyeCamera.intrinsics`, shape (7,).
        points: x, y, z [m] in camera axes, shape (N, 3), none at the origin.

    Returns:
        u, v [px], shape (N, 2).
    """
    pixels = np.empty((points.shape[0], 2))
    f, c_x, c_y = intrinsics[0], intrinsics[1], intrinsics[2]
    for i in range(points.shape[0]):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        across = np.sqrt(x * x + y * y)
        theta = np.arctan2(across, z)
        s = theta * theta
        r = theta * (
            1 + s * (intrinsics[3] + s * (intrinsics[4] + s * (intrinsics[5] + s * intrinsics[6])))
        )
        scale = f * r / across if across > 1e-12 else 0.0
        pixels[i, 0] = c_x + scale * x
        pixels[i, 1] = c_y + scale * y
    return pixels
