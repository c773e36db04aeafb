"""ROS 2 bags in SQLite, and ROS 2 bags' folders, whatever they are made of."""

from __future__ import annotations

from pathlib import Path

from cpl.logs.formats import Format, Head, Likeness, Options
from cpl.logs.packed import ENDINGS, ZSTD, beginning
from cpl.logs.poses import read_poses
from cpl.logs.recording import opened
from cpl.logs.run import Run
from cpl.logs.salvage import MAGIC

__all__ = ["FORMAT"]


def _recognise(head: Head) -> Likeness:
    if head.is_folder:
        found = (head.path / "metadata.yaml").is_file()
        return Likeness(
            float(found), "a folder with metadata.yaml" if found else "no metadata.yaml"
        )
    if head.data.startswith(b"SQLite format 3"):
        return Likeness(1.0, "is an SQLite file")
    if head.data.startswith(ZSTD):
        inside = beginning(head.path, 16)
        if inside.startswith((b"SQLite format 3", MAGIC)):
            return Likeness(1.0, "is an SQLite or MCAP file packed by zstd")
    return Likeness(0.0, "is no SQLite file, and no folder with metadata.yaml")


def _read(path: Path, options: Options) -> Run:
    recording = opened(path)
    try:
        return read_poses(recording, path, options, "cpl.logs.formats.ros2")
    finally:
        recording.close()


FORMAT = Format(
    name="ros2",
    title="ROS 2 bag: its folder (SQLite or MCAP; split, zstd-compressed), or one .db3 file",
    example="FOLDER/metadata.yaml, or SQLite format 3 (binary)",
    lacks="poses without twist (PoseStamped) have none; SLAM errors need /diagnostics",
    recognise=_recognise,
    read=_read,
    suffixes=(".db3", *ENDINGS),
    options=("--topic", "--provenance"),
)
