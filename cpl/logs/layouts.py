"""How poses stand in the messages of ROS and of Foxglove, and how to get them out.

Six kinds of message have the pose of a body. Their layout is written down here, so that a message
is taken by its bytes alone: no code is made from the definitions that a file brings along, they are
only compared with what is written here. A definition that says otherwise is refused, for its bytes
would be read as other numbers.
"""

from __future__ import annotations

import json
import math
import re
import struct
from collections.abc import Callable
from typing import NamedTuple

from cpl.logs.packed import ZSTD

__all__ = ["POSES", "WARNINGS", "BadMessageError", "Pose", "pose_of", "same_layout"]

NS = 1_000_000_000
NAN = math.nan
POSES = (
    "nav_msgs/msg/Odometry",
    "geometry_msgs/msg/PoseWithCovarianceStamped",
    "geometry_msgs/msg/PoseStamped",
    "geometry_msgs/msg/TransformStamped",
    "foxglove.PoseInFrame",
    "foxglove.FrameTransform",
)
WARNINGS = (
    "diagnostic_msgs/msg/DiagnosticArray",
    "rosgraph_msgs/msg/Log",
    "rcl_interfaces/msg/Log",
)


class BadMessageError(Exception):
    """A message is not laid out as its kind is."""


class Pose(NamedTuple):
    """What a message says.

    Attributes:
        stamp_ns: When it was measured [ns]; 0 if it does not say.
        frame: In what frame.
        child: Of what.
        values: x, y, z [m], qx, qy, qz, qw.
        twist: v_x, v_y [m/s], yaw rate [rad/s], in the body; None if it has none.
        covariances: The position's and the attitude's first variance; NaN if it has none.
    """

    stamp_ns: int
    frame: str
    child: str
    values: tuple[float, ...]
    twist: tuple[float, float, float] | None
    covariances: tuple[float, float]


def pose_of(kind: str, encoding: str, raw: bytes) -> Pose:
    """Return the pose in a message.

    Args:
        kind: One of `POSES`.
        encoding: `cdr` (ROS 2), `ros1` or `json`.
        raw: The message.

    Raises:
        BadMessageError: It is not laid out so.
    """
    try:
        if encoding == "json":
            return _json_pose(kind, raw)
        return _ros_pose(kind, raw, *_ENCODINGS[encoding](raw))
    except (struct.error, UnicodeDecodeError, IndexError) as error:
        msg = f"has {len(raw)} bytes, which is no {kind}"
        raise BadMessageError(msg) from error


def _cdr(raw: bytes) -> tuple[str, bool, int]:
    if len(raw) < 4 or raw[0] or raw[1] > 1:
        packed = raw.startswith(ZSTD)
        msg = "is packed, and cannot be unpacked" if packed else "is not CDR" if raw else "is empty"
        raise BadMessageError(msg)
    return ("<" if raw[1] else ">"), True, 4


def _ros1(raw: bytes) -> tuple[str, bool, int]:
    if not raw:
        raise BadMessageError("is empty")
    return "<", False, 0


_ENCODINGS: dict[str, Callable[[bytes], tuple[str, bool, int]]] = {"cdr": _cdr, "ros1": _ros1}
# After seven numbers of the pose: the variances 0 and 21 of 36, and where there is a twist, it.
_BODIES = {"o": "7dd160xd112x6d288x", "c": "7dd160xd112x", "p": "7d"}
_SHAPES = {
    "nav_msgs/msg/Odometry": ("o", True),
    "geometry_msgs/msg/PoseWithCovarianceStamped": ("c", False),
    "geometry_msgs/msg/PoseStamped": ("p", False),
    "geometry_msgs/msg/TransformStamped": ("p", True),
}
_STRUCTS = {
    (order, shape): struct.Struct(order + body) for order in "<>" for shape, body in _BODIES.items()
}


def _ros_pose(kind: str, raw: bytes, order: str, cdr: bool, base: int) -> Pose:
    shape, has_child = _SHAPES[kind]
    at = base
    if not cdr:
        at += 4  # the sequence number, which ROS 2 gave up
    sec, nanosec = struct.unpack_from(order + ("iI" if cdr else "II"), raw, at)
    frame, at = _text(raw, at + 8, order, cdr, base)
    child = ""
    if has_child:
        child, at = _text(raw, at, order, cdr, base)
    if cdr:
        at += -(at - base) % 8
    body = _STRUCTS[order, shape]
    numbers = body.unpack_from(raw, at)
    if len(raw) - at - body.size > 7:
        msg = f"has {len(raw) - at - body.size} bytes more than {kind} has"
        raise BadMessageError(msg)
    values, rest = numbers[:7], numbers[7:]
    twist = (rest[2], rest[3], rest[7]) if shape == "o" else None
    variances = (rest[0], rest[1]) if rest else (NAN, NAN)
    return Pose(sec * NS + nanosec, frame, child, values, twist, variances)


