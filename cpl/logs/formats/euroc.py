"""EuRoC's ground truth and state estimates: nanoseconds, w first, velocity in the world."""

from __future__ import annotations

from pathlib import Path

from cpl.logs.errors import MissingChannelError
from cpl.logs.formats import Format, Head, Likeness, Options
from cpl.logs.info import stated
from cpl.logs.run import Run
from cpl.logs.text import Layout, Stamp, clean_lines, read_layout

__all__ = ["FORMAT"]

_POSITION = ("p_rs_r_x", "p_rs_r_y", "p_rs_r_z")
_QUATERNION = ("q_rs_x", "q_rs_y", "q_rs_z", "q_rs_w")


def _names(line: str) -> list[str]:
    return [each.strip().lower().split("[")[0].strip() for each in line.lstrip("#").split(",")]


def _recognise(head: Head) -> Likeness:
    for line in head.lines[:20]:
        names = _names(line)
        if set(_POSITION) <= set(names) and set(_QUATERNION) <= set(names):
            return Likeness(1.0, "its header names p_RS_R and q_RS")
    if any("p_rs_r" in line.lower() for line in head.lines[:20]):
        return Likeness(0.45, "its header names p_RS_R, but not all of position and q_RS")
    return Likeness(0.0, "no header names p_RS_R and q_RS")


def _read(path: Path, options: Options) -> Run:
    lines = clean_lines(path, 20)
    at = next((n for n, line in enumerate(lines) if "p_rs_r" in line.lower()), -1)
    names = _names(lines[at]) if at >= 0 else []
    for name in ("timestamp", *_POSITION, *_QUATERNION):
        if name not in names:
            raise MissingChannelError(f"has no column {name}", path=path)
    columns = {
        "x_m": _POSITION[0], "y_m": _POSITION[1], "z_m": _POSITION[2],
        "qx": _QUATERNION[0], "qy": _QUATERNION[1], "qz": _QUATERNION[2], "qw": _QUATERNION[3],
    }  # fmt: skip
    others = [name for name in names if name not in (*columns.values(), "timestamp")]
    notes = ["body is EuRoC's sensor S, whose x need not point forward; world z up"]
    if others:
        notes.append(f"columns that were not read: {', '.join(others[:20])}")
    notes.append(
        "no twist: the velocity is there, the turn rate is not; no confidence, as EuRoC has none"
    )
    source = {"importer": "cpl.logs.formats.euroc", "axes": options.axes or "ros"}
    info = stated({}, options.provenance, path, source, silent=options.silent)
    layout = Layout(
        importer="cpl.logs.formats.euroc",
        columns={name: (names.index(there), 1.0) for name, there in columns.items()},
        stamp=Stamp(place=names.index("timestamp"), power=9),
        first=at + 2,
        width=len(names),
        axes=None if options.axes else "ros",
    )
    return read_layout(path, options, layout, info, notes)


FORMAT = Format(
    name="euroc",
    title="EuRoC state_groundtruth_estimate0/data.csv",
    example=(
        "#timestamp, p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], q_RS_x [], q_RS_y [], "
        "q_RS_z [], ..."
    ),
    lacks="no turn rate and so no twist, no confidence: absent",
    recognise=_recognise,
    read=_read,
    suffixes=(".csv",),
    options=("--axes", "--unit"),
)
