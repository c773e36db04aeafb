"""Which velocity takes the robot to the next waypoint?

Section V-A prints v = kp (x_hat - x_i). With kp > 0 that drives away from the waypoint
(contradiction 1), and its error is in the world frame while the robot takes body-frame velocities
(contradiction 2). Its target is the nearest waypoint, which is the one that the robot stands on
(contradiction 3). Here is the controller put right; the tests show what the literal one does.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cpl.quadruped.paths import Path
from cpl.settings.ranges import Positive, Settings

__all__ = [
    "Limits",
    "advance",
    "arrived",
    "saturate",
    "velocity_command",
    "wrap_angle",
]

ADVANCE_RADIUS_M = 0.30  # [m] a waypoint this near counts as achieved; the paper states none
STOP_RADIUS_M = 0.10  # [m] Section V-C
STOP_SHARE = 0.75  # [-] Section V-C

Command = tuple[float, float, float]
Pose = Sequence[float] | NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Limits(Settings):
    """What the robot may be asked for; the defaults lie inside the Go1's trot range.

    Args:
        v_x_mps: Largest forward or backward speed [m/s] (Go1: -1.1 .. 1.5).
        v_y_mps: Largest sideways speed [m/s] (Go1: 1).
        yaw_rate_radps: Largest yaw rate [rad/s] (Go1: 4).
    """

    v_x_mps: Positive = 1.1
    v_y_mps: Positive = 1.0
    yaw_rate_radps: Positive = 3.0


def wrap_angle(angle_rad: float) -> float:
    """Return the same direction in [-pi, pi).

    >>> wrap_angle(1.5 * np.pi) == -0.5 * np.pi
    True
    """
    return float((angle_rad + np.pi) % (2 * np.pi) - np.pi)


def velocity_command(pose: Pose, waypoint: Pose, kp: float) -> Command:
    """Return the body-frame velocity towards a waypoint.

        (v_x, v_y) = kp R(-theta_hat) (x_i - x_hat),   v_theta = kp wrap(theta_i - theta_hat)

    Paper: Section V-A, with the sign and the frame put right (contradictions 1 and 2).

    Args:
        pose: Estimated x [m], y [m], heading [rad] in the world frame.
        waypoint: The target's x [m], y [m], heading [rad] in the world frame.
        kp: The gain [1/s], one for all three channels.

    Returns:
        v_x [m/s], v_y [m/s], yaw rate [rad/s] in the body frame, not yet saturated.

    A robot at the origin that looks along +y has a waypoint at (1, 0) to its right:

    >>> [round(v, 6) for v in velocity_command((0, 0, np.pi / 2), (1, 0, np.pi / 2), 1.5)]
    [0.0, -1.5, 0.0]
    """
    dx, dy = waypoint[0] - pose[0], waypoint[1] - pose[1]
    c, s = np.cos(pose[2]), np.sin(pose[2])
    return (
        float(kp * (c * dx + s * dy)),
        float(kp * (c * dy - s * dx)),
        kp * wrap_angle(waypoint[2] - pose[2]),
    )


def saturate(command: Command, limits: Limits) -> Command:
    """Scale the linear velocity into its box without turning it, and clip the yaw rate.

    Args:
        command: v_x [m/s], v_y [m/s], yaw rate [rad/s].
        limits: The box.

    >>> saturate((2.2, 0.5, -9.0), Limits(v_x_mps=1.1, v_y_mps=1.0, yaw_rate_radps=2.0))
    (1.1, 0.25, -2.0)
    """
    v_x, v_y, yaw_rate = command
    excess = max(1.0, abs(v_x) / limits.v_x_mps, abs(v_y) / limits.v_y_mps)
    bound = limits.yaw_rate_radps
    return v_x / excess, v_y / excess, min(max(yaw_rate, -bound), bound)


def advance(index: int, pose: Pose, path: Path, *, radius_m: float = ADVANCE_RADIUS_M) -> int:
    """Return the next target: skip every waypoint that is nearer than the advance radius.

    Args:
        index: The present target.
        pose: Estimated x [m], y [m], heading [rad].
        path: The path.
        radius_m: A target nearer than this is achieved [m].

    Returns:
        The new target's index; never smaller than `index`, never past the last waypoint.
    """
    distances = _distances(pose, path)
    while index < len(path) - 1 and distances[index] < radius_m:
        index += 1
    return index


def arrived(
    index: int,
    pose: Pose,
    path: Path,
    *,
    radius_m: float = STOP_RADIUS_M,
    share: float = STOP_SHARE,
) -> bool:
    """Tell whether the run is over: near the last waypoint with enough of the path achieved.

    Paper: Section V-C, "lower than 0.1 m and at least 75 % of waypoints are achieved".

    Args:
        index: The present target, which is also the number of waypoints achieved.
        pose: Estimated x [m], y [m], heading [rad].
        path: The path.
        radius_m: How near is near [m].
        share: The least share of waypoints achieved [-].
    """
    last = path.waypoints[-1]
    near = np.hypot(last[0] - pose[0], last[1] - pose[1]) < radius_m
    return bool(near and index >= share * (len(path) - 1))


def _distances(pose: Pose, path: Path) -> NDArray[np.float64]:
    return np.hypot(path.waypoints[:, 0] - pose[0], path.waypoints[:, 1] - pose[1])