def _text(raw: bytes, at: int, order: str, cdr: bool, base: int) -> tuple[str, int]:
    if cdr:
        at += -(at - base) % 4
    length = struct.unpack_from(order + "I", raw, at)[0]
    end = at + 4 + length
    if end > len(raw):
        raise IndexError
    return raw[at + 4 : end - (cdr and length > 0)].decode(), end


def _json_pose(kind: str, raw: bytes) -> Pose:
    try:
        message = json.loads(raw)
        stamp = message["timestamp"]
        if kind == "foxglove.PoseInFrame":
            point, turn = message["pose"]["position"], message["pose"]["orientation"]
            frame, child = message.get("frame_id", ""), ""
        else:
            point, turn = message["translation"], message["rotation"]
            frame, child = message.get("parent_frame_id", ""), message.get("child_frame_id", "")
        values = tuple(float(point[axis]) for axis in "xyz")
        values += tuple(float(turn[axis]) for axis in "xyzw")
        stamp_ns = int(stamp["sec"]) * NS + int(stamp["nsec"])
    except (
        ValueError,
        KeyError,
        TypeError,
        AttributeError,
        OverflowError,
        RecursionError,
    ) as error:
        msg = f"is no {kind} in JSON ({type(error).__name__}: {error})"
        raise BadMessageError(msg) from error
    return Pose(stamp_ns, str(frame), str(child), values, None, (NAN, NAN))


# Definitions


_VECTOR = ("x float64", "y float64", "z float64")
_POSE = (
    *(f"position.{each}" for each in _VECTOR),
    *(f"orientation.{each}" for each in (*_VECTOR, "w float64")),
)
_TWIST = tuple(f"{part}.{each}" for part in ("linear", "angular") for each in _VECTOR)
_TRANSFORM = tuple(each.replace("position.", "translation.").replace("orientation.", "rotation.")
                   for each in _POSE)  # fmt: skip
_COVARIANCE = "covariance float64[36]"
_FIELDS: dict[str, tuple[str, ...]] = {
    "nav_msgs/msg/Odometry": (
        "child_frame_id string",
        *(f"pose.pose.{each}" for each in _POSE),
        f"pose.{_COVARIANCE}",
        *(f"twist.twist.{each}" for each in _TWIST),
        f"twist.{_COVARIANCE}",
    ),
    "geometry_msgs/msg/PoseWithCovarianceStamped": (
        *(f"pose.pose.{each}" for each in _POSE),
        f"pose.{_COVARIANCE}",
    ),
    "geometry_msgs/msg/PoseStamped": tuple(f"pose.{each}" for each in _POSE),
    "geometry_msgs/msg/TransformStamped": (
        "child_frame_id string",
        *(f"transform.{each}" for each in _TRANSFORM),
    ),
}
_HEADS = (
    ("header.seq uint32", "header.stamp time", "header.frame_id string"),
    ("header.stamp.sec int32", "header.stamp.nanosec uint32", "header.frame_id string"),
    ("header.stamp time", "header.frame_id string"),
)
# A type, a name, and what the name is unless it is set; a constant has = behind its name.
_LINE = re.compile(
    r"\s*([A-Za-z][\w/]*(?:\[\d*\])?)\s+([A-Za-z]\w*)(?:\s+[^\s=#][^#]*)?\s*(?:#.*)?$"
)
DEEPEST = 8  # levels; a pose has four


def same_layout(kind: str, definition: str) -> bool:
    r"""Tell whether a definition of ROS lays a message out as it is read here.

    Args:
        kind: The message's type, one of `POSES`.
        definition: Its definition with those of the types in it, as bags have them.

    Examples:
        >>> text = "Header header\nstring child_frame_id\nTransform transform\n"
        >>> same_layout("geometry_msgs/msg/TransformStamped", text)
        False
    """
    first, *others = re.split(r"^=+\s*$", definition, flags=re.MULTILINE)
    parts: dict[str, str] = {}
    for other in others:
        head, _, body = other.strip().partition("\n")
        parts[head.removeprefix("MSG:").strip().rpartition("/")[2]] = body
    fields = _flat(first, parts, "", 0)
    return any(fields == (*head, *_FIELDS[kind]) for head in _HEADS)


def _flat(text: str, parts: dict[str, str], prefix: str, depth: int) -> tuple[str, ...] | None:
    found: list[str] = []
    for line in text.splitlines():
        match = _LINE.match(line)
        if not match:
            continue  # empty, a comment or a constant
        kind, name = match.groups()
        short = kind.rpartition("/")[2]
        if short in parts and depth < DEEPEST:
            inner = _flat(parts[short], parts, f"{prefix}{name}.", depth + 1)
            if inner is None:
                return None
            found += inner
        else:
            found.append(f"{prefix}{name} {kind}")
        if len(found) > 100:
            return None
    return tuple(found)
