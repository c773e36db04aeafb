"""Recordings of every format, spoiled where it is vulnerable: lengths, counts, types, order.

Each file is made from a sound one of `tests.logs.samples` by a change that knows its parts.
What may come back is the sound file's rows, fewer of them only with a word about it, and never more
than 256 MB of memory or time out of proportion. An error that is not a `LogError` ends the run.
"""

import random
import struct
import tempfile
import zlib
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import islice
from pathlib import Path

import numpy as np
import zstandard

from cpl.logs import LogError, Run, read_run
from cpl.logs.salvage import CHUNK, HEAD, MAGIC, MESSAGE
from tests.faults.frame import Row, tally
from tests.faults.measure import measured
from tests.logs.samples import SAMPLES, netcdf, sqlite_again, walk

MOST_MB = 256.0
MOST_S = 20.0  # of processor time; the files have some ten kB
WALK = walk(60)
Spoil = Callable[[bytes, random.Random], bytes]

TEXTS = ("tum", "tum with commas", "kitti", "euroc", "rs-convert", "t265 export")
TEXTS += ("rostopic echo -p", "csv", "csv with semicolons")
BAGS = ("ros 1 bag", "ros 1 bag, bz2", "ros 1 bag, lz4")
MCAPS = ("cpl", "ros 2 mcap", "ros 2 mcap, lz4", "ros 2 mcap, no chunks", "foxglove json mcap")

# A line more or less of a text, or a message of a file without counts and checksums, makes a sound
# file that says something else: nobody can miss what nothing promises. What is read must still be
# poses of the walk.
UNSEEN = {(name, what) for name in TEXTS for what in ("lines gone", "a line twice", "cut short")}
UNSEEN |= {("ros 2 mcap, no chunks", "a record gone"), ("ros 2 db3", "rows gone")}


