"""Where is the camera? The estimator's arithmetic: strapdown prediction and pose refinement.

Compiled pieces without any image in them; `odometry` puts them to use.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from cpl.quadruped.kinematic.body import DT, GRAVITY

__all__ = ["angles", "predict", "refine", "to_camera"]


@njit(cache=True)
def predict(position, velocity, rotation, gyro, accel):  # noqa: ANN001, ANN201
    """Carry a pose forward by IMU readings, in place.

    Args:
        position: [m], world frame, (3,).
        velocity: [m/s], world frame, (3,).
        rotation: Camera to world, (3, 3).
        gyro: Angular velocity in camera axes [rad/s], (n, 3).
        accel: Specific force in camera axes [m/s2], (n, 3).
    """
    for k in range(gyro.shape[0]):
        for i in range(3):
            a = 0.0
            for j in range(3):
                a += rotation[i, j] * accel[k, j]
            velocity[i] += (a - (GRAVITY if i == 2 else 0.0)) * DT
        for i in range(3):
            position[i] += velocity[i] * DT
        rotation[:, :] = rotation @ _exp(gyro[k] * DT)


@njit(cache=True)
def to_camera(position, rotation, points):  # noqa: ANN001, ANN201
    """Return world points in camera axes.

    Args:
        position: Camera position [m], (3,).
        rotation: Camera to world, (3, 3).
        points: World points [m], (N, 3).

    Returns:
        Points [m], (N, 3).
    """
    return (points - position) @ rotation


@njit(cache=True)
def angles(position, rotation, points, rays):  # noqa: ANN001, ANN201
    """Return the angle between where each point should be seen and where it is seen.

    Args:
        position: Camera position [m], (3,).
        rotation: Camera to world, (3, 3).
        points: World points [m], (N, 3).
        rays: Unit rays in camera axes, (N, 3).

    Returns:
        Chords of the unit sphere, for small angles the angle [rad], (N,).
    """
    local = to_camera(position, rotation, points)
    errors = np.empty(points.shape[0])
    for i in range(points.shape[0]):
        norm = np.sqrt((local[i] ** 2).sum())
        errors[i] = np.sqrt(((local[i] / norm - rays[i]) ** 2).sum())
    return errors


@njit(cache=True)
def refine(position, rotation, points, rays, huber):  # noqa: ANN001, ANN201
    """Move a pose, in place, to the minimum of the bearing errors (Gauss-Newton, Huber weights).

        min  sum_i rho( | R^T (X_i - p) / |X_i - p| - ray_i | )

    Args:
        position: Camera position [m], changed, (3,).
        rotation: Camera to world, changed, (3, 3).
        points: World points [m], (N, 3), N >= 3.
        rays: Unit rays in camera axes, (N, 3).
        huber: Errors above this count linearly [rad].
    """
    for _ in range(4):
        h, g = _normal_equations(position, rotation, points, rays, huber)
        step = np.linalg.solve(h, -g)
        rotation[:, :] = rotation @ _exp(step[:3])
        position += step[3:]
        if np.abs(step).max() < 1e-5:
            break


@njit(cache=True)
def _normal_equations(position, rotation, points, rays, huber):  # noqa: ANN001, ANN202
    """Return J^T W J and J^T W r of the bearing errors r; first the turn, then the step."""
    h, g, row = 1e-9 * np.eye(6), np.zeros(6), np.empty(6)
    local = to_camera(position, rotation, points)
    for i in range(points.shape[0]):
        distance = np.sqrt(local[i, 0] ** 2 + local[i, 1] ** 2 + local[i, 2] ** 2)
        x, y, z = local[i, 0] / distance, local[i, 1] / distance, local[i, 2] / distance
        unit, error = (x, y, z), (x - rays[i, 0], y - rays[i, 1], z - rays[i, 2])
        size = np.sqrt(error[0] ** 2 + error[1] ** 2 + error[2] ** 2)
        weight = 1.0 if size <= huber else huber / size
        # A turn w moves the direction by u x w, a step d by -(I - u u^T) R^T d / distance.
        cross = ((0.0, -z, y), (z, 0.0, -x), (-y, x, 0.0))
        for r in range(3):
            for c in range(3):
                along = x * rotation[c, 0] + y * rotation[c, 1] + z * rotation[c, 2]
                row[c] = cross[r][c]
                row[3 + c] = (unit[r] * along - rotation[c, r]) / distance
            g += weight * error[r] * row
            for c in range(6):
                h[c] += weight * row[c] * row
    return h, g


@njit(cache=True)
def _exp(w):  # noqa: ANN001, ANN202
    """Return the rotation by the vector w [rad] (Rodrigues)."""
    angle = np.sqrt((w**2).sum())
    a, b = 1.0, 0.5
    if angle > 1e-8:
        a, b = np.sin(angle) / angle, (1 - np.cos(angle)) / (angle * angle)
    k = np.array([[0.0, -w[2], w[1]], [w[2], 0.0, -w[0]], [-w[1], w[0], 0.0]])
    return np.eye(3) + a * k + b * (k @ k)
