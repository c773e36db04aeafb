"""CSV with the columns of `cpl.logs.COLUMNS`, the unit behind each name: our own, and anybody's.

A header line, separated by commas, semicolons or tabs. The end of a name is its unit, so `x_mm` or
`t_ms` is understood and converted, and a bare `x` is refused. Lines such as
``# provenance: real-Go1`` and ``# axes: ros`` above the header say what a reader must know.
"""

from __future__ import annotations

import csv
import math
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cpl.logs.budget import MOST_COLUMNS
from cpl.logs.errors import (
    DuplicateChannelError,
    LogError,
    MissingChannelError,
    NotALogError,
    UnitError,
)
from cpl.logs.formats import Format, Head, Likeness, Options
from cpl.logs.info import stated
from cpl.logs.run import Run
from cpl.logs.schema import CHANNELS, COLUMNS, FIELDS
from cpl.logs.sieve import QUATERNION
from cpl.logs.text import Layout, Stamp, clean_lines, read_layout

__all__ = ["FORMAT", "UNITS"]

# Unit -> (the unit that logs hold, how many of those it is).
UNITS: dict[str, tuple[str, float]] = {
    "s": ("s", 1), "ms": ("s", 1e-3), "us": ("s", 1e-6), "ns": ("s", 1e-9),
    "m": ("m", 1), "cm": ("m", 1e-2), "mm": ("m", 1e-3),
    "rad": ("rad", 1), "deg": ("rad", math.pi / 180),
    "mps": ("mps", 1), "cmps": ("mps", 1e-2), "mmps": ("mps", 1e-3), "kmph": ("mps", 1 / 3.6),
    "radps": ("radps", 1), "degps": ("radps", math.pi / 180),
}  # fmt: skip
_POWERS = {1: 0, 1e-3: 3, 1e-6: 6, 1e-9: 9}
HEAD_LINES = 1000  # above the header
Array = NDArray[np.float64]
_Bad = list[tuple[NDArray[np.bool], type[LogError], str]]


def _separator(line: str) -> str:
    return max(",;\t", key=line.count)


def _cells(line: str, separator: str, path: Path) -> list[str]:
    if line.count(separator) >= MOST_COLUMNS:
        what = f"has {line.count(separator) + 1} columns; the most that is read is {MOST_COLUMNS}"
        raise NotALogError(what, path=path)
    try:
        return [each.strip() for each in next(csv.reader([line], delimiter=separator))]
    except csv.Error as error:
        raise NotALogError(f"its header cannot be read ({error})", path=path) from error


def _recognise(head: Head) -> Likeness:
    if not head.rows:
        said = {line[1:].partition(":")[0].strip() for line in head.lines}
        if said & {"provenance", "axes"}:
            return Likeness(0.6, "states its provenance or axes, though it has no header")
        return Likeness(0.0, "is no text, or comments only")
    line = head.rows[0]
    names = [each.strip().strip('"') for each in line.split(_separator(line))]
    stems = {name.rpartition("_")[0] or name for name in names}
    known = stems & {name.rpartition("_")[0] or name for name in COLUMNS}
    if len(names) > 1 and "t" in stems and {"x", "y"} <= stems:
        return Likeness(0.8, "its header names t, x and y")
    if len(names) > 1 and known:
        return Likeness(0.6, f"its header names {', '.join(sorted(known)[:5])}")
    if len(names) > 1:
        lacking = "its header names no column of a log: t_s, x_m, y_m, z_m, qx, qy, qz, qw"
        return Likeness(0.3, lacking)
    return Likeness(0.0, "its first line is no header")


def _read(path: Path, options: Options) -> Run:
    lines = clean_lines(path, HEAD_LINES)
    said, at = _comments(lines, path)
    if at >= len(lines):
        raise MissingChannelError("has no header line", path=path)
    separator, notes = _separator(lines[at]), list[str]()
    names = _cells(lines[at], separator, path)
    columns = _header(names, path, notes)
    planar = "yaw_rad" in columns and not any(name in columns for name in ("z_m", *QUATERNION))
    _needed(columns, planar, path)
    if planar:
        notes.append("planar: height 0 and the attitude follows from the heading")
    if separator != ",":
        notes.append(f"cells are separated by {separator!r}")
    comma = separator != "," and _decimal_comma(lines[at + 1 : at + 50], separator)
    if comma:
        notes.append("numbers are written with a decimal comma")
    source = {"importer": "cpl.logs.formats.csv"}
    info = stated(said, options.provenance, path, source, silent=options.silent)
    place, factor = columns.pop("t_s")
    number = columns.pop("row", (None, 1.0))[0]
    texts = {name: columns.pop(name)[0] for name in list(columns) if FIELDS[name].kind == "text"}
    layout = Layout(
        importer="cpl.logs.formats.csv",
        columns=columns,
        stamp=Stamp(place=place, power=_POWERS[factor]),
        separator=separator,
        first=at + 2,
        width=len(names),
        texts=texts,
        number=number,
        decimal_comma=comma,
        derive=_planar if planar else None,
        axes=said.get("axes"),
    )
    return read_layout(path, options, layout, info, notes)


