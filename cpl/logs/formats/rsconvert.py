"""CSV of librealsense's rs-convert: one line a frame of any stream, poses among them."""

from __future__ import annotations

from pathlib import Path

from cpl.logs.errors import MissingChannelError
from cpl.logs.formats import Format, Head, Likeness, Options
from cpl.logs.info import stated
from cpl.logs.run import Run
from cpl.logs.sieve import QUATERNION
from cpl.logs.text import Layout, Stamp, clean_lines, read_layout

__all__ = ["FORMAT"]

_TIMES = ("hw timestamp (ms)", "backend timestamp(ms)", "host timestamp(ms)")
_POSE = ("3dof_x", "3dof_y", "3dof_z", "6dof_x", "6dof_y", "6dof_z", "6dof_w")
_STREAMS = ("gyro", "accel", "depth", "color", "infrared", "fisheye", "confidence")


def _names(line: str) -> list[str]:
    return [each.strip().lower() for each in line.split(",")]


def _recognise(head: Head) -> Likeness:
    if not head.rows:
        return Likeness(0.0, "is no text")
    names = _names(head.rows[0])
    if set(_POSE) <= set(names) and "stream type" in names:
        return Likeness(1.0, "its header has Stream Type and 6DOF")
    if "stream type" in names:
        return Likeness(0.45, "its header has Stream Type, but no 3DOF and 6DOF: no poses in it")
    return Likeness(0.0, "its header has no Stream Type and 6DOF")


def _read(path: Path, options: Options) -> Run:
    lines = clean_lines(path, 20)
    at = next((n for n, line in enumerate(lines) if "6dof" in line.lower()), -1)
    names = _names(lines[at]) if at >= 0 else []
    time = next((name for name in _TIMES if name in names), None)
    if time is None or not {"stream type", *_POSE} <= set(names):
        raise MissingChannelError(
            "has no header with Stream Type, 3DOF, 6DOF and a time", path=path
        )
    axes = options.axes or "t265"
    kind = names.index("stream type")
    notes = [
        f"lines of Pose, time from {lines[at].split(',')[names.index(time)].strip()}; axes {axes}",
        "no twist and no confidence, because rs-convert does not write them",
    ]
    source = {"importer": "cpl.logs.formats.rsconvert", "axes": axes}
    info = stated({}, options.provenance, path, source, silent=options.silent)
    places = dict(zip(("x_m", "y_m", "z_m", *QUATERNION), _POSE, strict=True))
    layout = Layout(
        importer="cpl.logs.formats.rsconvert",
        columns={name: (names.index(there), 1.0) for name, there in places.items()},
        stamp=Stamp(place=names.index(time), power=3),
        first=at + 2,
        only=lambda cells: _is_pose(cells[kind] if len(cells) > kind else ""),
        axes=None if options.axes else "t265",
    )
    return read_layout(path, options, layout, info, notes)


def _is_pose(kind: str) -> bool | None:
    """Tell whether a line is a pose's; None if it is of no stream that there is."""
    kind = kind.strip().lower()
    return kind == "pose" if kind == "pose" or kind in _STREAMS else None


FORMAT = Format(
    name="rsconvert",
    title="CSV of rs-convert (librealsense), with a T265's poses",
    example=(
        "Stream Type,F#,HW Timestamp (ms),Backend Timestamp(ms),Host Timestamp(ms),"
        "3DOF_x,3DOF_y,3DOF_z,6DOF_x,6DOF_y,6DOF_z,6DOF_w\nPose,0,1700000000000.0,..."
    ),
    lacks="no twist, no confidence: absent. Axes: the T265's, turned into ROS's",
    recognise=_recognise,
    read=_read,
    suffixes=(".csv",),
    options=("--axes",),
)
