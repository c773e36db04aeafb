"""Read tables of numbers that are text: one row a line, in blocks, and each bad line by itself.

A format says where its columns stand (:class:`Layout`); this module goes through the lines. A block
of sound lines is read at once. A block with a bad line is read line by line, so that the bad one is
named and costs no other.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from decimal import Decimal, InvalidOperation
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cpl.logs.axes import chosen_axes, turned_rows
from cpl.logs.budget import LONGEST_LINE, PIECE
from cpl.logs.clock import LAST_NS
from cpl.logs.errors import (
    DamagedLogError,
    DuplicateChannelError,
    FrameError,
    LogError,
    MissingChannelError,
    NotALogError,
    NotFiniteError,
    RangeError,
    SchemaError,
)
from cpl.logs.finish import finished
from cpl.logs.formats import Options
from cpl.logs.info import RunInfo
from cpl.logs.run import Run
from cpl.logs.schema import CHANNELS, FIELDS
from cpl.logs.sieve import QUATERNION, Sieve
from cpl.logs.source import Source

__all__ = [
    "Layout",
    "Stamp",
    "clean_lines",
    "line_blocks",
    "read_layout",
    "stamp_ns",
    "time_power",
    "times_of",
]

BLOCK = 8192  # lines
TOO_LONG, NOT_UTF8 = "\0too long", "\0not UTF-8"
Array = NDArray[np.float64]
Columns = dict[str, Array]
Bad = tuple[NDArray[np.bool], type[LogError], str]
Named = list[tuple[int, str]]


@dataclass(frozen=True, kw_only=True)
class Stamp:
    """Where the time stands.

    Attributes:
        place: Its column.
        power: It counts seconds times ten to minus this, so 0 for seconds and 9 for nanoseconds.
    """

    place: int
    power: int = 0


@dataclass(frozen=True, kw_only=True)
class Layout:
    """How a table is laid out.

    Attributes:
        importer: What is noted as having read it.
        columns: Place of each column that is read, by name, and the factor of its unit.
        stamp: Where the time is; None where rows have none.
        separator: Between cells; None for blanks.
        first: Number of the first line of data, from 1.
        width: Most cells that a line has; None where more are ignored.
        texts: Place of each column of words.
        number: Place of the row's number; None to count.
        comment: What a line begins with that is not data.
        decimal_comma: Whether numbers are written with a comma.
        only: Says of a line whether it is a row, is none, or (None) should be one and is not; None
            where every line is a row.
        derive: Makes the columns of `cpl.logs.COLUMNS` of those that were read, and says which rows
            are bad; None where they are the same.
        axes: The convention of the columns; None to leave it to the options.
        origin_stated: Whether times count from the start that the file states.
    """

    importer: str
    columns: dict[str, tuple[int, float]]
    stamp: Stamp | None
    separator: str | None = ","
    first: int = 1
    width: int | None = None
    texts: dict[str, int] = field(default_factory=dict)
    number: int | None = None
    comment: str = "#"
    decimal_comma: bool = False
    only: Callable[[list[str]], bool | None] | None = None
    derive: Callable[[Columns], tuple[Columns, list[Bad]]] | None = None
    axes: str | None = None


class _BadCellError(Exception):
    """A cell that is not what it should be. Its words are put together only if they are shown."""

    def __init__(self, error: type[LogError], what: str, text: str | None = None) -> None:
        super().__init__(what)
        self.error, self._text = error, text

    def __str__(self) -> str:
        what = self.args[0]
        return what if self._text is None else f"{what}, got {_short(self._text)}"


def read_layout(
    path: Path, options: Options, layout: Layout, info: RunInfo, notes: list[str]
) -> Run:
    """Read a table.

    Args:
        path: The file.
        options: What its reader knows; `axes`, `unit`, `quaternion`, `times`, `pose_rate_hz`.
        layout: Where things stand.
        info: What describes the run.
        notes: What was done so far.

    Raises:
        LogError: One of its kinds.
    """
    sieve = Sieve("line {}")
    rows = _Rows(path, options, layout, sieve, notes)
    with Source.open(path) as source:
        for first, lines in line_blocks(source, sieve):
            rows.block(first, lines)
            if sieve.full:
                notes.append("the lines behind that are not counted")
                break
        size = source.size
    rows.finish()
    have = {*rows.have, "t_s", "yaw_rad", *layout.texts}
    return finished(
        sieve,
        info,
        path,
        notes,
        size=size,
        topics=tuple(each.topic for each in CHANNELS if set(each.columns) <= have),
        written=None if sieve.full else rows.count,
        origin="dated",
        unit_known=options.unit is not None,
    )


def line_blocks(source: Source, sieve: Sieve | None = None) -> Iterator[tuple[int, list[str]]]:
    """Yield the lines of a file, so many at a time, each block with its first line's number.

    A line that is too long to be a row, or is not UTF-8, comes as a mark that no number is. The
    last line is left out, and said so, if it does not end: its last number may be cut.

    Args:
        source: The file.
        sieve: Where it is said; None where it does not matter.
    """
    number, rest, skipping = 1, b"", False
    lines: list[str] = []
    for piece in source.pieces(0, source.size):
        *whole, rest = (rest + piece).split(b"\n")
        for raw in whole:
            if skipping:
                skipping = False  # the end of a line that was too long
                lines.append(TOO_LONG)
            else:
                lines.append(_decoded(raw, first=number == 1 and not lines))
            if len(lines) == BLOCK:
                yield number, lines
                number, lines = number + BLOCK, []
        if len(rest) > LONGEST_LINE:
            rest, skipping = b"", True
    if lines:
        yield number, lines
        number += len(lines)
    if (rest or skipping) and sieve is not None:
        what = "the last line has no end, so its last number may be cut; it was dropped"
        sieve.drop(DamagedLogError, f"line {number}", what, rows=0)


def _decoded(raw: bytes, *, first: bool) -> str:
    try:
        text = raw.decode("utf-8-sig" if first else "utf-8")
    except UnicodeDecodeError:
        return NOT_UTF8
    return text.removesuffix("\r")


def clean_lines(path: Path, count: int) -> list[str]:
    """Return the first lines of a file, of which those up to the header or the first row are sound.

    Raises:
        DamagedLogError: One of those is not UTF-8.
        NotALogError: One of those is too long to be the head of a table.
    """
    with Source.open(path) as source:
        if source.read(0, 2) in (b"\xff\xfe", b"\xfe\xff"):
            raise NotALogError("is UTF-16 text; save it as UTF-8", path=path)
        first = next(line_blocks(source), (1, []))[1]
        if not first and source.size <= PIECE:
            first = [_decoded(source.read(0, source.size), first=True)]
    lines = first[:count]
    said = next((n for n, line in enumerate(lines) if line and not line.startswith("#")), -1)
    for number, line in enumerate(lines[: said + 1], start=1):
        if line == NOT_UTF8:
            raise DamagedLogError("is not UTF-8 text", path=path, where=f"line {number}")
        if line == TOO_LONG:
            what = f"is longer than {LONGEST_LINE} characters, which no table's head is"
            raise NotALogError(what, path=path, where=f"line {number}")
    return lines


def stamp_ns(text: str, power: int) -> int:
    """Return a time in whole nanoseconds, without the rounding that a float would make.

    Args:
        text: The time as it is written.
        power: As in :class:`Stamp`.

    Raises:
        ValueError: It is no number, or no time.

    >>> stamp_ns("1403715529.112143517", 0)
    1403715529112143517
    """
    if not _is_plain(text):
        raise ValueError(text)
    try:
        value = Decimal(text)
    except InvalidOperation as error:
        raise ValueError(text) from error
    if not value.is_finite() or value.adjusted() > 19:
        raise ValueError(text)
    exact = int(value.scaleb(9 - power).to_integral_value())
    if not -LAST_NS < exact < LAST_NS:
        raise ValueError(text)
    return exact


def time_power(text: str) -> int:
    """Return what a date counts, by its size: seconds (0), milli- (3), micro- (6), nano- (9).

    A time that is no date counts seconds.

    >>> [time_power(text) for text in ("12.5", "1700000000.5", "1700000000000", "1.7e18")]
    [0, 0, 3, 9]
    """
    try:
        size = abs(float(text))
    except ValueError:
        return 0
    return next((power for power in (9, 6, 3) if 5e8 * 10**power < size < 4e9 * 10**power), 0)


def times_of(path: Path) -> list[int]:
    """Return the times of a file with one a line [ns].

    Raises:
        LogError: It is no such file.
    """
    times: list[int] = []
    with Source.open(path) as source:
        for first, lines in line_blocks(source):
            for number, line in enumerate(lines, start=first):
                if not line.strip() or line.startswith("#"):
                    continue
                try:
                    times.append(stamp_ns(line.strip(), 0))
                except ValueError as error:
                    what = f"must be a time in seconds, got {line!r}"
                    raise SchemaError(what, path=path, where=f"line {number}") from error
    return times


class _Rows:
    """Takes block after block of lines into the sieve."""

    def __init__(
        self, path: Path, options: Options, layout: Layout, sieve: Sieve, notes: list[str]
    ) -> None:
        self.count = 0
        self.have: set[str] = set()
        self._path, self._options, self._layout = path, options, layout
        self._sieve, self._notes = sieve, notes
        self._axes = chosen_axes(options.axes, layout.axes, path)
        self._times = times_of(options.times) if options.times and not layout.stamp else None
        self._last = -1
        self._counted = layout.number is None
        self._left = 0
        self._names = list(layout.columns)
        places = [place for place, _ in layout.columns.values()]
        self._places = places
        self._factors = [factor for _, factor in layout.columns.values()]
        last = [*places, *layout.texts.values()]
        last += [layout.stamp.place] if layout.stamp else []
        last += [layout.number] if layout.number is not None else []
        self._needed = max(last) + 1
        if layout.stamp is None and self._times is None and options.pose_rate_hz is None:
            what = (
                "its poses have no times: give --times FILE (one time [s] a line) or --pose-rate "
                "HZ; times= and pose_rate_hz= in Python"
            )
            raise MissingChannelError(what, path=path)

    def block(self, first: int, lines: list[str]) -> None:
        """Take lines.

        Args:
            first: The number of the first one.
            lines: They.
        """
        layout = self._layout
        skip = max(0, layout.first - first)
        named: Named = [
            (number, line)
            for number, line in enumerate(lines[skip:], start=first + skip)
            if line.strip() and not line.startswith(layout.comment)
        ]
        for begin in range(0, len(named), BLOCK):
            self._rows(named[begin : begin + BLOCK])

    def finish(self) -> None:
        """Say what can only be said at the end."""
        if self._left:
            self._notes.append(f"{self._left} lines of other kinds were not read")
        if self._times is not None and len(self._times) != self.count:
            what = f"has {self.count} poses, {self._options.times} has {len(self._times)} times"
            raise SchemaError(what, path=self._path)

    def _rows(self, named: Named) -> None:
        cells = self._cells(named)
        try:
            # A number with underscores or another script's digits is Python's, and no table's.
            if any("_" in line or not line.isascii() for _, line in named):
                raise ValueError
            good, stamps, numbers, values, texts = self._fast(cells)
        except (ValueError, IndexError):
            good, stamps, numbers, values, texts = self._slow(cells)
        if not good:
            return
        table = np.array(values, dtype=np.float64).reshape(len(good), len(self._names))
        columns: Columns = {
            name: table[:, at] if factor == 1 else table[:, at] * factor
            for at, (name, factor) in enumerate(zip(self._names, self._factors, strict=True))
        }
        for name, words in texts.items():
            found = self._sieve.texts.setdefault(name, {})
            found.update({n: word for n, word in zip(numbers, words, strict=True) if word})
        self._offer(np.array(good), np.array(stamps), np.array(numbers), columns)

    def _cells(self, named: Named) -> list[tuple[int, list[str]]]:
        layout = self._layout
        kept: list[tuple[int, list[str]]] = []
        for number, line in named:
            if '"' in line and layout.separator:
                cells = self._unquoted(number, line)
            elif line.startswith("\0"):
                self._bad(number, DamagedLogError, line.replace("\0", "is "))
                continue
            else:
                cells = line.split(layout.separator)
            kind = True if layout.only is None else layout.only(cells)
            if kind is None:
                self._bad(number, SchemaError, f"is of a kind that there is not: {_short(line)}")
                continue
            if not kind:
                self._left += 1
                continue
            kept.append((number, cells))
        return kept

    def _unquoted(self, number: int, line: str) -> list[str]:
        try:
            return next(csv.reader([line], delimiter=self._layout.separator or " "))
        except csv.Error:  # a cell that is too long: as one cell it will be refused by its place
            return [f"line {number}"]

    def _fast(
        self, cells: list[tuple[int, list[str]]]
    ) -> tuple[list[int], list[int], list[int], list[list[float]], dict[str, list[str]]]:
        """Read a block whose lines are all sound; raise ValueError or IndexError otherwise."""
        layout, places = self._layout, self._places
        if layout.decimal_comma or layout.number is not None:
            raise ValueError
        width = layout.width
        if width is not None and any(len(row) > width for _, row in cells):
            raise ValueError
        values = [[float(row[place]) for place in places] for _, row in cells]
        if layout.stamp is None:
            stamps = [self._time(self.count + at) for at in range(len(cells))]
        else:
            place, power = layout.stamp.place, layout.stamp.power
            stamps = [stamp_ns(row[place], power) for _, row in cells]
        texts = {name: [row[place] for _, row in cells] for name, place in layout.texts.items()}
        numbers = list(range(self.count, self.count + len(cells)))
        self.count += len(cells)
        return [number for number, _ in cells], stamps, numbers, values, texts

    def _slow(
        self, cells: list[tuple[int, list[str]]]
    ) -> tuple[list[int], list[int], list[int], list[list[float]], dict[str, list[str]]]:
        """Read a block line by line."""
        good: list[int] = []
        stamps: list[int] = []
        numbers: list[int] = []
        values: list[list[float]] = []
        texts: dict[str, list[str]] = {name: [] for name in self._layout.texts}
        for line, row in cells:
            count, self.count = self.count, self.count + 1
            try:
                stamp, number, numeric = self._row(line, row, count)
            except _BadCellError as error:
                if not self._sieve.counted(error.error):
                    self._sieve.drop(error.error, f"line {line}", str(error))
                continue
            good.append(line)
            stamps.append(stamp)
            numbers.append(number)
            values.append(numeric)
            for name, place in self._layout.texts.items():
                texts[name].append(row[place])
        return good, stamps, numbers, values, texts

    def _row(self, line: int, row: list[str], count: int) -> tuple[int, int, list[float]]:
        layout = self._layout
        if len(row) < self._needed:
            what = f"has {len(row)} cells, at least {self._needed} are needed"
            raise _BadCellError(SchemaError, what)
        if layout.width is not None and any(row[layout.width :]):
            what = f"has {len(row)} cells, the header has {layout.width}"
            raise _BadCellError(SchemaError, what)
        if layout.decimal_comma:
            row = [cell.replace(",", ".") for cell in row]
        if layout.stamp is None:
            stamp = self._time(count)
        else:
            stamp = _stamp(row[layout.stamp.place], layout.stamp.power)
        numeric = [_number(row[place], name) for place, name in zip(self._places, self._names,
                                                                    strict=True)]  # fmt: skip
        return stamp, count if self._counted else self._said(row, line, count), numeric

    def _said(self, row: list[str], line: int, count: int) -> int:
        """Return the number that a row says it has."""
        place = self._layout.number or 0
        value = _number(row[place], "row")
        if not value.is_integer() or abs(value) >= 2**32:
            raise _BadCellError(SchemaError, "row must be a whole number below 2^32", row[place])
        if value < 0 and self._last < 0:
            what = f"row is {value:.0f}, below 0: the file's row numbers were left out"
            self._sieve.drop(RangeError, f"line {line}", what, rows=0)
            self._counted = True
            return count
        if value <= self._last:
            what = f"row must grow, got {value:.0f} after {self._last}"
            raise _BadCellError(DuplicateChannelError, what)
        self._last = int(value)
        return self._last

    def _time(self, count: int) -> int:
        if self._times is not None:
            return self._times[min(count, len(self._times) - 1)] if self._times else 0
        return round(count * 1e9 / (self._options.pose_rate_hz or 1.0))

    def _offer(
        self,
        places: NDArray[np.int64],
        stamps: NDArray[np.int64],
        numbers: NDArray[np.int64],
        columns: Columns,
    ) -> None:
        options, good = self._options, np.ones(len(places), dtype=bool)
        if options.quaternion == "wxyz" and self._layout.derive is None and "qx" in columns:
            parts = [columns[name] for name in QUATERNION]
            columns |= dict(zip(QUATERNION, [*parts[1:], parts[0]], strict=True))
        if self._layout.derive is not None:
            columns, bad = self._layout.derive(columns)
            for mask, error, what in bad:
                for at in np.flatnonzero(mask & good).tolist():
                    self._sieve.drop(error, f"line {places[at]}", what)
                good &= ~mask
        for name in ("x_m", "y_m", "z_m"):
            columns[name] = columns[name] * options.scale_m
        try:
            columns = turned_rows(columns, self._axes)
        except ValueError as error:
            raise FrameError(str(error), path=self._path) from error
        self.have |= set(columns)
        self._sieve.offer_block(
            numbers[good],
            places[good],
            stamps[good],
            {name: values[good] for name, values in columns.items()},
        )

    def _bad(self, line: int, error: type[LogError], what: str) -> None:
        self.count += 1
        self._sieve.drop(error, f"line {line}", what)


_NULLABLE = {name for name, each in FIELDS.items() if each.nullable}


def _stamp(text: str, power: int) -> int:
    try:
        return stamp_ns(text.strip(), power)
    except ValueError as error:
        finite = text.strip().lower().lstrip("+-") not in ("nan", "inf", "infinity")
        kind = SchemaError if finite and not _is_number(text) else NotFiniteError
        raise _BadCellError(kind, "t_s must be a time", text) from error


def _number(text: str, name: str) -> float:
    if not text.strip() and name in _NULLABLE:
        return math.nan
    try:
        if not _is_plain(text):
            raise ValueError
        return float(text)
    except ValueError as error:
        raise _BadCellError(SchemaError, f"{name} must be a number", text) from error


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return _is_plain(text)


def _is_plain(text: str) -> bool:
    """Tell whether a number is written as tables write it: Python takes 1_000 and other digits."""
    return "_" not in text and text.isascii()


def _short(text: str) -> str:
    return repr(text if len(text) <= 40 else f"{text[:40]}...")
