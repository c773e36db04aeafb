"""What `rostopic echo -p` writes: CSV with `%time` and a column for each number of a message."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cpl.logs.errors import LogError, MissingChannelError, RangeError
from cpl.logs.formats import Format, Head, Likeness, Options
from cpl.logs.info import stated
from cpl.logs.poses import ANGULAR_VELOCITY_COV, LINEAR_ACCEL_COV, confidences
from cpl.logs.run import Run
from cpl.logs.text import Layout, Stamp, clean_lines, read_layout

__all__ = ["FORMAT"]

_POSES = (
    ("field.pose.pose", "position", "orientation"),
    ("field.pose", "position", "orientation"),
    ("field.transform", "translation", "rotation"),
)
_TWIST = {
    "v_x_mps": "field.twist.twist.linear.x",
    "v_y_mps": "field.twist.twist.linear.y",
    "yaw_rate_radps": "field.twist.twist.angular.z",
}
_VARIANCES = ("field.pose.covariance0", "field.pose.covariance21")
Array = NDArray[np.float64]
_Bad = list[tuple[NDArray[np.bool], type[LogError], str]]


def _pose(names: list[str]) -> dict[str, int] | None:
    """Return the places of position and attitude, wherever the message has them."""
    for base, point, turn in _POSES:
        wanted = {f"{axis}_m": f"{base}.{point}.{axis}" for axis in "xyz"}
        wanted |= {f"q{axis}": f"{base}.{turn}.{axis}" for axis in "xyzw"}
        if set(wanted.values()) <= set(names):
            return {name: names.index(there) for name, there in wanted.items()}
    return None


def _recognise(head: Head) -> Likeness:
    first = next((line for line in head.lines if line.strip()), "")
    names = first.split(",")
    if names[0] != "%time":
        return Likeness(0.0, "does not begin with %time")
    if _pose(names) is None:
        return Likeness(0.45, "begins with %time, but has no pose: is it of another topic?")
    return Likeness(1.0, "begins with %time and has a pose")


def _read(path: Path, options: Options) -> Run:
    lines = clean_lines(path, 20)
    at = next((n for n, line in enumerate(lines) if line.startswith("%time")), -1)
    names = lines[at].split(",") if at >= 0 else []
    places = _pose(names)
    if places is None:
        raise MissingChannelError("has no header with %time and the fields of a pose", path=path)
    stamp = "field.header.stamp" if "field.header.stamp" in names else "%time"
    notes = [f"time from {stamp}"]
    twisted = set(_TWIST.values()) <= set(names)
    if twisted:
        places |= {name: names.index(there) for name, there in _TWIST.items()}
    else:
        notes.append("no twist, because the messages have none")
    covered = set(_VARIANCES) <= set(names)
    if covered:
        places |= {f"variance{n}": names.index(there) for n, there in enumerate(_VARIANCES)}
    confident = _Confident(options.linear_accel_cov, notes) if covered else None
    axes = options.axes or "ros"
    source = {"importer": "cpl.logs.formats.rostopic", "axes": axes}
    info = stated({}, options.provenance, path, source, silent=options.silent)
    layout = Layout(
        importer="cpl.logs.formats.rostopic",
        columns={name: (place, 1.0) for name, place in places.items()},
        stamp=Stamp(place=names.index(stamp), power=9),
        first=at + 2,
        comment="%",
        derive=confident,
        axes=None if options.axes else "ros",
    )
    return read_layout(path, options, layout, info, notes)


class _Confident:
    """Makes the T265's confidence of variances, if the first block says that it can be had."""

    def __init__(self, linear_accel_cov: float | None, notes: list[str]) -> None:
        self._base, self._notes = linear_accel_cov, notes
        self._known: bool | None = None

    def __call__(self, read: dict[str, Array]) -> tuple[dict[str, Array], _Bad]:
        columns = dict(read)
        first, second = columns.pop("variance0"), columns.pop("variance1")
        found = confidences(first, self._base or LINEAR_ACCEL_COV, 3)
        if self._base is None:
            again = confidences(second, ANGULAR_VELOCITY_COV, 1)
            found = np.where(found == again, found, np.nan)
        if self._known is None:
            self._known = float(np.mean(~np.isnan(found))) >= 0.5
            self._notes.append(
                "confidence from the pose's covariance: linear_accel_cov * 10^(3 - confidence)"
                if self._known
                else "the confidence cannot be had back: the covariances are not the driver's"
            )
        if not self._known:
            return columns, []
        what = "its covariances tell no confidence, and those of other rows do"
        return columns | {"confidence": found}, [(np.isnan(found), RangeError, what)]


FORMAT = Format(
    name="rostopic",
    title="rostopic echo -p TOPIC > FILE, of Odometry, PoseStamped and their like",
    example=(
        "%time,field.header.seq,field.header.stamp,field.header.frame_id,field.child_frame_id,"
        "field.pose.pose.position.x,..."
    ),
    lacks="poses without twist have none; the T265's confidence comes from its covariances",
    recognise=_recognise,
    read=_read,
    suffixes=(".csv", ".txt"),
    options=("--axes",),
)
