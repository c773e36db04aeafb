"""Read a file of scores as people have them: any delimiter, decimal commas, a clock beside them."""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cpl.forecast._text import text_of

__all__ = ["DELIMITERS", "MISSING", "Scores", "open_scores", "read_scores"]

DELIMITERS = {"tab": "\t", "semicolon": ";", "comma": ",", "blanks": " "}
"""What may stand between cells, by the name that is typed."""
MISSING = ("refuse", "carry", "drop")
"""What is done about a score that is missing: nothing, repeat the last one, leave the step out."""
BLANK = frozenset({"", "na", "n/a", "nan", "null", "none"})  # how programs write "no number"
CLOCKS = frozenset({"", "index", "step", "steps", "t", "time", "timestamp", "date", "datetime"})

Line = tuple[int, list[str]]  # its number in the file, its cells


@dataclass(frozen=True)
class Scores:
    """The scores of a file.

    Attributes:
        values: The scores, in the order of the file, shape (T,).
        column: The column's name, or its number from 1 where columns have no names.
        clock: The column beside it that only counts or tells the time; None if there is none.
        missing: How many cells were blank.
        decimal: The decimal mark, `.` or `,`.
    """

    values: NDArray[np.float64]
    column: str
    clock: str | None
    missing: int
    decimal: str


def read_scores(
    path: Path | str, column: str | None = None, *, missing: str = "refuse"
) -> NDArray[np.float64]:
    """Return the scores of a file, shape (T,); `open_scores` says more about them.

    Args:
        path: The file.
        column: Which column, by name or by number from 1; may be left out if there is only one
            beside a clock.
        missing: What is done about blank cells, one of `MISSING`.

    Raises:
        FileNotFoundError: If there is no such file.
        ValueError: As `open_scores`.
    """
    return open_scores(path, column, missing=missing).values


def open_scores(
    path: Path | str,
    column: str | None = None,
    *,
    missing: str = "refuse",
    delimiter: str | None = None,
    decimal: str | None = None,
) -> Scores:
    r"""Read scores from a table of text, plain or compressed (.gz, .bz2, .xz, .zst, .zip).

    Lines that begin with `#` are remarks. Delimiter, decimal mark and a line of names are
    recognised; where the text can be read in two ways, it is refused.

    Args:
        path: The file.
        column: Which column, by name or by number from 1; may be left out if there is only one
            beside a clock.
        missing: What is done about blank cells, one of `MISSING`.
        delimiter: One of `DELIMITERS`; recognised unless given.
        decimal: `.` or `,`; recognised unless given.

    Raises:
        FileNotFoundError: If there is no such file.
        ValueError: If it is damaged or no table of numbers, the column is not there, there are
            several to choose from, or a cell is no finite number; the message names the line.
    """
    path = Path(path)
    if missing not in MISSING:
        raise ValueError(f"missing must be one of {', '.join(MISSING)}, got {missing!r}")
    texts = _lines(text_of(path), path.name)
    rows = _cells(texts, delimiter, decimal, path.name)
    mark = decimal or ("," if _has_decimal_commas(rows) else ".")
    headed = not all(_is_blank(cell) or _is_number(cell, mark) for cell in rows[0][1])
    names = rows[0][1] if headed else [str(n) for n in range(1, len(rows[0][1]) + 1)]
    rows = rows[int(headed) :]
    if not rows:
        raise ValueError(f"{path.name} must be a table of numbers: there is only a line of names")
    clock = _clock(names, rows, mark) if len(names) == 2 else None
    place = _place(column, names, clock, path.name)
    values, blanks = _values(rows, place, mark, missing, path.name)
    beside = names[clock] if clock is not None and clock != place else None
    return Scores(values, names[place], beside, blanks, mark)


def _lines(text: str, name: str) -> list[tuple[int, str]]:
    """Return the lines with their numbers: no remarks, no blank ones at the two ends."""
    lines = [
        (number, line)
        for number, line in enumerate(re.split(r"\r\n|\r|\n", text), start=1)
        if not line.lstrip().startswith("#")
    ]
    while lines and not lines[-1][1].strip():
        lines.pop()
    first = next((place for place, (_, line) in enumerate(lines) if line.strip()), 0)
    if not lines:
        raise ValueError(f"{name} must be a table of numbers, and nothing is in it")
    return lines[first:]


def _cells(
    lines: Sequence[tuple[int, str]], delimiter: str | None, decimal: str | None, name: str
) -> list[Line]:
    """Cut lines into cells, each into as many."""
    if delimiter is not None and delimiter not in DELIMITERS:
        raise ValueError(f"delimiter must be one of {', '.join(DELIMITERS)}, got {delimiter!r}")
    between = DELIMITERS[delimiter] if delimiter else _sniffed(lines, decimal, name)
    try:
        rows = [(number, _cut(line, between)) for number, line in lines]
    except csv.Error as error:
        raise ValueError(f"{name} must be a table of numbers: {error}") from error
    width = len(rows[0][1])
    for number, row in rows:
        if len(row) == 1 and not row[0]:
            row.extend([""] * (width - 1))  # a blank line: every cell of it is missing
        if len(row) != width:
            raise ValueError(
                f"{name}, line {number}: it has {len(row)} cells, the first line {width}; "
                "every line of a table must have as many"
            )
    while width > 1 and not any(row[width - 1] for _, row in rows):  # a delimiter ends each line
        width -= 1
    return [(number, row[:width]) for number, row in rows]


