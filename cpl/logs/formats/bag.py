"""ROS 1 bags."""

from __future__ import annotations

from pathlib import Path

from cpl.logs.bag_salvage import BAG_MAGIC
from cpl.logs.formats import Format, Head, Likeness, Options
from cpl.logs.poses import read_poses
from cpl.logs.recording import Bag1
from cpl.logs.run import Run

__all__ = ["FORMAT"]


def _recognise(head: Head) -> Likeness:
    if head.data.startswith(BAG_MAGIC):
        return Likeness(1.0, "begins with #ROSBAG V2.0")
    if head.data.startswith(b"#ROSBAG"):
        return Likeness(0.4, "is a bag of another version; `rosbag fix` makes it one of 2.0")
    if b"op=\x05" in head.data and b"compression=" in head.data:
        return Likeness(0.6, "its beginning is damaged, chunks of a bag follow")
    return Likeness(0.0, "does not begin with #ROSBAG V2.0")


def _read(path: Path, options: Options) -> Run:
    recording = Bag1(path)
    try:
        return read_poses(recording, path, options, "cpl.logs.formats.bag")
    finally:
        recording.close()


FORMAT = Format(
    name="bag",
    title="ROS 1 bag, also cut short or without its index",
    example="#ROSBAG V2.0 (binary)",
    lacks="poses without twist (PoseStamped) have none; SLAM errors need /diagnostics",
    recognise=_recognise,
    read=_read,
    suffixes=(".bag",),
    options=("--topic", "--provenance"),
)
