"""netCDF 4, as the package rigid-body-motion writes recordings of the T265.

Variables: `time`, `position`, `orientation` (with `quaternion_axis` naming the order of its parts),
and optionally `linear_velocity`, `angular_velocity`, `confidence`; units, scale factors and fill
values are attributes. What would be read from another file is refused: a name in a file must not
decide which of your files is opened.
"""

from __future__ import annotations

import math
import re
from datetime import UTC, datetime, timedelta
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cpl.logs.axes import chosen_axes, to_ros
from cpl.logs.budget import OverBudgetError
from cpl.logs.clock import LAST_NS, NS
from cpl.logs.errors import (
    DamagedLogError,
    FrameError,
    LogError,
    MissingChannelError,
    NotALogError,
    NotFiniteError,
    SchemaError,
    TimeOrderError,
    UnitError,
)
from cpl.logs.finish import finished
from cpl.logs.formats import Format, Head, Likeness, Options
from cpl.logs.info import stated
from cpl.logs.run import Run
from cpl.logs.schema import CHANNELS
from cpl.logs.sieve import QUATERNION, Sieve
from cpl.logs.source import Source

__all__ = ["FORMAT"]

SLAB = 1 << 15  # rows that are read at once
LARGEST_PIECE = 32 << 20  # [byte] in which a variable is stored; each is unpacked as a whole
CALENDARS = ("", "standard", "gregorian", "proleptic_gregorian")
Array = NDArray[np.float64]


def _recognise(head: Head) -> Likeness:
    if head.data.startswith(b"\x89HDF\r\n\x1a\n"):
        return Likeness(1.0, "begins as HDF5 does")
    if head.data.startswith(b"CDF"):
        return Likeness(1.0, "begins as netCDF 3 does")
    if head.data.startswith(b"\x89HDF"):
        return Likeness(0.6, "begins nearly as HDF5 does")
    return Likeness(0.0, "does not begin as HDF5 does")


def _read(path: Path, options: Options) -> Run:
    import h5py

    with Source.open(path) as source:
        if source.read(0, 3) == b"CDF":
            raise NotALogError("is netCDF 3; `nccopy -k nc4 IN OUT` makes it netCDF 4", path=path)
        try:
            with h5py.File(path, "r", rdcc_nbytes=LARGEST_PIECE) as file:
                return _File(file, path, source, options).run()
        except LogError:
            raise
        except Exception as error:  # what HDF5 raises on damage has no end
            what = f"the file cannot be read ({type(error).__name__}: {error})"
            raise DamagedLogError(what, path=path) from error


