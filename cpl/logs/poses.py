"""Read the poses of a recording of messages: ROS 1, ROS 2, or another program's MCAP.

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
from itertools import islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cpl.logs.axes import ROS, turned_rows
from cpl.logs.clock import LAST_NS
from cpl.logs.errors import (
    DamagedLogError,
    DuplicateChannelError,
    EmptyLogError,
    FrameError,
    MissingChannelError,
    RangeError,
    SchemaError,
    TimeOrderError,
)
from cpl.logs.finish import finished
from cpl.logs.formats import Options
from cpl.logs.info import stated
from cpl.logs.layouts import POSES, WARNINGS, BadMessageError, Pose, pose_of, same_layout
from cpl.logs.recording import Recording, Topic
from cpl.logs.run import Run
from cpl.logs.schema import CHANNELS
from cpl.logs.sieve import QUATERNION, Sieve

__all__ = ["ANGULAR_VELOCITY_COV", "LINEAR_ACCEL_COV", "confidence_of", "confidences", "read_poses"]

LINEAR_ACCEL_COV = 0.01  # realsense-ros's default
ANGULAR_VELOCITY_COV = 0.01  # realsense-ros's default
BLOCK = 4096  # messages that are judged together
MOST_WARNINGS = 100_000
_SLAM_ERROR = re.compile(rb"SLAM_ERROR\s+(Vision|Speed|Other)")
_CODES = {b"Vision": 1, b"Speed": 2, b"Other": 3}
_NAMES = ("x_m", "y_m", "z_m", *QUATERNION, "v_x_mps", "v_y_mps", "yaw_rate_radps")
Array = NDArray[np.float64]


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
    found = float(confidences(np.array([covariance]), base, offset)[0])
    if math.isnan(found):
        msg = f"covariance must be {base} times 10^({offset} - 0..3), got {covariance}"
        raise ValueError(msg)
    return int(found)


def confidences(covariances: Array, base: float, offset: int) -> Array:
    """Return :func:`confidence_of` for many; NaN where there is none."""
    with np.errstate(all="ignore"):
        exact = offset - np.log10(covariances / base)
        nearest = np.round(exact)
        fits = (np.abs(exact - nearest) < 0.01) & (nearest >= 0) & (nearest <= 3)
    return np.where(fits, nearest, np.nan)


def read_poses(recording: Recording, path: Path, options: Options, importer: str) -> Run:
    """Read the poses of one topic.

    Args:
        recording: The opened file or files.
        path: Its name, for errors.
        options: `topic`, `provenance`, `axes`, `unit`, `quaternion` and `linear_accel_cov`.
        importer: What is noted as having read it.

    Raises:
        LogError: One of its kinds.
    """
    topic = _chosen(recording, options.topic, path)
    sieve = Sieve(f"{topic.name}, message {{}}")
    notes = list(recording.notes)
    read = _Reader(recording, topic, options, sieve, notes, path)
    read.all()
    _missed(topic, read.count, sieve)
    for each in recording.damages:
        lost = f" ({each.size} bytes dropped)" if each.size else ""
        sieve.drop(DamagedLogError, f"byte {each.at}", f"{each.what}{lost}", rows=0)
    if not read.count:
        causes = "; ".join(map(str, sieve.faults[:3]))
        what = f"has no message{': ' * bool(causes)}{causes}"
        raise EmptyLogError(what, path=path, where=topic.name)
    others = sorted(set(recording.topics) - {topic.name})
    if others:
        notes.append(f"topics that were not read: {', '.join(others)}")
    source = {
        "importer": importer, "topic": topic.name, "frames": list(read.frames), "not_read": others,
    }  # fmt: skip
    info = stated({}, _provenance(options, topic, read.frames), path, source, silent=options.silent)
    expected = topic.expected if topic.expected is not None or recording.damages else read.count
    return finished(
        sieve,
        info,
        path,
        notes,
        size=recording.size,
        topics=tuple(each.topic for each in CHANNELS if set(each.columns) <= read.have),
        written=None if expected is None else max(expected, read.count),
        lost=sum(each.size for each in recording.damages),
        unit_known=options.unit is not None,
    )


def _missed(topic: Topic, count: int, sieve: Sieve) -> None:
    if topic.expected is not None and topic.expected > count:
        what = f"by the file's own count there were {topic.expected} messages, {count} are left"
        sieve.drop(DamagedLogError, topic.name, what, rows=topic.expected - count)


class _Reader:
    """Goes through the messages of a topic, block by block."""

    def __init__(
        self,
        recording: Recording,
        topic: Topic,
        options: Options,
        sieve: Sieve,
        notes: list[str],
        path: Path,
    ) -> None:
        self.count, self.frames = 0, ("", "")
        self.have: set[str] = {"t_s", "yaw_rad", *_NAMES[:7]}
        self._recording, self._topic, self._options = recording, topic, options
        self._sieve, self._notes, self._path = sieve, notes, path
        self._base = options.linear_accel_cov or LINEAR_ACCEL_COV
        self._by_receipt = self._confident = self._moving = False
        self._warnings: list[tuple[int, int]] | None = None

    def all(self) -> None:
        """Read all messages into the sieve."""
        self._warnings = _slam_errors(self._recording)
        messages = self._recording.messages({self._topic.name})
        first = True
        while block := list(islice(self._poses(messages), BLOCK)):
            if first:
                self._settle(block)
                first = False
            self._offer(block)
        if self._warnings:
            what = f"{len(self._warnings)} SLAM errors came after the last pose, and are in no row"
            self._notes.append(what)

    def _poses(self, messages: Iterator[tuple[str, int, bytes]]) -> Iterator[tuple[int, int, Pose]]:
        """Yield number, receipt and pose; a message that is none costs itself."""
        kind, encoding = self._topic.kind, self._topic.encoding
        for _, received_ns, raw in messages:
            number = self.count
            self.count += 1
            try:
                pose = pose_of(kind, encoding, raw)
            except BadMessageError as error:
                self._sieve.drop(SchemaError, self._sieve.place.format(number), str(error))
            else:
                yield number, received_ns, pose

    def _settle(self, block: list[tuple[int, int, Pose]]) -> None:
        """Decide on the first messages what all of them have."""
        poses = [pose for _, _, pose in block]
        self.frames = poses[0].frame, poses[0].child
        for name in self.frames:
            if "optical" in name and self._options.axes is None:
                what = (
                    f"frame {name!r} looks along z; poses of a body are needed (--axes camera "
                    "turns them; axes= in Python)"
                )
                raise FrameError(what, path=self._path)
        if not any(pose.stamp_ns for pose in poses):
            self._by_receipt = True
            self._notes.append("its messages have no stamps: the times are those of their receipt")
        self._moving = poses[0].twist is not None
        self.have |= set(_NAMES[7:]) if self._moving else set()
        self.have |= set() if self._warnings is None else {"slam_error"}
        self._settle_confidence(poses)
        if not self._moving:
            self._notes.append("no twist, because its messages have none")

    def _settle_confidence(self, poses: list[Pose]) -> None:
        found = self._confidence(np.array([pose.covariances for pose in poses]))
        share = float(np.mean(~np.isnan(found)))
        self._confident = share >= 0.5
        if self._confident:
            self.have.add("confidence")
            self._notes.append(
                "confidence from the pose's covariance: linear_accel_cov * 10^(3 - confidence)"
            )
        elif not math.isnan(poses[0].covariances[0]):
            self._notes.append(
                "the confidence cannot be had back: of the first covariances "
                f"{share:.0%} are {self._base} times 10^(3 - 0..3), as the driver writes them"
            )

    def _confidence(self, covariances: Array) -> Array:
        """Return what position and attitude say alike; NaN where they say nothing, or not alike."""
        found = confidences(covariances[:, 0], self._base, 3)
        if self._options.linear_accel_cov is not None:
            return found
        again = confidences(covariances[:, 1], ANGULAR_VELOCITY_COV, 1)
        return np.where(found == again, found, np.nan)

    def _offer(self, block: list[tuple[int, int, Pose]]) -> None:
        numbers = np.array([number for number, _, _ in block], dtype=np.int64)
        poses = [pose for _, _, pose in block]
        received = [receipt for _, receipt, _ in block]
        stamps = received if self._by_receipt else [pose.stamp_ns for pose in poses]
        values = np.array([pose.values for pose in poses])
        columns: dict[str, Array] = dict(zip(_NAMES, values.T, strict=False))
        for axis in "xyz":
            columns[f"{axis}_m"] = columns[f"{axis}_m"] * self._options.scale_m
        if self._options.quaternion == "wxyz":
            parts = [columns[name] for name in QUATERNION]
            columns |= dict(zip(QUATERNION, [*parts[1:], parts[0]], strict=True))
        if self._moving:
            twists = np.array([pose.twist or (math.nan,) * 3 for pose in poses])
            columns |= dict(zip(_NAMES[7:], twists.T, strict=True))
        columns = self._turned(columns)
        if self._warnings is not None:
            codes = [_first_until(receipt, self._warnings) for receipt in received]
            columns["slam_error"] = np.array(codes, dtype=np.float64)
        good = self._dated(stamps, numbers)
        if self._confident:
            columns["confidence"] = self._confidence(np.array([p.covariances for p in poses]))
            good &= self._told(columns["confidence"], poses, numbers, good)
        self._sieve.offer_block(
            numbers[good],
            numbers[good],
            np.array([stamp if -LAST_NS < stamp < LAST_NS else 0 for stamp in stamps])[good],
            {name: values[good] for name, values in columns.items()},
        )

    def _turned(self, columns: dict[str, Array]) -> dict[str, Array]:
        try:
            return turned_rows(columns, self._options.axes or ROS)
        except ValueError as error:
            raise FrameError(str(error), path=self._path) from error

    def _dated(self, stamps: list[int], numbers: NDArray[np.int64]) -> NDArray[np.bool]:
        """Drop rows with a time that is none."""
        good = np.array([-LAST_NS < stamp < LAST_NS for stamp in stamps])
        for at in np.flatnonzero(~good).tolist():
            what = f"its time is {stamps[at]} ns, which is no date"
            self._sieve.drop(TimeOrderError, self._sieve.place.format(numbers[at]), what)
        return good

    def _told(
        self,
        confidence: Array,
        poses: list[Pose],
        numbers: NDArray[np.int64],
        good: NDArray[np.bool],
    ) -> NDArray[np.bool]:
        """Drop rows whose covariance stands for no confidence, where the others' do."""
        known = ~np.isnan(confidence)
        for at in np.flatnonzero(~known & good).tolist():
            first, second = poses[at].covariances
            what = (
                f"its covariances {first:g} and {second:g} are not {self._base} times 10^(3 - 0..3)"
                " and its like for the attitude, so they tell no confidence"
            )
            self._sieve.drop(RangeError, self._sieve.place.format(numbers[at]), what)
        return known


