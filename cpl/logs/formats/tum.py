"""TUM trajectories: a time, a position and an attitude a line, as most SLAM systems write."""

from __future__ import annotations

from pathlib import Path

from cpl.logs.errors import MissingChannelError
from cpl.logs.formats import Format, Head, Likeness, Options
from cpl.logs.info import stated
from cpl.logs.run import Run
from cpl.logs.sieve import QUATERNION
from cpl.logs.text import Layout, Stamp, clean_lines, read_layout, time_power

__all__ = ["FORMAT"]

NAMES = ("timestamp", "tx", "ty", "tz", "qx", "qy", "qz", "qw")
_TIMES = ("timestamp", "time", "t", "stamp")
_LOOKED_AT = 100  # lines


def _separator(line: str) -> str | None:
    return next((each for each in (",", ";") if each in line), None)


def _header(line: str) -> list[str]:
    """Return the names of a header line in lower case; none of a line of numbers."""
    names = [each.strip().lower() for each in line.lstrip("# ").split(_separator(line))]
    return names if any(any(c.isalpha() for c in name if c != "e") for name in names) else []


def _numbers(line: str) -> int:
    """Return how many numbers a line has; 0 if not all of it is numbers."""
    cells = line.split(_separator(line))
    try:
        return len([float(cell) for cell in cells])
    except ValueError:
        return 0


def _recognise(head: Head) -> Likeness:
    rows = head.rows[:_LOOKED_AT]
    if not rows:
        return Likeness(0.0, "is no text")
    names = _header(rows[0])
    if names:
        if names[1:8] == list(NAMES[1:]) and names[0].split("[")[0].strip() in _TIMES:
            return Likeness(0.95, "has TUM's eight names as its header")
        return Likeness(0.0, "begins with other names than timestamp tx ty tz qx qy qz qw")
    counts = [_numbers(row) for row in rows]
    eight = sum(count == 8 for count in counts) / len(counts)
    if eight > 0.9:
        unit = [_is_unit(row) for row, count in zip(rows, counts, strict=True) if count == 8]
        if sum(unit) > 0.5 * len(unit):
            return Likeness(0.9, "eight numbers a line, the last four a unit quaternion")
        return Likeness(0.45, "eight numbers a line, but the last four are no unit quaternion")
    if eight > 0.3:
        return Likeness(0.45, f"only {eight:.0%} of its lines are eight numbers")
    return Likeness(0.2 * (max(counts) == 8), "its lines are not eight numbers")


def _is_unit(row: str) -> bool:
    cells = [float(cell) for cell in row.split(_separator(row))][4:]
    return abs(sum(cell * cell for cell in cells) ** 0.5 - 1) < 0.01


def _read(path: Path, options: Options) -> Run:
    lines = clean_lines(path, 1000)
    at = next((n for n, each in enumerate(lines) if each.strip() and not each.startswith("#")), -1)
    if at < 0:
        raise MissingChannelError("has no line with a pose", path=path)
    notes = [
        "TUM says neither which way its axes point nor who wrote it: taken as ROS's unless --axes "
        "says otherwise"
    ]
    if options.quaternion is None:
        notes.append("attitudes read as x, y, z, w, as TUM has it (--quaternion wxyz for others)")
    notes.append("no twist and no confidence, because TUM has none")
    axes = options.axes or "ros"
    begin = at + bool(_header(lines[at]))
    power = time_power(lines[begin].split(_separator(lines[at]))[0] if begin < len(lines) else "0")
    if power:
        notes.append(f"its times count 10^-{power} s, by their size")
    info = stated(
        {},
        options.provenance,
        path,
        {"importer": "cpl.logs.formats.tum", "axes": axes},
        silent=options.silent,
    )
    columns = dict(zip(("x_m", "y_m", "z_m", *QUATERNION), range(1, 8), strict=True))
    layout = Layout(
        importer="cpl.logs.formats.tum",
        columns={name: (place, 1.0) for name, place in columns.items()},
        stamp=Stamp(place=0, power=power),
        separator=_separator(lines[at]),
        first=begin + 1,
        width=8,
        axes=None if options.axes else "ros",
    )
    return read_layout(path, options, layout, info, notes)


FORMAT = Format(
    name="tum",
    title="TUM trajectory (evo, ORB-SLAM and most SLAM systems): blanks or commas, header or none",
    example="# timestamp tx ty tz qx qy qz qw\n1311868164.363 0.01 0.02 0.00 0.0 0.0 0.0 1.0",
    lacks="no twist, no confidence: absent. Axes: taken as ROS's; --axes says otherwise",
    recognise=_recognise,
    read=_read,
    suffixes=(".tum", ".txt", ".csv"),
    options=("--axes", "--quaternion", "--unit"),
)