def provoke(count: int) -> Iterator[Row]:
    """Spoil every format in each way that it can be, a share of `count` times."""
    folder = Path(tempfile.mkdtemp(prefix="cpl-recordings-"))
    ways = {
        **dict.fromkeys(TEXTS, TEXT_WAYS),
        **dict.fromkeys(BAGS, BAG_WAYS),
        **dict.fromkeys(MCAPS, MCAP_WAYS),
        "ros 2 db3": DB3_WAYS,
    }
    for name, spoils in ways.items():
        yield from _provoked(folder, name, spoils, max(1, count // 5))
    yield from _netcdfs(folder, max(1, count // 5))


def _provoked(folder: Path, name: str, ways: dict[str, Spoil], count: int) -> Iterator[Row]:
    _, make, options = SAMPLES[name]
    data = make(WALK)
    sound = _read(folder, data, options)
    for what, spoil in ways.items():
        rng = random.Random(f"{name} {what}")
        yield _row(folder, name, what, (spoil(data, rng) for _ in range(count)), sound, options)


def _row(folder, name, what, files, sound, options) -> Row:
    outcomes, worst_mb, worst_s = [], 0.0, 0.0
    for data in files:
        with measured() as told:
            outcomes.append(_outcome(folder, data, sound, options, unseen=(name, what) in UNSEEN))
        worst_mb = max(worst_mb, 0.0 if np.isnan(told.mb) else told.mb)
        worst_s = max(worst_s, told.s)
        if told.mb > MOST_MB or told.s > MOST_S:
            outcomes[-1] = "silent"  # it broke its promise without a word
    row = tally(f"recording ({name})", what, outcomes)
    return replace(row, worst_mb=round(worst_mb, 1), worst_s=round(worst_s, 2))


def _read(folder: Path, data: bytes, options) -> Run:
    path = folder / "recording"
    path.write_bytes(data)
    return read_run(path, silent="unstated", **options)


def _outcome(folder: Path, data: bytes, sound: Run, options, *, unseen: bool) -> str:
    try:
        run = _read(folder, data, options)
    except LogError:
        return "refused"
    same = _known(run, sound)
    if run.recovery.faults:
        return "recovered" if same else "silent"
    if same and len(run.table) == len(sound.table):
        return "harmless"
    return "harmless" if same and unseen else "silent"


def _known(run: Run, sound: Run) -> bool:
    """Tell whether every pose that came back is one of the sound file's."""
    names = ["x_m", "y_m", "z_m", "qx", "qy", "qz", "qw"]
    poses = {tuple(row) for row in sound.table[names].to_numpy().round(7).tolist()}
    return all(tuple(row) in poses for row in run.table[names].to_numpy().round(7).tolist())


# Text: lines and cells.


def _lines(change: Callable[[list[bytes], int, random.Random], None]) -> Spoil:
    """Return a spoil that changes the lines, at a drawn one that is not among the first four."""

    def spoil(data: bytes, rng: random.Random) -> bytes:
        lines = data.split(b"\n")[:-1]
        change(lines, rng.randrange(4, len(lines)), rng)
        return b"\n".join(lines) + b"\n"

    return spoil


def _separator(line: bytes) -> bytes:
    return max((b",", b";", b" "), key=line.count)


def _cell(lines: list[bytes], at: int, rng: random.Random, new: bytes) -> None:
    separator = _separator(lines[at])
    cells = lines[at].split(separator)
    cells[rng.randrange(len(cells))] = new
    lines[at] = separator.join(cells)


_JUNK = (
    b"nan",
    b"inf",
    b"-inf",
    b"1e999",
    b"",
    b"abc",
    b"1_000",
    b"0x1f",
    b"\xff\xfe",
    b"\0",
    b'"',
)
_JUNK += (b"9" * 400, b"9" * 200_000, b"\x1b[2J", "٣".encode(), b"--1", b"1e5e5")


def _junk(lines, at, rng):
    _cell(lines, at, rng, rng.choice(_JUNK))


def _fewer(lines, at, rng):
    separator = _separator(lines[at])
    lines[at] = separator.join(lines[at].split(separator)[: rng.randrange(1, 6)])


def _more(lines, at, rng):
    lines[at] += _separator(lines[at]) + b"7" * rng.randrange(1, 9)


def _swapped(lines, at, rng):
    other = rng.randrange(4, len(lines))
    lines[at], lines[other] = lines[other], lines[at]


def _twice(lines, at, rng):
    lines.insert(at, lines[at])


def _gone(lines, at, rng):
    del lines[at : at + rng.randrange(1, 6)]


def _long(lines, at, rng):
    lines[at] = lines[at] + b" " * rng.choice((10**5, 2 * 10**6)) + b"x"


def _garbled_head(data: bytes, rng: random.Random) -> bytes:
    at = rng.randrange(min(200, data.index(b"\n", 60)))
    return data[:at] + bytes([rng.randrange(256)]) * rng.choice((1, 1, 30)) + data[at + 1 :]


def _cut(data: bytes, rng: random.Random) -> bytes:
    return data[: rng.randrange(1, len(data))]


def _many_bad(data: bytes, rng: random.Random) -> bytes:
    return data + rng.choice((b"x\n", b"1,2\n", b"\n", b"nan nan\n")) * rng.randrange(50_000)


TEXT_WAYS: dict[str, Spoil] = {
    "a cell that is none": _lines(_junk),
    "too few cells": _lines(_fewer),
    "too many cells": _lines(_more),
    "lines in another order": _lines(_swapped),
    "a line twice": _lines(_twice),
    "lines gone": _lines(_gone),
    "a line without end": _lines(_long),
    "a changed header": _garbled_head,
    "cut short": _cut,
    "many bad lines": _many_bad,
}

# MCAP: records, chunks and what they declare.


def _records(data: bytes) -> list[tuple[int, int, int]]:
    """Return place, code and length of each record."""
    found, at = [], len(MAGIC)
    while at + HEAD.size <= len(data) - len(MAGIC):
        code, length = HEAD.unpack_from(data, at)
        found.append((at, code, length))
        at += HEAD.size + length
    return found


_SIZES = (0, 1, 2**16, 2**31, 2**32 - 1, 2**45, 2**63, 2**64 - 1)


def _length(data: bytes, rng: random.Random) -> bytes:
    at, code, length = rng.choice(_records(data))
    new = rng.choice((*_SIZES, length + 1, max(0, length - 1), len(data)))
    return data[:at] + HEAD.pack(code, new) + data[at + HEAD.size :]


def _code(data: bytes, rng: random.Random) -> bytes:
    at, _, _ = rng.choice(_records(data))
    return data[:at] + bytes([rng.randrange(256)]) + data[at + 1 :]


def _record_gone(data: bytes, rng: random.Random) -> bytes:
    at, _, length = rng.choice(_records(data))
    return data[:at] + data[at + HEAD.size + length :]


def _record_twice(data: bytes, rng: random.Random) -> bytes:
    at, _, length = rng.choice(_records(data))
    end = at + HEAD.size + length
    return data[:end] + data[at:end] * rng.choice((1, 3, 2000)) + data[end:]


def _chunk_head(data: bytes, rng: random.Random) -> bytes:
    chunks = [(at, length) for at, code, length in _records(data) if code == 6]
    if not chunks:
        return _length(data, rng)
    at, _ = rng.choice(chunks)
    at += HEAD.size
    first, last, size, crc, name = CHUNK.unpack_from(data, at)
    match rng.randrange(3):
        case 0:
            size = rng.choice(_SIZES)
        case 1:
            crc = rng.choice((0, 1, crc ^ 1))
        case _:
            name = rng.choice((0, 3, 9, 2**31))
    return data[:at] + CHUNK.pack(first, last, size, crc, name) + data[at + CHUNK.size :]


def _added(make: Callable[[random.Random], bytes]) -> Spoil:
    """Return a spoil that puts one more chunk behind the last one, sound in itself."""

    def spoil(data: bytes, rng: random.Random) -> bytes:
        raw = make(rng)
        chunks = [at + HEAD.size + length for at, code, length in _records(data) if code == 6]
        end = max(chunks, default=len(MAGIC) + HEAD.size + _records(data)[0][2])
        packed = zstandard.ZstdCompressor(level=1).compress(raw)
        body = CHUNK.pack(0, 0, len(raw), zlib.crc32(raw), 4) + b"zstd"
        body += struct.pack("<Q", len(packed)) + packed
        return data[:end] + HEAD.pack(6, len(body)) + body + data[end:]

    return spoil


def _message(channel: int, sequence: int, time: int, body: bytes) -> bytes:
    return (
        HEAD.pack(5, MESSAGE.size + len(body)) + MESSAGE.pack(channel, sequence, time, time) + body
    )


def _tiny(rng: random.Random) -> bytes:
    return _message(rng.choice((1, 9)), 0, 0, b"") * rng.choice((10, 10**4, 2 * 10**6))


def _odd(rng: random.Random) -> bytes:
    bodies = (b"", b"\0", b"\0\1\0\0", b"[" * 10**5, b"{}", rng.randbytes(800), b'{"pose":1e999}')
    times = (0, 2**63, 2**64 - 1, 1_700_000_001 * 10**9)
    return b"".join(
        _message(1, 1000 + k, rng.choice(times), rng.choice(bodies))
        for k in range(rng.randrange(30))
    )


def _channels(rng: random.Random) -> bytes:
    one = b"".join(
        HEAD.pack(4, 4 + 4 + 6 + 4 + 4)
        + struct.pack("<HHI", 100 + k % 60_000, 0, 6) + b"/t%04d" % (k % 10_000)
        + struct.pack("<I", 0) + struct.pack("<I", 0)
        for k in range(rng.choice((10, 1000, 60_000)))
    )  # fmt: skip
    return one * rng.choice((1, 2))


def _nested(data: bytes, rng: random.Random) -> bytes:
    """Put false heads of chunks one into the other, each as long as the rest of the file."""
    at = len(MAGIC) + HEAD.size + _records(data)[0][2]
    count = rng.choice((10, 1000))
    heads = b""
    for k in range(count):
        rest = (count - k) * 57 + 100
        head = CHUNK.pack(0, 0, rest, 1, 0) + struct.pack("<Q", rest - 48)
        heads += HEAD.pack(6, rest - 9) + head
    return data[:at] + b"\x7f" + heads + data[at:]


def _zeros(data: bytes, rng: random.Random) -> bytes:
    at, size = rng.randrange(len(data)), rng.choice((1, 16, 512))
    return data[:at] + bytes(min(size, len(data) - at)) + data[at + size :]


MCAP_WAYS: dict[str, Spoil] = {
    "a record's length": _length,
    "a record's kind": _code,
    "a record gone": _record_gone,
    "a record many times": _record_twice,
    "what a chunk declares": _chunk_head,
    "false chunks in chunks": _nested,
    "millions of tiny messages": _added(_tiny),
    "messages that are none": _added(_odd),
    "thousands of channels": _added(_channels),
    "zeros in the middle": _zeros,
    "cut short": _cut,
}

# ROS 1 bags: headers of named fields.


def _field(data: bytes, rng: random.Random) -> bytes:
    names = (b"op=", b"size=", b"conn=", b"compression=", b"time=", b"index_pos=", b"count=")
    places = [at for name in names for at in _places(data, name)]
    at = rng.choice(places)
    value = data.index(b"=", at) + 1
    return data[:value] + rng.randbytes(rng.choice((1, 4))) + data[value + 4 :]


def _places(data: bytes, mark: bytes) -> list[int]:
    found, at = [], -1
    while (at := data.find(mark, at + 1)) >= 0:
        found.append(at)
    return found


def _bag_length(data: bytes, rng: random.Random) -> bytes:
    at = rng.choice(_places(data, b"op=")) - 4
    new = struct.pack("<I", rng.choice((0, 1, 2**16, 2**31, 2**32 - 1)))
    at = max(13, at - rng.choice((0, 4, 8)))
    return data[:at] + new + data[at + 4 :]


def _bag_swap(data: bytes, rng: random.Random) -> bytes:
    first, second = sorted(rng.sample(_places(data, b"op="), 2))
    size = rng.choice((1, 8, 64))
    a, b = data[first : first + size], data[second : second + size]
    return data[:first] + b + data[first + size : second] + a + data[second + size :]


BAG_WAYS: dict[str, Spoil] = {
    "a header's field": _field,
    "a record's length": _bag_length,
    "parts of headers exchanged": _bag_swap,
    "cut short": _cut,
}

# SQLite: its schema, and pages.

_SCRIPTS = (
    "UPDATE messages SET data = x'' WHERE id = {n};",
    "UPDATE messages SET data = zeroblob(2000000) WHERE id = {n};",
    "UPDATE messages SET data = 'text' WHERE id = {n};",
    "UPDATE messages SET timestamp = 9223372036854775807 WHERE id = {n};",
    "UPDATE messages SET timestamp = 'soon' WHERE id = {n};",
    "UPDATE messages SET topic_id = {n};",
    "UPDATE topics SET type = 'std_msgs/msg/String';",
    "UPDATE topics SET serialization_format = 'json';",
    "UPDATE topics SET name = char(27) || '[2J';",
    "ALTER TABLE messages RENAME TO m2; CREATE VIEW messages AS WITH RECURSIVE c(x) AS (SELECT 1 "
    "UNION ALL SELECT x + 1 FROM c) SELECT x AS id, 1 AS topic_id, x AS timestamp, x'' AS data "
    "FROM c;",
    "ALTER TABLE messages ADD COLUMN big AS (zeroblob(900000000));",
    "DROP TABLE topics;",
)


def _sql(data: bytes, rng: random.Random) -> bytes:
    return sqlite_again(data, rng.choice(_SCRIPTS).format(n=rng.randrange(2, 60)))


def _page(data: bytes, rng: random.Random) -> bytes:
    at = 4096 * rng.randrange(len(data) // 4096)
    return data[:at] + bytes(4096) + data[at + 4096 :]


def _rows_gone(data: bytes, rng: random.Random) -> bytes:
    return sqlite_again(data, f"DELETE FROM messages WHERE id % {rng.randrange(2, 60)} = 0;")


DB3_WAYS: dict[str, Spoil] = {
    "another content": _sql,
    "rows gone": _rows_gone,
    "a page of zeros": _page,
    "cut short": _cut,
}

# netCDF: what HDF5 lets a file declare.


def _set(name: str, attribute: str, value) -> Callable:
    return lambda file: file[name].attrs.__setitem__(attribute, value)


def _remade(name: str, **how) -> Callable:
    def change(file):
        del file[name]
        file.create_dataset(name, **how).attrs["units"] = "m"

    return change


def _linked(file):
    import h5py

    del file["position"]
    file["position"] = h5py.ExternalLink("/etc/passwd", "/x")


def _softly(file):
    import h5py

    del file["position"]
    file["position"] = h5py.SoftLink("/orientation")


def _virtual(file):
    import h5py

    del file["position"]
    layout = h5py.VirtualLayout((60, 3), dtype="f8")
    layout[:] = h5py.VirtualSource("other.h5", "x", (60, 3))
    file.create_virtual_dataset("position", layout)
    file["position"].attrs["units"] = "m"


_DECLARED = (
    _remade("position", shape=(60, 3), dtype="f8", external=[("/etc/passwd", 0, 1440)]),
    _linked,
    _softly,
    _virtual,
    *(_remade("position", shape=(n, 3), dtype="f8", chunks=(1 << 12, 3)) for n in (10**6, 10**12)),
    _remade("position", shape=(60, 3), dtype="f8", chunks=(60, 3)),
    _remade("position", shape=(60, 3), dtype="c16"),
    _remade("position", shape=(60, 3), dtype="S8"),
    _remade("position", shape=(60, 4), dtype="f8"),
    _remade("position", shape=(), dtype="f8"),
    _remade("time", data=np.zeros(60)),
    _remade("orientation", data=np.zeros((60, 4))),
    _remade("quaternion_axis", data=np.array([b"x"] * 4)),
    _remade("quaternion_axis", shape=(10**9,), dtype="u1", chunks=(1 << 20,)),
)
_SAID = tuple(
    _set(name, attribute, value)
    for name, attribute, values in (
        ("position", "units", ("mm", "", "x" * 10_000, 3.0)),
        ("position", "scale_factor", (0.0, np.nan, np.array([1.0, 2.0]), np.inf)),
        ("position", "add_offset", (np.nan, np.array([0.0, 0.0]), 1e300)),
        ("position", "_FillValue", (np.nan, 0.3, "none")),
        ("time", "units", ("seconds", "nanoseconds since x y", "days since 2020-01-01 00:00:00")),
        ("time", "units", ("nanoseconds since 9999-12-31 23:59:59", "\x1b[2J")),
        ("time", "calendar", ("360_day", "julian")),
    )
    for value in values
)


def _netcdfs(folder: Path, count: int) -> Iterator[Row]:
    data = netcdf(WALK)
    sound = _read(folder, data, {})
    for what, changes in (("what it declares", _DECLARED), ("what it says of units", _SAID)):
        files = (netcdf(WALK, change) for change in changes)
        yield _row(folder, "netcdf", what, files, sound, {})
    rng = random.Random("netcdf")
    files = (_cut(data, rng) for _ in range(count))
    yield _row(folder, "netcdf", "cut short", files, sound, {})
    flips = islice(iter(lambda: _metadata_flip(data, rng), None), count)
    yield _row(folder, "netcdf", "a byte of its structure", flips, sound, {})


def _metadata_flip(data: bytes, rng: random.Random) -> bytes:
    """Change a byte where HDF5 keeps its structure: the file's head, before any number."""
    at = rng.randrange(8, 800)
    return data[:at] + bytes([rng.randrange(256)]) + data[at + 1 :]
