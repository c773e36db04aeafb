"""The formats of recordings that are read: one module of this folder each, found by being there.

A module describes its format in one value, `FORMAT`: how such a file is recognised by its content,
an example of how it begins, and how it is read. A new format is a new module; nothing else changes.

- `recognise(head)` looks at the first bytes and says how much they look like the format, from 0 to
  1, and why; from `SURE` on it may be read as such. It never goes by the name of the file.
- `read(path, options)` returns a run, or raises a :class:`cpl.logs.LogError` that names the option
  that would help. What it cannot take of a file is a fault, what it changes is a note.
"""

from __future__ import annotations

import pkgutil
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache, cached_property
from importlib import import_module
from pathlib import Path

from cpl.logs.errors import EmptyLogError, NotALogError
from cpl.logs.run import Run

__all__ = ["SURE", "Format", "Head", "Likeness", "Options", "formats", "recognised"]

SURE = 0.5  # [-] likeness from which on a file is read as a format
HEAD = 64 << 10  # [byte] of a file that are looked at
UNITS_M = {"m": 1.0, "cm": 1e-2, "mm": 1e-3}  # [m]
ORDERS = ("xyzw", "wxyz")


@dataclass(frozen=True, kw_only=True)
class Options:
    """What a file may leave open, and its reader knows.

    Args:
        provenance: Where it comes from, one of `cpl.logs.PROVENANCES`.
        silent: The provenance if neither the file nor `provenance` says any; None to refuse then.
        axes: Which way its axes point: `ros`, `t265` or `camera`.
        topic: The poses' topic, where there are several.
        quaternion: The order in which attitudes are written: `xyzw` or `wxyz`.
        unit: What the positions are counted in: `m`, `cm` or `mm`.
        times: A file with one time a pose [s], where poses have none.
        pose_rate_hz: The rate of poses that have no time [Hz].
        linear_accel_cov: The realsense-ros driver's parameter, where it was not the default.

    Raises:
        ValueError: An option that is none.
    """

    provenance: str | None = None
    silent: str | None = None
    axes: str | None = None
    topic: str | None = None
    quaternion: str | None = None
    unit: str | None = None
    times: Path | None = None
    pose_rate_hz: float | None = None
    linear_accel_cov: float | None = None

    def __post_init__(self) -> None:
        for name, allowed in (("unit", UNITS_M), ("quaternion", ORDERS)):
            value = getattr(self, name)
            if value is not None and value not in allowed:
                msg = f"{name} must be one of {', '.join(allowed)}, got {value!r}"
                raise ValueError(msg)
        rate = self.pose_rate_hz
        if rate is not None and not 1e-3 <= rate <= 1e5:
            msg = f"pose_rate_hz must be within 0.001 and 100000, got {rate!r}"
            raise ValueError(msg)

    @property
    def scale_m(self) -> float:
        """How long the unit of the positions is [m]."""
        return UNITS_M[self.unit or "m"]


@dataclass(frozen=True)
class Head:
    """How a file begins.

    Attributes:
        path: The file, or a folder.
        data: Its first bytes; empty for a folder.
    """

    path: Path
    data: bytes = b""

    @property
    def is_folder(self) -> bool:
        """Whether it is a folder."""
        return self.path.is_dir()

    @cached_property
    def lines(self) -> list[str]:
        """The first lines, as far as they are text; none of a file that is none."""
        if b"\0" in self.data:
            return []
        data = self.data if len(self.data) < HEAD else self.data[: self.data.rfind(b"\n") + 1]
        return data.decode("utf-8-sig", errors="replace").splitlines()

    @cached_property
    def rows(self) -> list[str]:
        """The first lines that are neither empty nor a comment."""
        return [line for line in self.lines if line.strip() and not line.lstrip().startswith("#")]


@dataclass(frozen=True)
class Likeness:
    """How much a file looks like a format.

    Attributes:
        score: From 0 to 1.
        why: The reason in words; of a low score, what is missing.
    """

    score: float
    why: str


@dataclass(frozen=True, kw_only=True)
class Format:
    """A format that is read.

    Attributes:
        name: A word for it.
        title: What it is.
        example: How such a file begins; of one that is not text, what tells it.
        lacks: What it does not have, and what is done about it.
        recognise: How much a file looks like it.
        read: Read a file as it.
        options: The options that matter to it, as they are typed.
        suffixes: How such files are usually called; a folder is searched for these.
    """

    name: str
    title: str
    example: str
    lacks: str
    recognise: Callable[[Head], Likeness]
    read: Callable[[Path, Options], Run]
    suffixes: tuple[str, ...]
    options: tuple[str, ...] = field(default=())


@cache
def formats() -> tuple[Format, ...]:
    """Return all formats, by name.

    >>> [each.name for each in formats()][:4]
    ['bag', 'cpl', 'csv', 'euroc']
    """
    names = [each.name for each in pkgutil.iter_modules(__path__) if each.name[0] != "_"]
    found = [import_module(f"{__name__}.{name}").FORMAT for name in names]
    return tuple(sorted(found, key=lambda each: each.name))


def recognised(path: Path, asked: str | None = None) -> Format:
    """Return the format of a file, by its content.

    Args:
        path: The file, or a folder.
        asked: The format's name, if somebody says it.

    Raises:
        NotALogError: It looks like none; the error says what came nearest, and what would help.
        EmptyLogError: The file is empty.
        FileNotFoundError: There is no such file.
        ValueError: There is no such format.
    """
    known = {each.name: each for each in formats()}
    if asked is not None:
        if asked not in known:
            msg = f"format must be one of {', '.join(known)}, got {asked!r}"
            raise ValueError(msg)
        return known[asked]
    head = _head(path)
    liked = [(each.recognise(head), each) for each in known.values()]
    best, chosen = max(liked, key=lambda pair: pair[0].score)
    if best.score >= SURE:
        return chosen
    if head.data.startswith((b"\xff\xfe", b"\xfe\xff")):
        raise NotALogError("is UTF-16 text; save it as UTF-8", path=path)
    if packed := next((word for mark, word in _PACKED if head.data.startswith(mark)), None):
        raise NotALogError(f"is compressed ({packed}): unpack it first", path=path)
    what = f"is none of the formats that are read ({', '.join(known)})"
    if best.score > 0:
        what += f"; nearest is {chosen.name}: {best.why} (--format {chosen.name} reads it as that)"
    elif head.is_folder:
        what = "is a folder without a ROS 2 bag; name a file in it"
    raise NotALogError(f"{what}; `cpl logs formats` shows how each begins", path=path)


_PACKED = (
    (b"\x1f\x8b", "gzip: gunzip FILE"),
    (b"PK\x03\x04", "zip: unzip FILE"),
    (b"BZh", "bzip2: bunzip2 FILE"),
    (b"\xfd7zXZ", "xz: unxz FILE"),
    (b"\x28\xb5\x2f\xfd", "zstd: unzstd FILE"),
    (b"\x04\x22\x4d\x18", "lz4: unlz4 FILE"),
)


def _head(path: Path) -> Head:
    if path.is_dir():
        return Head(path)
    if path.exists() and not path.is_file():
        raise NotALogError("is no file that can be read twice (a pipe, a device)", path=path)
    with path.open("rb") as file:
        data = file.read(HEAD)
    if not data:
        raise EmptyLogError("has no content", path=path)
    return Head(path, data)