class _File:
    """An opened file."""

    def __init__(self, file: Any, path: Path, source: Source, options: Options) -> None:  # noqa: ANN401
        self._file, self._path, self._source = file, path, source
        self._options = options
        said = {name: _text(file.attrs.get(name)) for name in ("provenance", "axes")}
        self._said = {name: text for name, text in said.items() if text}
        self._axes = chosen_axes(options.axes, self._said.get("axes"), path)

    def run(self) -> Run:
        """Read it."""
        for name in ("time", "position", "orientation"):
            if name not in self._file:
                there = ", ".join(sorted(islice(self._file, 20)))
                what = f"has no {name}; there are: {there}"
                raise MissingChannelError(what, path=self._path)
        self._order = self._quaternion_order()
        moving = "linear_velocity" in self._file and "angular_velocity" in self._file
        confident = "confidence" in self._file
        self._variables = {
            "time": self._variable("time", 0, None),
            "position": self._variable("position", 3, "m"),
            "orientation": self._variable("orientation", 4, None),
        }
        if moving:
            self._variables["linear_velocity"] = self._variable("linear_velocity", 3, "m/s")
            self._variables["angular_velocity"] = self._variable("angular_velocity", 3, "rad/s")
        if confident:
            self._variables["confidence"] = self._variable("confidence", 0, None)
        lengths = {each.shape[0] for each in self._variables.values()}
        if len(lengths) > 1:
            raise SchemaError("its variables differ in length", path=self._path)
        rows = lengths.pop()
        step, epoch = self._time_unit()
        sieve = Sieve("sample {}")
        have = {"t_s", "yaw_rad"}
        for begin in range(0, rows, SLAB):
            end = min(begin + SLAB, rows)
            stamps, dated = self._stamps(begin, end, step, epoch, sieve)
            columns = self._columns(begin, end)
            have |= set(columns)
            numbers = np.arange(begin, end)[dated]
            sieve.offer_block(
                numbers, numbers, stamps[dated], {n: v[dated] for n, v in columns.items()}
            )
        notes = [f"axes {self._axes}; of the twist v_x, v_y and the yaw rate are kept"]
        source = {"importer": "cpl.logs.formats.netcdf", "axes": self._axes}
        info = stated(
            self._said, self._options.provenance, self._path, source, silent=self._options.silent
        )
        return finished(
            sieve,
            info,
            self._path,
            notes,
            size=self._source.size,
            topics=tuple(each.topic for each in CHANNELS if set(each.columns) <= have),
            written=rows,
            unit_known=self._options.unit is not None,
        )

    def _columns(self, begin: int, end: int) -> dict[str, Array]:
        position = self._values("position", begin, end) * self._options.scale_m
        quaternion = self._values("orientation", begin, end)[:, self._order]
        moving = "linear_velocity" in self._variables
        rest = np.zeros_like(position)
        linear = self._values("linear_velocity", begin, end) if moving else rest
        angular = self._values("angular_velocity", begin, end) if moving else rest
        if self._axes != "ros":
            with np.errstate(all="ignore"):
                position, quaternion, linear, angular = to_ros(
                    position, quaternion, linear, angular, axes=self._axes
                )
        names = ("x_m", "y_m", "z_m", *QUATERNION)
        parts = (*position.T, *quaternion.T)
        columns: dict[str, Array] = dict(zip(names, parts, strict=True))
        if moving:
            columns |= {"v_x_mps": linear[:, 0], "v_y_mps": linear[:, 1]}
            columns["yaw_rate_radps"] = angular[:, 2]
        if "confidence" in self._variables:
            columns["confidence"] = np.round(self._values("confidence", begin, end), 6)
        return columns

    def _variable(self, name: str, width: int, unit: str | None) -> Any:  # noqa: ANN401 - of h5py
        """Return a variable if it is stored here, as numbers, and no larger than it may be."""
        import h5py

        path = self._path
        if not isinstance(self._file.get(name, getlink=True), h5py.HardLink):
            raise NotALogError("is a link to somewhere else, which is not followed", path=path,
                               where=name)  # fmt: skip
        variable = self._file[name]
        if not isinstance(variable, h5py.Dataset) or variable.dtype.kind not in "fiu":
            raise SchemaError("does not hold real numbers", path=path, where=name)
        if variable.is_virtual or variable.external:
            kind = "a virtual dataset" if variable.is_virtual else "external storage"
            what = f"is {kind}: its numbers are in other files, which are not read"
            raise NotALogError(what, path=path, where=name)
        if variable.ndim != 1 + bool(width) or (width and variable.shape[1] != width):
            raise SchemaError(f"has the shape {variable.shape}", path=path, where=name)
        said = _text(variable.attrs.get("units"))
        if unit is not None and said != unit:
            raise UnitError(f"units must be {unit!r}, got {said!r}", path=path, where=name)
        self._stored(variable, name)
        return variable

    def _stored(self, variable: Any, name: str) -> None:  # noqa: ANN401
        """Refuse a variable that declares more than is there."""
        declared = variable.size * variable.dtype.itemsize
        if variable.chunks is None:
            written = variable.id.get_storage_size() >= declared
        else:
            piece = math.prod(variable.chunks) * variable.dtype.itemsize
            if piece > LARGEST_PIECE:
                what = f"is stored in pieces of {piece} bytes; the largest read is {LARGEST_PIECE}"
                raise NotALogError(what, path=self._path, where=name)
            grid = zip(variable.shape, variable.chunks, strict=True)
            pieces = math.prod(-(-extent // step) for extent, step in grid)
            written = variable.id.get_num_chunks() >= pieces
        if declared and not written:
            what = f"declares {variable.shape[0]} rows, which were not all written"
            raise DamagedLogError(what, path=self._path, where=name)
        if declared > self._source.budget.most_unpacked:
            what = f"declares {declared} bytes, beyond what {self._source.size} bytes may hold"
            raise DamagedLogError(what, path=self._path, where=name)

    def _values(self, name: str, begin: int, end: int) -> Array:
        """Return rows of a variable: fill values are NaN, scale and offset are applied."""
        variable = self._variables[name]
        raw = variable[begin:end]
        try:
            self._source.budget.unpack(raw.nbytes)
        except OverBudgetError as error:
            raise DamagedLogError(str(error), path=self._path, where=name) from error
        values = raw.astype(np.float64)
        fill = variable.attrs.get("_FillValue")
        if fill is not None:
            values[raw == np.ravel(fill)[0]] = np.nan
        scale = self._single(variable, name, "scale_factor", 1.0)
        return values * scale + self._single(variable, name, "add_offset", 0.0)

    def _single(self, variable: Any, name: str, attribute: str, usual: float) -> float:  # noqa: ANN401
        values = np.ravel(variable.attrs.get(attribute, usual))
        if len(values) != 1 or not math.isfinite(value := float(values[0])):
            what = f"{attribute} must be one number, got {values.tolist()[:4]}"
            raise SchemaError(what, path=self._path, where=name)
        if attribute == "scale_factor" and not value:
            raise UnitError("scale_factor is 0, so all values are one", path=self._path, where=name)
        return value

    def _quaternion_order(self) -> list[int]:
        """Return where x, y, z, w are: some files have w first, and nothing else tells."""
        if self._options.quaternion is not None:
            return [self._options.quaternion.index(axis) for axis in "xyzw"]
        if "quaternion_axis" not in self._file:
            what = (
                "no quaternion_axis says whether w comes first or last (--quaternion wxyz or xyzw; "
                "quaternion= in Python)"
            )
            raise FrameError(what, path=self._path, where="orientation")
        axis = self._file["quaternion_axis"]
        names = [_text(each) for each in np.ravel(axis[...]).tolist()] if axis.size == 4 else []
        if sorted(names) != ["w", "x", "y", "z"]:
            what = f"must name w, x, y, z, got {names}"
            raise FrameError(what, path=self._path, where="quaternion_axis")
        return [names.index(axis) for axis in "xyzw"]

    def _time_unit(self) -> tuple[int, int]:
        """Return what a count of time is [ns], and what it counts from [ns since 1970]."""
        said = _text(self._file["time"].attrs.get("units"))
        calendar = _text(self._file["time"].attrs.get("calendar"))
        if calendar not in CALENDARS:
            what = f"is counted in the calendar {calendar!r}"
            raise UnitError(what, path=self._path, where="time")
        match = _SINCE.fullmatch(said)
        if not match:
            what = f"units must be 'seconds since DATE', got {said!r}"
            raise UnitError(what, path=self._path, where="time")
        clock, _, fraction = match["clock"].partition(".")
        try:
            epoch = datetime.fromisoformat(f"{match['date']}T{clock}").replace(tzinfo=UTC)
            nanos = int(f"{fraction[:9]:0<9}") if fraction else 0
            epoch -= _zone(match["zone"] or "")
        except (ValueError, OverflowError) as error:
            what = f"cannot read the date in {said!r}"
            raise UnitError(what, path=self._path, where="time") from error
        since = epoch - datetime(1970, 1, 1, tzinfo=UTC)
        start = (since.days * 86_400 + since.seconds) * NS + nanos
        if not -LAST_NS < start < LAST_NS:
            what = f"counts from {match['date']}, which no recording does"
            raise UnitError(what, path=self._path, where="time")
        return _STEPS[match["unit"]], start

    def _stamps(
        self, begin: int, end: int, step: int, epoch: int, sieve: Sieve
    ) -> tuple[NDArray[np.int64], NDArray[np.bool]]:
        """Return the times of some rows [ns since 1970], and which of them are times."""
        variable = self._variables["time"]
        exact = variable.dtype.kind in "iu" and not set(variable.attrs) & {
            "scale_factor", "add_offset", "_FillValue"}  # fmt: skip
        values = self._values("time", begin, end)
        if begin == 0 and not (len(values) and math.isfinite(values[0])):
            raise NotFiniteError("the first time is not known", path=self._path, where="sample 0")
        with np.errstate(all="ignore"):
            near = epoch + values * step
            dated = np.isfinite(near) & (np.abs(near) < LAST_NS)
        stamps = np.zeros(len(values), dtype=np.int64)
        if exact:
            stamps[dated] = epoch + variable[begin:end][dated].astype(np.int64) * step
        else:
            stamps[dated] = epoch + np.rint(values[dated] * step).astype(np.int64)
        for at in np.flatnonzero(~dated).tolist():
            what = f"its time is {values[at]}, which is no date"
            sieve.drop(TimeOrderError, f"sample {begin + at}", what)
        return stamps, dated


def _text(value: object) -> str:
    if isinstance(value, bytes):
        return value[:1000].decode(errors="replace")
    return "" if value is None else str(value)[:1000]


_STEPS = {"seconds": NS, "milliseconds": 10**6, "microseconds": 10**3, "nanoseconds": 1}
_SINCE = re.compile(
    r"(?P<unit>seconds|milliseconds|microseconds|nanoseconds) since (?P<date>\S+?)[T ]"
    r"(?P<clock>\S+?)\s*(?P<zone>Z|UTC|GMT|[+-][\d:]+)?"
)
_ZONE = re.compile(r"([+-])(\d{1,2})(?::?(\d{2}))?")


def _zone(text: str) -> timedelta:
    """Return how far a time zone is ahead of UTC.

    >>> _zone("+05:30"), _zone("Z")
    (datetime.timedelta(seconds=19800), datetime.timedelta(0))
    """
    if text in ("", "Z", "UTC", "GMT"):
        return timedelta()
    match = _ZONE.fullmatch(text)
    if not match:
        raise ValueError(text)
    ahead = timedelta(hours=int(match[2]), minutes=int(match[3] or 0))
    return ahead if match[1] == "+" else -ahead


FORMAT = Format(
    name="netcdf",
    title="netCDF 4 of a pose, as rigid-body-motion writes it",
    example="\\x89HDF (binary); variables time, position, orientation, quaternion_axis",
    lacks="twist and confidence where their variables are not there: absent",
    recognise=_recognise,
    read=_read,
    suffixes=(".nc",),
    options=("--axes", "--quaternion", "--provenance"),
)
