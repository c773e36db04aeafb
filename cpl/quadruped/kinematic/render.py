"""What does the sensor read? An analytic ray-caster with exposure blur and sensor noise.

A ray from inside a box meets exactly one face: the nearest of three planes. A pixel is the mean
over the sub-exposures' poses, then photons are counted (shot noise), read (read noise) and scaled
by a gain that undoes light and exposure, so a dim room is a noisy picture, not a dark one.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from cpl.quadruped.kinematic.room import SIZE, TEXELS_PER_M

__all__ = ["cast_depth", "expose"]


@njit(cache=True, fastmath=True)
def expose(texture, box, rays, inside, poses, electrons, read_noise, noise, offset, image):  # noqa: ANN001, ANN201
    """Fill the pixels inside the field of view; the others keep what they are.

    Args:
        texture: Reflectance of the six faces, uint8 (6, 512, 512).
        box: half_x, half_y, height [m], (3,).
        rays: Unit rays in camera axes, float32 (M, 3).
        inside: Flat pixel index of each ray, int32 (M,).
        poses: Sub-exposures: camera position and rotation (row-major, camera to world), (n, 12).
        electrons: Electrons of a white pixel under this light and exposure [e-].
        read_noise: Standard deviation of the read noise [e-].
        noise: Standard normal pool, float32, length a power of two.
        offset: Where this picture begins in the pool.
        image: uint8, flat, written in place.
    """
    n = poses.shape[0]
    per_level = np.float32(electrons / 255.0)
    read = np.float32(read_noise * read_noise)
    scale = np.float32(TEXELS_PER_M)
    mask = noise.shape[0] - 1
    half_x, half_y, height = np.float32(box[0]), np.float32(box[1]), np.float32(box[2])
    r = poses.astype(np.float32)
    for m in range(rays.shape[0]):
        a, b, c = rays[m, 0], rays[m, 1], rays[m, 2]
        total = np.float32(0.0)
        for j in range(n):
            dx = r[j, 3] * a + r[j, 4] * b + r[j, 5] * c
            dy = r[j, 6] * a + r[j, 7] * b + r[j, 8] * c
            dz = r[j, 9] * a + r[j, 10] * b + r[j, 11] * c
            ox, oy, oz = r[j, 0], r[j, 1], r[j, 2]
            tx = ((half_x if dx > 0 else -half_x) - ox) / (dx if dx != 0 else np.float32(1e-9))
            ty = ((half_y if dy > 0 else -half_y) - oy) / (dy if dy != 0 else np.float32(1e-9))
            tz = ((height if dz > 0 else np.float32(0)) - oz) / (
                dz if dz != 0 else np.float32(1e-9)
            )
            if tx < ty and tx < tz:
                face, u, v = (1 if dx > 0 else 0), oy + tx * dy, oz + tx * dz
            elif ty < tz:
                face, u, v = (3 if dy > 0 else 2), ox + ty * dx, oz + ty * dz
            else:
                face, u, v = (5 if dz > 0 else 4), ox + tz * dx, oy + tz * dy
            # Coordinates are shifted to be positive, so that truncation is floor.
            u = (u + np.float32(64)) * scale
            v = (v + np.float32(64)) * scale
            iu, iv = np.int32(u), np.int32(v)
            fu, fv = u - np.float32(iu), v - np.float32(iv)
            x0, y0 = iu & (SIZE - 1), iv & (SIZE - 1)
            x1, y1 = (iu + 1) & (SIZE - 1), (iv + 1) & (SIZE - 1)
            top = texture[face, y0, x0] * (1 - fu) + texture[face, y0, x1] * fu
            low = texture[face, y1, x0] * (1 - fu) + texture[face, y1, x1] * fu
            total += np.float32(top * (1 - fv) + low * fv)
        count = total / np.float32(n) * per_level
        count += np.sqrt(count + read) * noise[(offset + m) & mask]
        level = count / per_level + np.float32(0.5)
        level = min(max(level, np.float32(0)), np.float32(255))
        image[inside[m]] = np.uint8(level)


@njit(cache=True)
def cast_depth(box, pose, rays):  # noqa: ANN001, ANN201
    """Return the distance along each ray to the face it meets.

    Args:
        box: half_x, half_y, height [m], (3,).
        pose: Camera position and rotation (row-major, camera to world), (12,).
        rays: Unit rays in camera axes, (N, 3).

    Returns:
        Distances [m], (N,).
    """
    distances = np.empty(rays.shape[0])
    for i in range(rays.shape[0]):
        best = np.inf
        for axis in range(3):
            direction = (
                pose[3 + 3 * axis] * rays[i, 0]
                + pose[4 + 3 * axis] * rays[i, 1]
                + pose[5 + 3 * axis] * rays[i, 2]
            )
            low = -box[axis] if axis < 2 else 0.0
            wall = box[axis] if direction > 0 else low
            if direction != 0.0:
                best = min(best, (wall - pose[axis]) / direction)
        distances[i] = best
    return distances
