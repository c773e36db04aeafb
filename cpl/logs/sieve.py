"""Let the good rows of a run through, name what is wrong with the others, hold both in little room.

Rows come one by one or in blocks, in the order of the file. Here each is judged by itself: whether
it is finite, in range, and a rotation where it says so. Time is judged when all are there
(:mod:`cpl.logs.clock`), because one stamp says nothing about itself.
"""

from __future__ import annotations

import math
from array import array
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cpl.logs.budget import MOST_VALUES
from cpl.logs.codec import MalformedError, sound
from cpl.logs.errors import Fault, LogError, QuaternionError, RangeError
from cpl.logs.schema import FIELDS, Field

__all__ = ["QUATERNION", "Sieve", "yaw_of"]

UNIT_TOLERANCE = 1e-3  # [-] stored attitudes are rounded to 1e-4 in some recordings
YAW_TOLERANCE = 1e-3  # [rad]
SHOWN = 100  # faults of a kind that are kept one by one; more are counted
QUATERNION = ("qx", "qy", "qz", "qw")
Columns = Mapping[str, NDArray[np.float64]]


class Sieve:
    """What was let through, and the faults of the rest.

    Args:
        place: How a row's place is called, such as ``line {}``.

    Attributes:
        columns: The columns of the rows that passed.
        texts: The words of rows that have some, by column and row number.
        numbers: Row numbers.
        places: Where in the file each row stood, as `place` is filled in.
        stamps: Time of each row [ns].
        full: Whether the table has reached its largest size; what follows is only counted.

    Examples:
        >>> sieve = Sieve("row {}")
        >>> pose = dict(x_m=0.0, y_m=0.0, z_m=0.0, qx=0.0, qy=0.0, qz=0.0, qw=2.0)
        >>> sieve.offer(0, 0, 0, pose)
        >>> print(*sieve.faults)
        Quaternion: row 0: the attitude has length 2.0000, not 1 (1 row dropped)
    """

    def __init__(self, place: str) -> None:
        self.place = place
        self.columns: dict[str, array[float]] = {}
        self.texts: dict[str, dict[int, str]] = {}
        self.numbers, self.places, self.stamps = array("q"), array("q"), array("q")
        self.full = False
        self._kept: list[Fault] = []
        self._shown: Counter[type[LogError]] = Counter()
        self._more: Counter[type[LogError]] = Counter()
        self._beyond = 0
        self._beyond_at: int | None = None

    @property
    def rows(self) -> int:
        """How many rows passed."""
        return len(self.numbers)

    @property
    def faults(self) -> list[Fault]:
        """What was wrong, in the order in which it was found; beyond some of a kind, a count."""
        more = [
            Fault(error=error, where="further on", what=f"{rows} more of this kind", rows=rows)
            for error, rows in self._more.items()
        ]
        if self._beyond:
            what = f"the table has reached {MOST_VALUES} values, the most that is read of one file"
            where = self.place.format(self._beyond_at)
            more.append(Fault(error=RangeError, where=where, what=what, rows=self._beyond))
        return self._kept + more

    def drop(self, error: type[LogError], where: str, what: str, rows: int = 1) -> None:
        """Name a fault."""
        if self._shown[error] < SHOWN or not rows:
            self._shown[error] += 1
            if self._shown[error] <= 2 * SHOWN:
                self._kept.append(Fault(error=error, where=where, what=what, rows=rows))
        else:
            self._more[error] += rows

    def counted(self, error: type[LogError]) -> bool:
        """Count a row that was dropped for a fault of which enough are shown, if enough are."""
        if self._shown[error] < SHOWN:
            return False
        self._more[error] += 1
        return True

    def overflow(self, place: int) -> None:
        """Count a row that the table has no room for.

        Args:
            place: Where it stands in the file.
        """
        self.full = True
        self._beyond_at = place if self._beyond_at is None else self._beyond_at
        self._beyond += 1

    def offer(
        self, number: int, place: int, stamp_ns: int, row: Mapping[str, Any], note: str = ""
    ) -> None:
        """Take a row, or drop it with a fault.

        Args:
            number: The row's number.
            place: Where it stands in the file.
            stamp_ns: Its time [ns].
            row: Columns as in `cpl.logs.COLUMNS`, without the time.
            note: What is added to the place in a fault.
        """
        where = self.place.format(place) + note
        try:
            row = sound(row)
        except MalformedError as error:
            self.drop(error.error, where, str(error))
            return
        length = math.hypot(*(row[name] for name in QUATERNION))
        yaw = yaw_of(*(row[name] for name in QUATERNION))
        said = row.get("yaw_rad", yaw)
        if not abs(length - 1) <= UNIT_TOLERANCE:
            self.drop(QuaternionError, where, _length(length))
        elif abs(math.remainder(said - yaw, 2 * math.pi)) > YAW_TOLERANCE:
            self.drop(QuaternionError, where, _heading(said, yaw))
        elif (self.rows + 1) * (len(row) + 4) > MOST_VALUES:
            self.overflow(place)
        else:
            for name, value in (row | {"yaw_rad": said}).items():
                if FIELDS[name].kind != "text":
                    self.columns.setdefault(name, array("d")).append(value)
                elif value:
                    self.texts.setdefault(name, {})[number] = value
            self.numbers.append(number)
            self.places.append(place)
            self.stamps.append(stamp_ns)

    def offer_block(
        self,
        numbers: Sequence[int] | NDArray[np.int64],
        places: Sequence[int] | NDArray[np.int64],
        stamps_ns: Sequence[int] | NDArray[np.int64],
        columns: Columns,
    ) -> None:
        """Take many rows at once, and drop those that cannot be.

        Args:
            numbers: The rows' numbers.
            places: Where they stand in the file.
            stamps_ns: Their times [ns].
            columns: Columns as in `cpl.logs.COLUMNS`, without texts; `yaw_rad` may be left out.
        """
        places = np.asarray(places, dtype=np.int64)
        good = np.ones(len(places), dtype=bool)
        with np.errstate(all="ignore"):
            for name, values in columns.items():
                bad = good & ~_fits(FIELDS[name], values)
                good &= ~bad
                self._drop_rows(bad, places, columns, name)
            quaternion = [columns[name] for name in QUATERNION]
            length = np.sqrt(sum(each * each for each in quaternion))
            bad = good & ~(np.abs(length - 1) <= UNIT_TOLERANCE)
            good &= ~bad
            for at in self._to_show(bad, QuaternionError):
                self.drop(
                    QuaternionError, self.place.format(places[at]), _length(float(length[at]))
                )
            yaw = _yaws(*quaternion)
            said = columns.get("yaw_rad", yaw)
            apart = np.abs((said - yaw + np.pi) % (2 * np.pi) - np.pi)
            bad = good & (apart > YAW_TOLERANCE)
            good &= ~bad
            for at in self._to_show(bad, QuaternionError):
                what = _heading(float(said[at]), float(yaw[at]))
                self.drop(QuaternionError, self.place.format(places[at]), what)
        self._keep(np.flatnonzero(good), numbers, places, stamps_ns, {**columns, "yaw_rad": said})

    def _keep(
        self,
        kept: NDArray[np.intp],
        numbers: Sequence[int] | NDArray[np.int64],
        places: NDArray[np.int64],
        stamps_ns: Sequence[int] | NDArray[np.int64],
        columns: Columns,
    ) -> None:
        room = max(0, MOST_VALUES // (len(columns) + 3) - self.rows)
        if len(kept) > room:
            self.overflow(int(places[kept[room]]))
            self._beyond += len(kept) - room - 1
            kept = kept[:room]
        for name, values in columns.items():
            self.columns.setdefault(name, array("d")).frombytes(
                np.ascontiguousarray(values[kept], dtype=np.float64).tobytes()
            )
        for mine, theirs in (
            (self.numbers, numbers),
            (self.places, places),
            (self.stamps, stamps_ns),
        ):
            mine.frombytes(np.asarray(theirs, dtype=np.int64)[kept].tobytes())

    def _drop_rows(
        self, bad: NDArray[np.bool], places: NDArray[np.int64], columns: Columns, name: str
    ) -> None:
        """Name what is wrong with a column in some rows, in the words that a single row gets."""
        if not bad.any():
            return
        for at in np.flatnonzero(bad):
            try:
                sound({name: float(columns[name][at])})
            except MalformedError as error:
                if self._shown[error.error] >= SHOWN:
                    self._more[error.error] += int(bad[at:].sum())
                    return
                self.drop(error.error, self.place.format(places[at]), str(error))

    def _to_show(self, bad: NDArray[np.bool], error: type[LogError]) -> NDArray[np.intp]:
        """Return the rows that get a fault of their own; count the others."""
        found = np.flatnonzero(bad)
        room = max(0, SHOWN - self._shown[error])
        if len(found) > room:
            self._more[error] += len(found) - room
        return found[:room]


def yaw_of(qx: float, qy: float, qz: float, qw: float) -> float:
    """Return the heading of a quaternion's x axis [rad]; its length does not matter.

    Examples:
        >>> round(yaw_of(0.0, 0.0, 1.0, 1.0), 4)  # a quarter turn
        1.5708
    """
    return math.atan2(2 * (qw * qz + qx * qy), qw * qw + qx * qx - qy * qy - qz * qz)


def _yaws(
    qx: NDArray[np.float64],
    qy: NDArray[np.float64],
    qz: NDArray[np.float64],
    qw: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return :func:`yaw_of` for many."""
    return np.arctan2(2 * (qw * qz + qx * qy), qw * qw + qx * qx - qy * qy - qz * qz)


def _fits(field: Field, values: NDArray[np.float64]) -> NDArray[np.bool]:
    fits = np.isfinite(values) & (values >= field.low) & (values <= field.high)
    if field.kind == "int":
        fits &= values == np.floor(values)
    return fits | np.isnan(values) if field.nullable else fits


def _length(length: float) -> str:
    return f"the attitude has length {length:.4f}, not 1"


def _heading(said: float, yaw: float) -> str:
    return f"yaw_rad is {said:.4f}, but the quaternion's heading is {yaw:.4f}"
