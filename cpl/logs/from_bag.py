"""Read a pose recording from a ROS 1 or ROS 2 bag.

The realsense-ros driver does not publish the T265's confidence as such, but in the covariances:

    pose:  cov = linear_accel_cov   * 10^(3 - confidence)    (both parameters 0.01 by default)
    turn:  cov = angular_velocity_cov * 10^(1 - confidence)

so it can be had back, twice, and the two must agree. SLAM errors are warnings of the library; the
driver repeats them on /diagnostics. A bag without that topic does not say that there were none.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from cpl.logs.bag_salvage import BAG_MAGIC, BagSalvage, salvage_bag
from cpl.logs.checks import Sieve
from cpl.logs.codec import NS
from cpl.logs.errors import (
    DamagedLogError,
    DuplicateChannelError,
    EmptyLogError,
    Fault,
    FrameError,
    LogError,
    MissingChannelError,
    ProvenanceError,
    RangeError,
)
from cpl.logs.info import RunInfo
from cpl.logs.reader import content, finished
from cpl.logs.run import Run
from cpl.logs.salvage import Damage
from cpl.logs.schema import CHANNELS, PROVENANCES

__all__ = ["confidence_of", "read_bag"]

LINEAR_ACCEL_COV = 0.01  # realsense-ros's default
ANGULAR_VELOCITY_COV = 0.01  # realsense-ros's default
POSES = (
    "nav_msgs/msg/Odometry",
    "geometry_msgs/msg/PoseWithCovarianceStamped",
    "geometry_msgs/msg/PoseStamped",
)
WARNINGS = (
    "diagnostic_msgs/msg/DiagnosticArray",
    "rosgraph_msgs/msg/Log",
    "rcl_interfaces/msg/Log",
)
_SLAM_ERROR = re.compile(r"SLAM_ERROR\s+(Vision|Speed|Other)")
_CODES = {"Vision": 1, "Speed": 2, "Other": 3}


def confidence_of(covariance: float, base: float, *, offset: int = 3) -> int:
    """Return the tracker confidence that a covariance stands for.

        confidence = offset - log10(covariance / base)

    Args:
        covariance: First entry of the pose's covariance.
        base: The driver's parameter `linear_accel_cov`.
        offset: 3 for the position's covariance, 1 for the attitude's.

    Returns:
        0 to 3.

    Raises:
        ValueError: The covariance is not one that the driver writes.

    >>> [confidence_of(c, 0.01) for c in (10.0, 1.0, 0.1, 0.01)]
    [0, 1, 2, 3]
    """
    if covariance > 0 and base > 0 and math.isfinite(covariance):
        exact = offset - math.log10(covariance / base)
        nearest = round(exact)
        if abs(exact - nearest) < 0.01 and 0 <= nearest <= 3:
            return nearest
    msg = f"covariance must be {base} times 10^({offset} - 0..3), got {covariance}"
    raise ValueError(msg)


def read_bag(
    path: Path,
    *,
    provenance: str | None = None,
    topic: str | None = None,
    linear_accel_cov: float | None = None,
) -> Run:
    """Read the poses of a bag.

    Args:
        path: A ROS 1 `.bag`, a ROS 2 bag's folder, or one of its `.mcap` or `.db3` files.
        provenance: Where it comes from; may be left out for a bag of the realsense-ros driver.
        topic: The pose topic; may be left out if there is only one.
        linear_accel_cov: The driver's parameter, where it was not the default: then the attitude's
            covariance is not asked for a second opinion.

    Raises:
        LogError: One of its kinds.
    """
    ask = (topic, provenance, linear_accel_cov)
    try:
        with _opened(path) as bag:
            run = _read(bag, path, *ask)
    except (LogError, FileNotFoundError, PermissionError):
        raise
    except Exception as error:  # what the bag library and its parsers raise on damage has no end
        what = f"the bag cannot be read ({type(error).__name__}: {error})"
        if not _is_ros_1(path):
            raise DamagedLogError(what, path=path) from error
        return _salvaged(path, what, *ask)
    if any(fault.error is DamagedLogError for fault in run.recovery.faults) and _is_ros_1(path):
        return _salvaged(path, "the bag cannot be read to its end", *ask)
    return run


def _is_ros_1(path: Path) -> bool:
    """Tell whether a file begins as a ROS 1 bag, of which chunks can be looked for."""
    if not path.is_file():
        return False
    with path.open("rb") as file:
        return file.read(len(BAG_MAGIC)) == BAG_MAGIC


def _salvaged(
    path: Path,
    why: str,
    topic: str | None,
    provenance: str | None,
    linear_accel_cov: float | None,
) -> Run:
    """Read a ROS 1 bag chunk by chunk, after the ordinary reader gave up on it."""
    bag = salvage_bag(content(path))
    if not bag.damages:  # then it is the index that the ordinary reader stumbled over
        bag.damages.append(Damage(at=0, size=0, what=why))
    if not bag.connections:
        causes = "; ".join(each.what for each in bag.damages)
        raise DamagedLogError(f"{why}, and no topic is left: {causes}", path=path)
    try:
        return _read(bag, path, topic, provenance, linear_accel_cov)
    except LogError:
        raise
    except Exception as error:  # as in read_bag
        what = f"what is left of the bag cannot be read ({type(error).__name__}: {error})"
        raise DamagedLogError(what, path=path) from error


def _opened(path: Path) -> Any:  # noqa: ANN401 - rosbags is imported only where a bag is read
    from rosbags.highlevel import AnyReader
    from rosbags.typesys import Stores, get_typestore

    return AnyReader([path], default_typestore=get_typestore(Stores.ROS2_HUMBLE))


def _topic(bag: Any, asked: str | None, path: Path) -> str:  # noqa: ANN401
    there = {each.topic: each.msgtype for each in bag.connections}
    listed = ", ".join(f"{name} ({kind})" for name, kind in sorted(there.items())) or "none"
    if asked is not None:
        if there.get(asked) not in POSES:
            what = f"topic must be one with poses, got {asked!r}; there are: {listed}"
            raise MissingChannelError(what, path=path)
        return asked
    for kind in POSES:
        names = [name for name, each in there.items() if each == kind]
        if len(names) > 1:
            what = f"has several {kind} topics, name one: {', '.join(sorted(names))}"
            raise DuplicateChannelError(what, path=path)
        if names:
            return names[0]
    raise MissingChannelError(f"has no topic with poses; there are: {listed}", path=path)


def _read(
    bag: Any,  # noqa: ANN401
    path: Path,
    asked: str | None,
    provenance: str | None,
    linear_accel_cov: float | None,
) -> Run:
    topic = _topic(bag, asked, path)
    damages: list[Damage] = getattr(bag, "damages", [])
    sieve = Sieve(
        faults=[
            Fault(error=DamagedLogError, where=f"byte {each.at}", what=f"{each.what}{_lost(each)}")
            for each in damages
        ]
    )
    messages = list(_messages(bag, topic, sieve))
    if not messages:
        causes = "; ".join(map(str, sieve.faults))
        raise EmptyLogError(f"has no message{': ' * bool(causes)}{causes}", path=path, where=topic)
    notes = ["ROS bags carry no checksums: a changed digit in one cannot be seen"]
    first, start_ns = messages[0][2], messages[0][1]
    frames = _frames(first, path)
    confident = _confidences_known(first, linear_accel_cov, notes)
    warnings = _slam_errors(bag)
    have = {"t_s", "yaw_rad", *_pose(first), *_twist(first)}
    have |= {"confidence"} if confident else set()
    have |= set() if warnings is None else {"slam_error"}
    for number, (received_ns, stamp_ns, message) in enumerate(messages):
        row: dict[str, Any] = {"t_s": (stamp_ns - start_ns) / NS} | _pose(message) | _twist(message)
        where = f"{topic}, message {number}"
        if warnings is not None:
            row["slam_error"] = _first_until(received_ns, warnings)
        try:
            row |= {"confidence": _confidence(message, linear_accel_cov)} if confident else {}
        except ValueError as error:
            sieve.drop(RangeError, where, str(error))
        else:
            sieve.offer_raw(number, row, where)
    if warnings:
        notes.append(f"{len(warnings)} SLAM errors came after the last pose and are not in a row")
    others = sorted({each.topic for each in bag.connections} - {topic})
    if others:
        notes.append(f"topics whose poses were not read: {', '.join(others)}")
    info = RunInfo(
        provenance=_provenance(provenance, topic, frames, path),
        start_unix_ns=max(start_ns, 0),
        source={
            "file": path.name,
            "importer": "cpl.logs.from_bag",
            "topic": topic,
            "frames": list(frames),
            "not_read": others,
        },
    )
    topics = tuple(each.topic for each in CHANNELS if set(each.columns) <= have)
    return finished(
        sieve,
        info,
        path,
        notes,
        size=sum(each.stat().st_size for each in _files(path)),
        topics=topics,
        written=_written(bag, topic) if damages else len(messages),
        lost=sum(each.size for each in damages),
    )


def _lost(damage: Damage) -> str:
    return f" ({damage.size} bytes dropped)" if damage.size else ""


def _written(bag: BagSalvage, topic: str) -> int | None:
    """Return how many messages of a topic a damaged bag says it had; None if it does not say."""
    counts = [bag.expected.get(each.id) for each in bag.connections if each.topic == topic]
    known = [count for count in counts if count is not None]
    return sum(known) if known and len(known) == len(counts) else None


def _frames(first: Any, path: Path) -> tuple[str, str]:  # noqa: ANN401
    """Return the frames of pose and twist; refuse those of a lens."""
    frames = (first.header.frame_id, getattr(first, "child_frame_id", ""))
    for name in frames:
        if "optical" in name:
            what = f"frame {name!r} looks along z; poses of a body are needed"
            raise FrameError(what, path=path)
    return frames


def _first_until(received_ns: int, warnings: list[tuple[int, int]]) -> int:
    """Take the SLAM errors up to a moment off the list and return the first one's code, or 0."""
    code = 0
    while warnings and warnings[0][0] <= received_ns:
        code = code or warnings[0][1]
        del warnings[0]
    return code