def _chosen(recording: Recording, asked: str | None, path: Path) -> Topic:
    topics = recording.topics
    listed = ", ".join(f"{each.name} ({each.kind})" for each in _some(topics)) or "none"
    if not topics and recording.damages:
        causes = "; ".join(each.what for each in recording.damages[:3])
        raise DamagedLogError(f"no topic is left: {causes}", path=path)
    if asked is not None:
        if asked not in topics or topics[asked].kind not in POSES:
            what = f"topic must be one with poses, got {asked!r}; there are: {listed}"
            raise MissingChannelError(what, path=path)
        return _laid_out(topics[asked], path)
    for kind in POSES:
        names = sorted(each.name for each in topics.values() if each.kind == kind)
        if len(names) > 1:
            what = (
                f"has several topics of {kind}, name one (--topic NAME; topic= in Python): "
                f"{', '.join(names[:20])}"
            )
            raise DuplicateChannelError(what, path=path)
        if names:
            return _laid_out(topics[names[0]], path)
    what = f"has no topic with poses ({', '.join(POSES)}); there are: {listed}"
    raise MissingChannelError(what, path=path)


def _some(topics: dict[str, Topic]) -> list[Topic]:
    return sorted(topics.values(), key=lambda each: each.name)[:20]


def _laid_out(topic: Topic, path: Path) -> Topic:
    """Return a topic whose messages are laid out as they are read; refuse any other."""
    wanted = ("json",) if topic.kind.startswith("foxglove.") else ("cdr", "ros1")
    if topic.encoding not in wanted:
        what = f"its messages are written as {topic.encoding!r}, read is {' or '.join(wanted)}"
        raise SchemaError(what, path=path, where=topic.name)
    if topic.definition and not same_layout(topic.kind, topic.definition):
        what = f"the file's definition of {topic.kind} is not the one of ROS"
        raise SchemaError(what, path=path, where=topic.name)
    return topic


