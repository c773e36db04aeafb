"""MCAP of any program but ours: ROS 1 and 2 messages, and Foxglove's poses in JSON."""

from __future__ import annotations

from pathlib import Path

from cpl.logs.formats import Format, Head, Likeness, Options
from cpl.logs.poses import read_poses
from cpl.logs.recording import McapFiles
from cpl.logs.run import Run
from cpl.logs.salvage import MAGIC

__all__ = ["FORMAT"]


def _recognise(head: Head) -> Likeness:
    if head.data.startswith(MAGIC):
        return Likeness(0.9, "begins as MCAP does")
    return Likeness(0.0, "does not begin as MCAP does")


def _read(path: Path, options: Options) -> Run:
    recording = McapFiles([path])
    try:
        return read_poses(recording, path, options, "cpl.logs.formats.mcap")
    finally:
        recording.close()


FORMAT = Format(
    name="mcap",
    title="MCAP of any program: ROS 2, ROS 1 or Foxglove JSON; also cut short or without summary",
    example="\\x89MCAP0 (binary)",
    lacks="poses without twist have none; SLAM errors need /diagnostics",
    recognise=_recognise,
    read=_read,
    suffixes=(".mcap",),
    options=("--topic", "--provenance"),
)
