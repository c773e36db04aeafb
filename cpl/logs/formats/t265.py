"""T265 poses as scripts around pyrealsense2 save them: one column a field, under many names."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from cpl.logs.errors import MissingChannelError
from cpl.logs.formats import Format, Head, Likeness, Options
from cpl.logs.info import stated
from cpl.logs.run import Run
from cpl.logs.text import Layout, Stamp, clean_lines, read_layout, time_power

__all__ = ["FORMAT"]

RATE_HZ = 200.0  # of the T265's poses
_AXES = "xyzw"
_WORDS = {
    "position": ("translation", "position", "pos", "trans", "tra", "p", "t", ""),
    "quaternion": ("rotation", "orientation", "quaternion", "quat", "rot", "q"),
}
_TIMES = ("timestamp", "time", "t", "ts", "stamp", "hosttimestamp", "devicetimestamp")
_UNITS = {"s": 0, "sec": 0, "ms": 3, "us": 6, "ns": 9}


def _plain(name: str) -> tuple[str, str]:
    """Return a column's name without case and signs, and the unit in brackets or behind _."""
    match = re.fullmatch(r"\s*(.*?)\s*(?:[\[(]\s*(\w+)\s*[\])]|_(ms|us|ns|sec|s))?\s*", name)
    base, unit = (match[1], match[2] or match[3] or "") if match else (name, "")
    return re.sub(r"[^a-z0-9]", "", base.lower()), unit.lower()


def _places(names: list[str]) -> dict[str, int]:
    """Return the places of the columns that are known, by their names in `cpl.logs.COLUMNS`."""
    plain = [_plain(name)[0] for name in names]
    found: dict[str, int] = {}
    for kind, prefix, axes in (("position", "", "xyz"), ("quaternion", "q", "xyzw")):
        for word in _WORDS[kind]:
            wanted = [[f"{word}{axis}", f"{axis}{word}"] for axis in axes]
            there = [next((plain.index(n) for n in each if n in plain), -1) for each in wanted]
            if min(there) >= 0:
                suffix = "_m" if kind == "position" else ""
                found |= {f"{prefix}{a}{suffix}": at for a, at in zip(axes, there, strict=True)}
                break
    for name in ("trackerconfidence", "trackerconf", "confidence", "conf"):
        if name in plain:
            found["confidence"] = plain.index(name)
            break
    return found


def _time(names: list[str]) -> int | None:
    plain = [_plain(name)[0] for name in names]
    return next((plain.index(name) for name in _TIMES if name in plain), None)


def _separator(line: str) -> str:
    return max(",;\t", key=line.count)


_POSE = {"x_m", "y_m", "z_m", "qx", "qy", "qz", "qw"}


def _recognise(head: Head) -> Likeness:
    if not head.rows:
        return Likeness(0.0, "is no text")
    names = head.rows[0].split(_separator(head.rows[0]))
    places = _places(names)
    told = " ".join(_plain(name)[0] for name in names)
    if "confidence" not in places or not ("tracker" in told or "mapper" in told):
        return Likeness(0.0, "has no column tracker_confidence")
    if not places.keys() >= _POSE:
        lacking = ", ".join(sorted(_POSE - places.keys()))
        return Likeness(0.45, f"has a tracker confidence, but no column for {lacking}")
    return Likeness(0.9, "has a pose and the T265's tracker confidence")


def _read(path: Path, options: Options) -> Run:
    lines = clean_lines(path, 200)
    at = next((n for n, each in enumerate(lines) if each.strip() and not each.startswith("#")), -1)
    separator = _separator(lines[at]) if at >= 0 else ","
    names = lines[at].split(separator) if at >= 0 else []
    places, time = _places(names), _time(names)
    if not places.keys() >= _POSE:
        what = f"has no column for {', '.join(sorted(_POSE - places.keys()))}"
        raise MissingChannelError(what, path=path)
    axes = options.axes or "t265"
    notes = [
        f"axes {axes}",
        "no twist: velocities are not read, because turn rates are often absent",
    ]
    stamp = None
    if time is not None:
        rows = [line.split(separator) for line in lines[at + 1 : at + 101] if line.strip()]
        power, why = _power(names[time], rows, time)
        stamp = Stamp(place=time, power=power)
        notes.append(f"times from {names[time].strip()!r}, which counts 10^-{power} s ({why})")
    elif options.times is None and options.pose_rate_hz is None:
        rate = RATE_HZ
        options = Options(**{**vars(options), "pose_rate_hz": rate})
        notes.append(f"times derived: it has none, and a T265 gives {rate:g} poses a second")
    others = [n for at, n in enumerate(names) if at not in (*places.values(), time)]
    if others:
        notes.append(f"columns that were not read: {', '.join(others[:20])}")
    source = {"importer": "cpl.logs.formats.t265", "axes": axes}
    info = stated({}, options.provenance, path, source, silent=options.silent)
    layout = Layout(
        importer="cpl.logs.formats.t265",
        columns={name: (place, 1.0) for name, place in places.items()},
        stamp=stamp,
        separator=separator,
        first=at + 2,
        axes=None if options.axes else "t265",
    )
    return read_layout(path, options, layout, info, notes)


def _power(name: str, rows: list[list[str]], place: int) -> tuple[int, str]:
    """Return what a time column counts, and how that is known."""
    unit = _plain(name)[1]
    if unit in _UNITS:
        return _UNITS[unit], "its name says so"
    times: list[float] = []
    for row in rows:
        try:
            times.append(float(row[place]))
        except (ValueError, IndexError):
            continue
    if times and (power := time_power(str(times[0]))):
        return power, "by the size of a date"
    step = float(np.median(np.abs(np.diff(times)))) if len(times) > 1 else 1.0
    for power in (0, 3, 6, 9):
        if 1e-3 < step / 10**power < 1.0:
            return power, "by the step from row to row"
    return 0, "nothing says otherwise"


FORMAT = Format(
    name="t265",
    title="T265 poses as scripts around pyrealsense2 save them",
    example=(
        "timestamp_ms,translation_x,translation_y,translation_z,rotation_x,rotation_y,rotation_z,"
        "rotation_w,tracker_confidence,mapper_confidence"
    ),
    lacks="times, if it has none, are 200 Hz. Velocities are not read. Axes: the T265's",
    recognise=_recognise,
    read=_read,
    suffixes=(".csv", ".txt"),
    options=("--axes", "--times", "--pose-rate"),
)