def _messages(bag: Any, topic: str, sieve: Sieve) -> Iterator[tuple[int, int, Any]]:  # noqa: ANN401
    """Yield receipt, stamp [ns] and message, up to the first that cannot be read."""
    chosen = [each for each in bag.connections if each.topic == topic]
    number = 0
    try:
        for connection, received_ns, raw in bag.messages(connections=chosen):
            message = bag.deserialize(raw, connection.msgtype)
            stamp = message.header.stamp
            yield received_ns, stamp.sec * NS + stamp.nanosec, message
            number += 1
    except Exception as error:  # as in read_bag: what is before the damage is kept
        what = f"cannot be read, nor can what follows ({type(error).__name__}: {error})"
        sieve.drop(DamagedLogError, f"{topic}, message {number}", what, rows=0)


def _pose(message: Any) -> dict[str, float]:  # noqa: ANN401
    pose = getattr(message.pose, "pose", message.pose)
    point, turn = pose.position, pose.orientation
    return {
        "x_m": point.x,
        "y_m": point.y,
        "z_m": point.z,
        "qx": turn.x,
        "qy": turn.y,
        "qz": turn.z,
        "qw": turn.w,
    }


def _twist(message: Any) -> dict[str, float]:  # noqa: ANN401
    if not hasattr(message, "twist"):
        return {}
    twist = message.twist.twist
    return {
        "v_x_mps": twist.linear.x,
        "v_y_mps": twist.linear.y,
        "yaw_rate_radps": twist.angular.z,
    }


