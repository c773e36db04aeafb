"""Read a pose recording from a CSV table.

Comma-separated, UTF-8, a header line with the columns of `cpl.logs.COLUMNS`. The end of a name is
its unit, so `x_mm` or `t_ms` is understood and converted, and a bare `x` is refused. Lines such as
``# provenance: real-Go1`` and ``# axes: ros`` above the header say what a reader must know.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Iterator
from dataclasses import replace
from decimal import Decimal, InvalidOperation
from pathlib import Path
from typing import Any

import numpy as np

from cpl.logs.axes import chosen_axes, to_ros
from cpl.logs.checks import Sieve
from cpl.logs.codec import NS
from cpl.logs.errors import (
    DamagedLogError,
    DuplicateChannelError,
    FrameError,
    LogError,
    MissingChannelError,
    NotFiniteError,
    SchemaError,
    UnitError,
)
from cpl.logs.info import stated
from cpl.logs.reader import content, finished
from cpl.logs.run import Run
from cpl.logs.schema import CHANNELS, COLUMNS

__all__ = ["read_csv"]

# Unit -> (the unit that logs hold, how many of those it is).
UNITS: dict[str, tuple[str, float]] = {
    "s": ("s", 1), "ms": ("s", 1e-3), "us": ("s", 1e-6), "ns": ("s", 1e-9),
    "m": ("m", 1), "cm": ("m", 1e-2), "mm": ("m", 1e-3),
    "rad": ("rad", 1), "deg": ("rad", math.pi / 180),
    "mps": ("mps", 1), "cmps": ("mps", 1e-2), "mmps": ("mps", 1e-3), "kmph": ("mps", 1 / 3.6),
    "radps": ("radps", 1), "degps": ("radps", math.pi / 180),
}  # fmt: skip
_QUATERNION = ("qx", "qy", "qz", "qw")
_TEXTS = {each.column for channel in CHANNELS for each in channel.fields if each.kind == "text"}
_NULLABLE = {each.column for channel in CHANNELS for each in channel.fields if each.nullable}
_LONG_AGO_S = 1e8  # [s] a time beyond is counted from 1970


def read_csv(path: Path, *, provenance: str | None = None, axes: str | None = None) -> Run:
    """Read a CSV recording.

    Args:
        path: The file.
        provenance: Where it comes from, if the file does not say.
        axes: `ros` or `t265`, if the file does not say.

    Raises:
        LogError: One of its kinds.
    """
    data = content(path)
    sieve, notes = Sieve(), list[str]()
    lines = _lines(data, path, sieve)
    said, first = _comments(lines, path)
    convention = chosen_axes(axes, said.get("axes"), path)
    if first >= len(lines):
        raise MissingChannelError("has no header line", path=path)
    columns = _header(lines[first], path, notes)
    width = len(next(csv.reader([lines[first]])))
    planar = "yaw_rad" in columns and not any(name in columns for name in ("z_m", *_QUATERNION))
    _needed(columns, planar, path)
    if planar:
        notes.append("planar: height 0 and the attitude follows from the heading")
    info = stated(said, provenance, path, "cpl.logs.from_csv")
    rows, start = 0, None
    for line, cells in _cells(lines[first + 1 :], first + 2):
        where, rows = f"line {line}", rows + 1
        try:
            if len(cells) > width and any(cells[width:]):  # a decimal comma is a cell too many
                what = f"has {len(cells)} cells, the header has {width}"
                raise _BadCellError(SchemaError, what)
            row, start = _row(cells, columns, start, planar)
            number = int(row.pop("row", rows - 1))
            if sieve.numbers and number <= sieve.numbers[-1]:
                what = f"row must grow, got {number} after {sieve.numbers[-1]}"
                raise _BadCellError(DuplicateChannelError, what)
        except _BadCellError as error:
            sieve.drop(error.error, where, str(error))
            continue
        if convention == "t265":
            row = _turned(row, path)
        sieve.offer_raw(number, row, where)
    have = set(columns) | {"yaw_rad"} | ({"z_m", *_QUATERNION} if planar else set())
    topics = tuple(each.topic for each in CHANNELS if set(each.columns) <= have)
    if start is not None and not info.start_unix_ns:
        info = replace(info, start_unix_ns=max(start, 0))
    return finished(sieve, info, path, notes, size=len(data), topics=topics, written=rows)


class _BadCellError(Exception):
    def __init__(self, error: type[LogError], what: str) -> None:
        super().__init__(what)
        self.error = error


def _lines(data: bytes, path: Path, sieve: Sieve) -> list[str]:
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data[: error.start].count(b"\n") + 1
        raise DamagedLogError("is not UTF-8 text", path=path, where=f"line {line}") from error
    lines = text.splitlines()
    if not text.endswith(("\n", "\r")):
        what = "the last line has no end, so its last number may be cut; it was dropped"
        sieve.drop(DamagedLogError, f"line {len(lines)}", what, rows=0)
        lines.pop()
    return lines


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


def _header(line: str, path: Path, notes: list[str]) -> dict[str, tuple[int, float]]:
    """Return for each known column its place and the factor of its unit."""
    columns: dict[str, tuple[int, float]] = {}
    bases = {name.rpartition("_")[0]: name for name in COLUMNS if name.rpartition("_")[2] in UNITS}
    for place, name in enumerate(each.strip() for each in next(csv.reader([line]))):
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
            notes.append(f"column {name!r} was not read")
        elif known in columns:
            raise DuplicateChannelError(f"has the column {known} twice", path=path)
        else:
            columns[known] = (place, factor)
    return columns


def _needed(columns: dict[str, tuple[int, float]], planar: bool, path: Path) -> None:
    pose = ("yaw_rad",) if planar else ("z_m", *_QUATERNION)
    for name in ("t_s", "x_m", "y_m", *pose):
        if name not in columns:
            raise MissingChannelError(f"has no column {name}", path=path)
    for channel in CHANNELS:
        lacking = [name for name in channel.columns if name not in columns]
        if not channel.required and 0 < len(lacking) < len(channel.columns):
            what = f"has some columns of {channel.topic}, but no {lacking[0]}"
            raise MissingChannelError(what, path=path)


def _cells(lines: list[str], first: int) -> Iterator[tuple[int, list[str]]]:
    for number, line in enumerate(lines, start=first):
        if line.strip():
            yield number, next(csv.reader([line]))


def _row(
    cells: list[str], columns: dict[str, tuple[int, float]], start: int | None, planar: bool
) -> tuple[dict[str, Any], int]:
    width = max(place for place, _ in columns.values()) + 1
    if len(cells) < width:
        raise _BadCellError(SchemaError, f"has {len(cells)} cells, at least {width} are needed")
    place, factor = columns["t_s"]
    # A float would round a time counted from 1970 to a quarter of a microsecond.
    t_ns = int(_decimal(cells[place], "t_s") * Decimal(repr(factor)) * NS)
    if start is None:
        start = t_ns if t_ns > _LONG_AGO_S * NS else 0
    row: dict[str, Any] = {"t_s": (t_ns - start) / NS}
    for name, (at, scale) in columns.items():
        if name in _TEXTS:
            row[name] = cells[at]
        elif name != "t_s":
            text = cells[at].strip()
            empty = name in _NULLABLE and text == ""
            row[name] = math.nan if empty else _number(text, name, scale)
    if planar:
        half = row["yaw_rad"] / 2
        row |= {"z_m": 0.0, "qx": 0.0, "qy": 0.0, "qz": math.sin(half), "qw": math.cos(half)}
    return row, start


def _decimal(text: str, name: str) -> Decimal:
    try:
        value = Decimal(_plain(text))
    except (InvalidOperation, ValueError) as error:
        raise _BadCellError(SchemaError, f"{name} must be a number, got {text!r}") from error
    if not value.is_finite() or abs(value) > Decimal(10) ** 20:
        raise _BadCellError(NotFiniteError, f"{name} must be finite, got {text!r}")
    return value


def _number(text: str, name: str, scale: float) -> float:
    try:
        value = float(_plain(text))
    except ValueError as error:
        raise _BadCellError(SchemaError, f"{name} must be a number, got {text!r}") from error
    return value if scale == 1 else value * scale


def _plain(text: str) -> str:
    """Refuse what only Python takes for a number: 1_000."""
    if "_" in text:
        raise ValueError(text)
    return text.strip()


def _turned(row: dict[str, Any], path: Path) -> dict[str, Any]:
    """Return a row in ROS's axes."""
    if "v_x_mps" in row or "yaw_rad" in row:
        what = "planar twists and headings have no meaning in the T265's axes, where y is up"
        raise FrameError(what, path=path)
    position = np.array([[row["x_m"], row["y_m"], row["z_m"]]])
    quaternion = np.array([[row[name] for name in _QUATERNION]])
    if not np.linalg.norm(quaternion) > 0:
        return row
    moved, turned, _, _ = to_ros(position, quaternion, position, position)
    names = ("x_m", "y_m", "z_m", *_QUATERNION)
    return row | dict(zip(names, [*moved[0].tolist(), *turned[0].tolist()], strict=True))
