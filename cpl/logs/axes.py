"""Three conventions for axes, and the way from the others to the one that logs hold.

- ``ros`` is REP 103 and what logs hold: world z up; body x forward, y left, z up; twist in the
  body.
- ``t265`` is librealsense's own for the T265: world y up; body x right, y up, z backward; twist in
  the world.
- ``camera`` is that of lenses, and so of KITTI: x right, y down, z forward, for the body and for
  the world, which is the first camera; twist in the world.

A file that does not say which it uses is refused until its reader does: a wrong guess turns height
into a step to the side.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cpl.logs.checks import rotation
from cpl.logs.errors import FrameError
from cpl.logs.sieve import QUATERNION

__all__ = ["AXES", "ROS", "chosen_axes", "to_ros", "turned_rows"]

ROS = "ros"
# ROS's x, y and z as signed axes of the other convention.
_MAPS = {
    "t265": ((2, -1.0), (0, -1.0), (1, 1.0)),
    "camera": ((2, 1.0), (0, -1.0), (1, -1.0)),
}
AXES = (ROS, *_MAPS)
POSITION = ("x_m", "y_m", "z_m")
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
        "does not say which way its axes point: give --axes ros (world z up, body x forward, twist "
        "in the body), --axes t265 (world y up, body z backward, twist in the world) or --axes "
        "camera (y down, z forward); in Python axes='ros' and so on"
    )
    raise FrameError(what, path=path)


def to_ros(
    position: Array, quaternion: Array, linear: Array, angular: Array, *, axes: str = "t265"
) -> tuple[Array, ...]:
    """Turn poses and twists from other axes into those of ROS.

        t265:    x_ros = -z,  y_ros = -x,  z_ros =  y,  for world and body;  twist: world to body
        camera:  x_ros =  z,  y_ros = -x,  z_ros = -y,  likewise

    The first is what the realsense-ros driver does.

    Args:
        position: x, y, z [m], shape (T, 3).
        quaternion: x, y, z, w, shape (T, 4).
        linear: Velocity in the world frame [m/s], shape (T, 3).
        angular: Angular velocity in the world frame [rad/s], shape (T, 3).
        axes: `t265` or `camera`.

    Returns:
        The four, the twist now in the body frame.

    A camera that moves backward along its own z, which is upright, moves along ROS's -x:

    >>> upright = np.array([[0.0, 0.0, 0.0, 1.0]])
    >>> z = np.array([[0.0, 0.0, 2.0]])
    >>> (to_ros(z, upright, z, z)[2] + 0.0).tolist()
    [[-2.0, 0.0, 0.0]]
    """
    turned = np.column_stack([_turn(quaternion[:, :3], axes), quaternion[:, 3]])
    into_body = rotation(turned).transpose(0, 2, 1)
    v, w = (np.einsum("tij,tj->ti", into_body, _turn(each, axes)) for each in (linear, angular))
    return _turn(position, axes), turned, v, w


def turned_rows(columns: dict[str, Array], axes: str) -> dict[str, Array]:
    """Return columns of poses in ROS's axes; twists in a plane are refused, other columns kept.

    Args:
        columns: As in `cpl.logs.COLUMNS`, with position and attitude.
        axes: One of `AXES`.

    Raises:
        ValueError: There is a planar twist or a heading, which means nothing in other axes.
    """
    if axes == ROS:
        return columns
    if "v_x_mps" in columns or "yaw_rad" in columns:
        msg = f"planar twists and headings have no meaning in the axes {axes!r}, where y is upright"
        raise ValueError(msg)
    names = (*POSITION, *QUATERNION[:3])
    new = [sign * columns[names[base + axis]] for base in (0, 3) for axis, sign in _MAPS[axes]]
    return {**columns, **dict(zip(names, new, strict=True))}


def _turn(vectors: Array, axes: str) -> Array:
    return np.column_stack([sign * vectors[:, axis] for axis, sign in _MAPS[axes]])