def _first_until(received_ns: int, warnings: list[tuple[int, int]]) -> int:
    """Take the SLAM errors up to a moment off the list's end; return the first one's code, or 0."""
    code = 0
    while warnings and warnings[-1][0] <= received_ns:
        code = code or warnings[-1][1]
        warnings.pop()
    return code


def _slam_errors(recording: Recording) -> list[tuple[int, int]] | None:
    """Return receipt [ns] and code of each SLAM error, last first; None if no topic has any."""
    wanted = {each.name for each in recording.topics.values() if each.kind in WARNINGS}
    if not wanted:
        return None
    events: list[tuple[int, int]] = []
    for _, received_ns, raw in recording.messages(wanted):
        events += [(received_ns, _CODES[found]) for found in _SLAM_ERROR.findall(raw)]
        if len(events) > MOST_WARNINGS:
            recording.notes.append(f"more than {MOST_WARNINGS} SLAM errors: no more were read")
            break
    return sorted(events[:MOST_WARNINGS], key=lambda event: event[0], reverse=True)


def _provenance(options: Options, topic: Topic, frames: tuple[str, str]) -> str | None:
    if options.provenance is None and topic.name.endswith("/odom/sample"):
        # Names that only the realsense-ros driver gives.
        return "real-T265-third-party" if frames[0].endswith("_odom_frame") else None
    return options.provenance