def _sniffed(lines: Sequence[tuple[int, str]], decimal: str | None, name: str) -> str:
    """Find what stands between cells; empty where there is one column."""
    sample = [line for _, line in lines[:200] if line.strip()]
    headed = len(sample) > 1 and not _is_number(sample[0].strip(), ",")
    numbers = sample[int(headed) :]
    for between in "\t;":
        if sum(between in line for line in sample) > len(sample) / 2:
            return between
    if _widths(sample, " ") > 1 and all(
        _is_number(cell, ".") or _is_number(cell, ",")
        for line in numbers
        for cell in _cut(line, " ")
    ):
        return " "
    fractions = [line.strip() for line in numbers]
    if all(_is_number(line, ",") for line in fractions) and any("," in line for line in fractions):
        return _one_column_or_two(sample[0] if headed else "", fractions, decimal, name)
    if _widths(sample, ",") > 1:
        return ","
    return " " if _widths(sample, " ") > 1 else ""


def _one_column_or_two(names: str, fractions: list[str], decimal: str | None, name: str) -> str:
    """Read lines such as `0,25`: one number with a decimal comma, or two numbers?"""
    if decimal is not None:
        return "" if decimal == "," else ","
    if names:  # they have as many cells as the others
        return "," if "," in names else ""
    if any("," not in line for line in fractions):
        return ""
    raise ValueError(
        f"{name} can be read in two ways: is {fractions[0]!r} one number or two? Choose the "
        "decimal mark (, or .)"
    )


def _widths(lines: Sequence[str], between: str) -> int:
    """Return into how many cells every line falls; 1 if they differ."""
    try:
        widths = {len(_cut(line, between)) for line in lines}
    except csv.Error:
        return 1
    return widths.pop() if len(widths) == 1 else 1


def _cut(line: str, between: str) -> list[str]:
    if between == " ":
        return line.split() or [""]
    if not between:
        return [line.strip().strip('"').strip()]
    cells = next(csv.reader([line], delimiter=between, skipinitialspace=True), [""])
    return [cell.strip() for cell in cells]


def _has_decimal_commas(rows: Sequence[Line]) -> bool:
    """Say whether numbers with a comma occur, and none with a point."""
    cells = [cell for _, row in rows for cell in row]
    commas = any("," in cell and _is_number(cell, ",") for cell in cells)
    return commas and not any("." in cell and _is_number(cell, ".") for cell in cells)


def _place(column: str | None, names: list[str], clock: int | None, file: str) -> int:
    """Find the column that was meant."""
    told = ", ".join(f"{n} {name!r}" if name != str(n) else name for n, name in _numbered(names))
    if column is None:
        if clock is not None:
            return 1 - clock
        if len(names) > 1:
            raise ValueError(f"{file} has several columns, choose one: {told}")
        return 0
    if names.count(column) > 1:
        raise ValueError(f"{file} has several columns {column!r}, choose by number: {told}")
    if column in names:
        return names.index(column)
    if column.isdecimal() and 1 <= int(column) <= len(names):
        return int(column) - 1
    raise ValueError(f"{file} has no column {column!r}, it has {told}")


def _numbered(names: Sequence[str]) -> list[tuple[int, str]]:
    return list(enumerate(names, start=1))


def _clock(names: list[str], rows: Sequence[Line], mark: str) -> int | None:
    """Return which of two columns only counts or tells the time, if exactly one does."""
    found = [n for n in (0, 1) if _ticks(names[n], [row[n] for _, row in rows], mark)]
    return found[0] if len(found) == 1 else None


def _ticks(name: str, cells: Sequence[str], mark: str) -> bool:
    """Say whether a column rises from line to line, by its name or by ones, or holds dates."""
    if len(cells) < 2:
        return name.lower() in CLOCKS
    if all(_is_number(cell, mark) for cell in cells):
        values = np.array([_number(cell, mark) for cell in cells])
        steps = np.diff(values)
        called = name.lower().partition("_")[0].partition(" ")[0] in CLOCKS
        return bool((steps > 0).all() and (called or (steps == 1).all()))
    try:
        dates = [datetime.fromisoformat(cell) for cell in cells]
        return all(a < b for a, b in pairwise(dates))
    except (ValueError, TypeError):  # no date; dates with and without a zone
        return False


def _values(
    rows: Sequence[Line], place: int, mark: str, missing: str, file: str
) -> tuple[NDArray[np.float64], int]:
    """Return the column's numbers, and how many cells were blank."""
    values: list[float] = []
    blank: list[int] = []
    for line, row in rows:
        cell = row[place]
        if _is_blank(cell):
            blank.append(line)
            if missing == "carry" and values:
                values.append(values[-1])
            elif missing == "carry":
                raise ValueError(f"{file}, line {line}: no score before it that could be carried")
            continue
        if not _is_number(cell, mark):
            raise ValueError(f"{file}, line {line}: a score must be a number, got {cell!r}")
        if not math.isfinite(number := _number(cell, mark)):
            raise ValueError(f"{file}, line {line}: a score must be finite, got {cell!r}")
        values.append(number)
    if blank and missing == "refuse":
        raise ValueError(
            f"{file}, line {blank[0]}: a score is missing ({len(blank)} of {len(rows)} are), and "
            "without it time would shift; choose for missing scores: carry the last one, or drop "
            "the step"
        )
    if not values:
        raise ValueError(f"{file} must be a table of numbers, and every score in it is missing")
    return np.array(values, dtype=np.float64), len(blank)


def _is_blank(cell: str) -> bool:
    return cell.lower() in BLANK


def _is_number(cell: str, mark: str) -> bool:
    try:
        _number(cell, mark)
    except ValueError:
        return False
    return "_" not in cell


def _number(cell: str, mark: str) -> float:
    if mark == ",":
        if "." in cell:
            raise ValueError(cell)
        cell = cell.replace(",", ".")
    return float(cell)