def _confidence(message: Any, linear_accel_cov: float | None) -> int:  # noqa: ANN401
    covariance = message.pose.covariance
    found = confidence_of(float(covariance[0]), linear_accel_cov or LINEAR_ACCEL_COV)
    if linear_accel_cov is None:
        again = confidence_of(float(covariance[21]), ANGULAR_VELOCITY_COV, offset=1)
        if again != found:
            msg = (
                f"covariance must mean one confidence, got {found} by the position's and {again} "
                "by the attitude's; give linear_accel_cov if the driver's was not the default"
            )
            raise ValueError(msg)
    return found


def _confidences_known(first: Any, linear_accel_cov: float | None, notes: list[str]) -> bool:  # noqa: ANN401
    """Tell whether the covariances are those of the driver; say so if they are not."""
    if not hasattr(first.pose, "covariance"):
        return False
    try:
        _confidence(first, linear_accel_cov)
    except ValueError as error:
        notes.append(f"the confidence cannot be had back: {error}")
        return False
    notes.append("confidence from the pose's covariance: linear_accel_cov * 10^(3 - confidence)")
    return True


def _slam_errors(bag: Any) -> list[tuple[int, int]] | None:  # noqa: ANN401
    """Return receipt [ns] and code of each SLAM error; None if no topic could carry one."""
    chosen = [each for each in bag.connections if each.msgtype in WARNINGS]
    if not chosen:
        return None
    events: list[tuple[int, int]] = []
    for connection, received_ns, raw in bag.messages(connections=chosen):
        message = bag.deserialize(raw, connection.msgtype)
        texts = [each.message for each in getattr(message, "status", ())] or [
            getattr(message, "msg", "")
        ]
        found = (_SLAM_ERROR.search(text) for text in texts)
        events += [(received_ns, _CODES[match[1]]) for match in found if match]
    return events


def _provenance(asked: str | None, topic: str, frames: tuple[str, str], path: Path) -> str:
    if asked is not None:
        return asked
    if topic.endswith("/odom/sample") and frames[0].endswith("_odom_frame"):
        return "real-T265-third-party"  # names that only the realsense-ros driver gives
    what = f"does not say where it comes from: give provenance, one of {', '.join(PROVENANCES)}"
    raise ProvenanceError(what, path=path)


def _files(path: Path) -> list[Path]:
    return [path] if path.is_file() else sorted(each for each in path.iterdir() if each.is_file())
