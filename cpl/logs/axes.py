"""Two conventions for axes, and the way from one to the other.

``ros`` is REP 103 and what logs hold: world z up; body x forward, y left, z up; twist in the body.
``t265`` is librealsense's own for the T265: world y up; body x right, y up, z backward; twist in
the world. A file that does not say which it uses is refused until its reader does: a wrong guess
turns height into a step to the side.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cpl.logs.checks import rotation
from cpl.logs.errors import FrameError

__all__ = ["AXES", "chosen_axes", "to_ros"]

AXES = ("ros", "t265")
Array = NDArray[np.float64]


def chosen_axes(asked: str | None, said: str | None, path: Path) -> str:
    """Return the convention that a file follows.

    Args:
        asked: What the caller says; None for nothing.
        said: What the file says; None for nothing.
        path: The file, for the error.

    Raises:
        FrameError: Neither says anything, both contradict each other, or it is no convention.
    """
    for name in (asked, said):
        if name is not None and name not in AXES:
            raise FrameError(f"axes must be one of {', '.join(AXES)}, got {name!r}", path=path)
    if asked and said and asked != said:
        raise FrameError(f"says its axes are {said!r}, but {asked!r} was asked for", path=path)
    if chosen := asked or said:
        return chosen
    what = (
        "does not say which way its axes point: give axes='ros' (world z up, body x forward, twist "
        "in the body) or axes='t265' (world y up, body z backward, twist in the world)"
    )
    raise FrameError(what, path=path)


def to_ros(position: Array, quaternion: Array, linear: Array, angular: Array) -> tuple[Array, ...]:
    """Turn poses and twists from the T265's axes into those of ROS.

        x_ros = -z,  y_ros = -x,  z_ros = y,  for world and body;  twist: world to body

    This is what the realsense-ros driver does.

    Args:
        position: x, y, z [m], shape (T, 3).
        quaternion: x, y, z, w, shape (T, 4).
        linear: Velocity in the world frame [m/s], shape (T, 3).
        angular: Angular velocity in the world frame [rad/s], shape (T, 3).

    Returns:
        The four, the twist now in the body frame.

    A camera that moves backward along its own z, which is upright, moves along ROS's -x:

    >>> upright = np.array([[0.0, 0.0, 0.0, 1.0]])
    >>> z = np.array([[0.0, 0.0, 2.0]])
    >>> (to_ros(z, upright, z, z)[2] + 0.0).tolist()
    [[-2.0, 0.0, 0.0]]
    """
    turned = np.column_stack([_axes(quaternion[:, :3]), quaternion[:, 3]])
    into_body = rotation(turned).transpose(0, 2, 1)
    v, w = (np.einsum("tij,tj->ti", into_body, _axes(each)) for each in (linear, angular))
    return _axes(position), turned, v, w


def _axes(vectors: Array) -> Array:
    return np.column_stack([-vectors[:, 2], -vectors[:, 0], vectors[:, 1]])
