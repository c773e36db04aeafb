"""Read a pose recording from netCDF 4, as the package rigid-body-motion writes those of the T265.

Variables: `time`, `position`, `orientation` (with `quaternion_axis` naming the order of its parts),
and optionally `linear_velocity`, `angular_velocity`, `confidence`; units, scale factors and fill
values are attributes.
"""

from __future__ import annotations

import io
import math
import re
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cpl.logs.axes import chosen_axes, to_ros
from cpl.logs.checks import Sieve
from cpl.logs.codec import NS
from cpl.logs.errors import (
    DamagedLogError,
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
from cpl.logs.schema import CHANNELS

__all__ = ["read_netcdf"]

_QUATERNION = ("qx", "qy", "qz", "qw")


def read_netcdf(path: Path, *, provenance: str | None = None, axes: str | None = None) -> Run:
    """Read a netCDF-4 recording.

    Args:
        path: The file.
        provenance: Where it comes from, if the file's attribute `provenance` does not say.
        axes: `ros` or `t265`, if the file's attribute `axes` does not say.

    Raises:
        LogError: One of its kinds.
    """
    import h5py

    data = content(path)
    try:
        with h5py.File(io.BytesIO(data), "r") as file:
            return _netcdf(file, path, len(data), provenance, axes)
    except LogError:
        raise
    except Exception as error:  # what HDF5 raises on damage has no end
        what = f"the file cannot be read ({type(error).__name__}: {error})"
        raise DamagedLogError(what, path=path) from error


def _netcdf(file: Any, path: Path, size: int, provenance: str | None, axes: str | None) -> Run:  # noqa: ANN401
    said = {name: _text(file.attrs.get(name)) for name in ("provenance", "axes")}
    said = {name: text for name, text in said.items() if text}
    convention = chosen_axes(axes, said.get("axes"), path)
    for name in ("time", "position", "orientation"):
        if name not in file:
            there = ", ".join(sorted(file))
            raise MissingChannelError(f"has no {name}; there are: {there}", path=path)
    t_s, start = _time(file, path)
    position = _values(file, "position", 3, "m", path)
    quaternion = _values(file, "orientation", 4, None, path)[:, _order(file, path)]
    moving = "linear_velocity" in file and "angular_velocity" in file
    rest = np.zeros_like(position)
    linear = _values(file, "linear_velocity", 3, "m/s", path) if moving else rest
    angular = _values(file, "angular_velocity", 3, "rad/s", path) if moving else rest
    if not len(t_s) == len(position) == len(quaternion) == len(linear) == len(angular):
        raise SchemaError("its variables differ in length", path=path)
    if convention == "t265":
        with np.errstate(invalid="ignore"):
            position, quaternion, linear, angular = to_ros(position, quaternion, linear, angular)
    names = ("x_m", "y_m", "z_m", *_QUATERNION)
    parts = (*position.T, *quaternion.T)
    columns: dict[str, NDArray[np.float64]] = dict(zip(names, parts, strict=True))
    if moving:
        columns |= {"v_x_mps": linear[:, 0], "v_y_mps": linear[:, 1]}
        columns["yaw_rate_radps"] = angular[:, 2]
    if "confidence" in file:
        columns["confidence"] = np.round(_values(file, "confidence", 0, None, path), 6)
    notes = [f"axes {convention}; of the twist v_x, v_y and the yaw rate are kept"]
    sieve = Sieve()
    names = ("t_s", *columns)
    for number, values in enumerate(zip(t_s.tolist(), *(each.tolist() for each in columns.values()),
                                        strict=True)):  # fmt: skip
        sieve.offer_raw(number, dict(zip(names, values, strict=True)), f"sample {number}")
    topics = tuple(each.topic for each in CHANNELS if set(each.columns) <= {*names, "yaw_rad"})
    info = stated(said | {"start_unix_ns": str(start)}, provenance, path, "cpl.logs.from_netcdf")
    return finished(sieve, info, path, notes, size=size, topics=topics, written=len(t_s))


def _text(value: object) -> str:
    return value.decode(errors="replace") if isinstance(value, bytes) else str(value or "")


def _values(file: Any, name: str, width: int, unit: str | None, path: Path) -> NDArray[np.float64]:  # noqa: ANN401
    """Return a variable, unpacked: fill values are NaN, scale and offset are applied."""
    variable = file[name]
    said = _text(variable.attrs.get("units"))
    if unit is not None and said != unit:
        raise UnitError(f"units must be {unit!r}, got {said!r}", path=path, where=name)
    if variable.ndim != 1 + bool(width) or (width and variable.shape[1] != width):
        raise SchemaError(f"has the shape {variable.shape}", path=path, where=name)
    raw = variable[...]
    values = raw.astype(np.float64)
    fill = variable.attrs.get("_FillValue")
    if fill is not None:
        values[raw == np.ravel(fill)[0]] = np.nan
    scale = float(np.ravel(variable.attrs.get("scale_factor", 1.0))[0])
    return values * scale + float(np.ravel(variable.attrs.get("add_offset", 0.0))[0])


def _order(file: Any, path: Path) -> list[int]:  # noqa: ANN401
    """Return where x, y, z, w are: some files have w first, and nothing else tells."""
    if "quaternion_axis" not in file:
        what = "no quaternion_axis says whether w comes first or last"
        raise FrameError(what, path=path, where="orientation")
    names = [_text(each) for each in np.ravel(file["quaternion_axis"][...]).tolist()]
    if sorted(names) != ["w", "x", "y", "z"]:
        raise FrameError(f"must name w, x, y, z, got {names}", path=path, where="quaternion_axis")
    return [names.index(axis) for axis in "xyzw"]


_SINCE = re.compile(r"(seconds|milliseconds|microseconds|nanoseconds) since (\S+)[T ](\S+)")


def _time(file: Any, path: Path) -> tuple[NDArray[np.float64], int]:  # noqa: ANN401
    """Return times since the first sample [s], and the first sample's [ns since 1970]."""
    said = _text(file["time"].attrs.get("units"))
    match = _SINCE.fullmatch(said)
    if not match:
        raise UnitError(
            f"units must be 'seconds since DATE', got {said!r}", path=path, where="time"
        )
    step = {"seconds": 1.0, "milliseconds": 1e-3, "microseconds": 1e-6, "nanoseconds": 1e-9}
    clock, _, fraction = match[3].partition(".")
    try:
        epoch = datetime.fromisoformat(f"{match[2]}T{clock}").replace(tzinfo=UTC)
        nanos = int(f"{fraction[:9]:0<9}") if fraction else 0
    except ValueError as error:
        raise UnitError(f"cannot read the date in {said!r}", path=path, where="time") from error
    counted = _values(file, "time", 0, said, path) * step[match[1]]
    if not len(counted) or not math.isfinite(counted[0]):
        raise NotFiniteError("the first time is not known", path=path, where="sample 0")
    start = int(epoch.timestamp()) * NS + nanos + round(float(counted[0]) * NS)
    return np.round(counted - counted[0], 9), max(start, 0)