def _planar(read: dict[str, Array]) -> tuple[dict[str, Array], _Bad]:
    """Return poses in a plane as poses in space."""
    zero = np.zeros(len(read["x_m"]))
    with np.errstate(invalid="ignore"):
        half = read["yaw_rad"] / 2
        turn = {"qx": zero, "qy": zero, "qz": np.sin(half), "qw": np.cos(half)}
    return {**read, "z_m": zero, **turn}, []


def _comments(lines: list[str], path: Path) -> tuple[dict[str, str], int]:
    """Return what the lines above the header say, and the header's place."""
    said: dict[str, str] = {}
    for number, line in enumerate(lines):
        if not line.startswith("#"):
            return said, number
        name, colon, value = line[1:].partition(":")
        if colon and said.setdefault(name.strip(), value.strip()) != value.strip():
            what = f"{name.strip()} is stated twice, differently"
            raise DuplicateChannelError(what, path=path, where=f"line {number + 1}")
    return said, len(lines)


def _header(names: list[str], path: Path, notes: list[str]) -> dict[str, tuple[int, float]]:
    """Return for each known column its place and the factor of its unit."""
    columns: dict[str, tuple[int, float]] = {}
    unread: list[str] = []
    bases = {name.rpartition("_")[0]: name for name in COLUMNS if name.rpartition("_")[2] in UNITS}
    for place, name in enumerate(names):
        known, factor = name, 1.0
        base, _, unit = name.rpartition("_")
        if name in bases:
            what = f"column {name!r} does not say its unit: name it {bases[name]!r}"
            raise UnitError(what, path=path)
        if name not in COLUMNS and base in bases:
            known = bases[base]
            wanted = known.rpartition("_")[2]
            if unit not in UNITS or UNITS[unit][0] != wanted:
                what = f"column {name!r} has an unknown unit; wanted is {known!r} or a multiple"
                raise UnitError(what, path=path)
            factor = UNITS[unit][1]
            notes.append(f"{name} converted to {known}")
        if known not in COLUMNS and known != "row":
            unread.append(name)
        elif known in columns:
            raise DuplicateChannelError(f"has the column {known} twice", path=path)
        else:
            columns[known] = (place, factor)
    if unread:
        more = f" and {len(unread) - 20} more" if len(unread) > 20 else ""
        notes.append(f"columns that were not read: {', '.join(map(repr, unread[:20]))}{more}")
    return columns


def _needed(columns: dict[str, tuple[int, float]], planar: bool, path: Path) -> None:
    pose = ("yaw_rad",) if planar else ("z_m", *QUATERNION)
    for name in ("t_s", "x_m", "y_m", *pose):
        if name not in columns:
            raise MissingChannelError(f"has no column {name}", path=path)
    for channel in CHANNELS:
        lacking = [name for name in channel.columns if name not in columns]
        if not channel.required and 0 < len(lacking) < len(channel.columns):
            what = f"has some columns of {channel.topic}, but no {lacking[0]}"
            raise MissingChannelError(what, path=path)


def _decimal_comma(lines: list[str], separator: str) -> bool:
    cells = [cell for line in lines for cell in line.split(separator)]
    return any("," in cell for cell in cells) and not any("." in cell for cell in cells)


FORMAT = Format(
    name="csv",
    title="CSV with units in its names, as `cpl logs convert` writes it; , or ; or tab",
    example=(
        "# provenance: real-Go1\n# axes: ros\nt_s,x_m,y_m,z_m,qx,qy,qz,qw\n"
        "0.0,0.01,0.02,0.3,0.0,0.0,0.0,1.0"
    ),
    lacks="what has no column is absent. Planar: t_s,x_m,y_m,yaw_rad is enough",
    recognise=_recognise,
    read=_read,
    suffixes=(".csv", ".tsv", ".txt"),
    options=("--axes", "--provenance", "--unit", "--quaternion"),
)
