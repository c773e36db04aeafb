"""Get every intact message out of an MCAP file, however much of the file is left.

The library's own readers give up at the first damage: its indexed reader finds nothing in a file
without its end, its stream reader stops where the damage begins. Here each chunk stands for itself:
what its checksum confirms is taken, what it does not confirm is dropped and counted, and after
damage the next intact chunk is looked for byte by byte. Nothing unconfirmed is ever returned.
"""

from __future__ import annotations

import io
import struct
import zlib
from dataclasses import dataclass, field
from typing import Any

import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import (
    Channel,
    Chunk,
    DataEnd,
    Footer,
    Header,
    McapRecord,
    Message,
    Metadata,
    Schema,
    Statistics,
)
from mcap.stream_reader import breakup_chunk

__all__ = ["MAGIC", "Damage", "Salvage", "salvage"]

MAGIC = b"\x89MCAP0\r\n"
HEAD = struct.Struct("<BQ")  # operation code and length of a record
LARGEST_CHUNK = 1 << 28  # [byte] when unpacked: a length beyond is damage, not data


class _BrokenError(Exception):
    """A record is not what its length, checksum or layout says."""


@dataclass(frozen=True, kw_only=True)
class Damage:
    """A stretch of the file that could not be confirmed.

    Attributes:
        at: Its first byte.
        size: How many bytes were dropped; 0 if only a checksum over bytes that were read differs.
        what: What is wrong.
    """

    at: int
    size: int
    what: str


@dataclass(kw_only=True)
class Salvage:
    """What a file holds.

    Attributes:
        messages: Confirmed messages, in the order of the file, each with its chunk's first byte.
        channels: Channel records, with repetitions, from chunks that are confirmed.
        schemas: Schema records by their number.
        metadata: Metadata records (MCAP gives them no checksum of their own).
        damages: What was dropped; empty if every byte of the file is confirmed.
        expected: How many messages the file says it has; None if that is lost.
        library: What the file says wrote it; None if that is lost.
    """

    messages: list[tuple[int, Message]] = field(default_factory=list)
    channels: list[Channel] = field(default_factory=list)
    schemas: dict[int, Schema] = field(default_factory=dict)
    metadata: list[Metadata] = field(default_factory=list)
    damages: list[Damage] = field(default_factory=list)
    expected: int | None = None
    library: str | None = None


def salvage(data: bytes) -> Salvage:
    """Return what is intact in an MCAP file.

    Args:
        data: The file's bytes; any bytes.

    Returns:
        What was found; never an exception, whatever the bytes are.
    """
    found = Salvage()
    if data.startswith(MAGIC):
        at = len(MAGIC)
    else:
        at = _next_chunk(data, 0)
        found.damages.append(Damage(at=0, size=at, what="the file does not begin as MCAP does"))
    while at < len(data):
        try:
            code, body, end = _record(data, at)
            done = _take(found, data, at, code, body)
        except _BrokenError as error:
            end, done = _resumed(data, at), False
            found.damages.append(Damage(at=at, size=end - at, what=str(error)))
        at = end
        if done:
            _check_end(found, data, at)
            return found
    found.damages.append(Damage(at=len(data), size=0, what="the end of the file is missing"))
    return found


def _record(data: bytes, at: int) -> tuple[int, bytes, int]:
    """Return code and content of the record at a place, and where the next one begins."""
    if len(data) - at < HEAD.size:
        raise _BrokenError("the file ends inside a record")
    code, length = HEAD.unpack_from(data, at)
    begin = at + HEAD.size
    if not Opcode.HEADER <= code <= Opcode.DATA_END:
        raise _BrokenError(f"there is no kind of record {code}")
    name = Opcode(code).name.lower().replace("_", " ")
    if length > len(data) - begin:
        raise _BrokenError(f"the file ends inside a {name} record, or its length is damaged")
    return code, data[begin : begin + length], begin + length


def _take(found: Salvage, data: bytes, at: int, code: int, body: bytes) -> bool:
    """Keep what a record says; tell whether it is the last one."""
    match code:
        case Opcode.CHUNK:
            _take_chunk(found, at, _unpacked(_read(Chunk, body)))
        case Opcode.METADATA:
            found.metadata.append(_read(Metadata, body))
        case Opcode.HEADER:
            found.library = _read(Header, body).library
        case Opcode.STATISTICS:
            found.expected = _read(Statistics, body).message_count
        case Opcode.DATA_END:
            _check_data(found, data, at, _read(DataEnd, body))
        case Opcode.FOOTER:
            _check_summary(found, data, at, _read(Footer, body))
        case Opcode.MESSAGE:
            raise _BrokenError("a message outside a chunk has no checksum")
        case _:
            pass  # indexes: the summary's checksum covers them, and nothing here needs them
    return code == Opcode.FOOTER


def _take_chunk(found: Salvage, at: int, records: list[McapRecord]) -> None:
    for record in records:
        if isinstance(record, Message):
            found.messages.append((at, record))
        elif isinstance(record, Channel):
            found.channels.append(record)
        elif isinstance(record, Schema):
            found.schemas[record.id] = record


_CHECKSUM = "the checksum of the {} differs"


def _check_data(found: Salvage, data: bytes, at: int, end: DataEnd) -> None:
    if not end.data_section_crc:
        what = "the data section has no checksum, so it is not confirmed"
        found.damages.append(Damage(at=at, size=0, what=what))
    elif end.data_section_crc != zlib.crc32(memoryview(data)[:at]):
        found.damages.append(Damage(at=0, size=0, what=_CHECKSUM.format("data section")))


def _check_summary(found: Salvage, data: bytes, at: int, footer: Footer) -> None:
    covered = memoryview(data)[footer.summary_start or at : at + HEAD.size + 16]
    if footer.summary_crc != zlib.crc32(covered):
        found.expected = None
        found.damages.append(Damage(at=at, size=0, what=_CHECKSUM.format("summary")))


def _check_end(found: Salvage, data: bytes, at: int) -> None:
    if data[at:] != MAGIC:
        what = "the file does not end as MCAP does"
        found.damages.append(Damage(at=at, size=max(0, len(data) - at - len(MAGIC)), what=what))


def _read(kind: Any, body: bytes) -> Any:  # noqa: ANN401 - one of the record classes
    """Read a record that must fill its content exactly."""
    stream = ReadDataStream(io.BytesIO(body))
    try:
        record = kind.read(stream)
    except (McapError, struct.error, ValueError, MemoryError, OverflowError) as error:
        raise _BrokenError(f"a {kind.__name__.lower()} record is malformed") from error
    if stream.count != len(body):
        raise _BrokenError(f"a {kind.__name__.lower()} record does not fill its length")
    return record


def _unpacked(chunk: Chunk) -> list[McapRecord]:
    """Return a chunk's records once its checksum has confirmed them."""
    if not chunk.uncompressed_crc:
        raise _BrokenError("a chunk has no checksum, so nothing confirms it")
    raw = _inflated(chunk)
    if len(raw) != chunk.uncompressed_size or zlib.crc32(raw) != chunk.uncompressed_crc:
        raise _BrokenError("the checksum of a chunk differs")
    chunk.data, chunk.compression = raw, ""
    try:
        return breakup_chunk(chunk)
    except (McapError, struct.error, ValueError, MemoryError, OverflowError) as error:
        raise _BrokenError("a chunk is whole, but its records are malformed") from error


def _inflated(chunk: Chunk) -> bytes:
    if chunk.compression == "":
        return chunk.data
    if chunk.compression != "zstd":
        raise _BrokenError(f"a chunk is compressed by {chunk.compression!r}, not by zstd")
    try:
        # A damaged length must not make us ask for terabytes.
        size = zstandard.get_frame_parameters(chunk.data).content_size
        if not size == chunk.uncompressed_size <= LARGEST_CHUNK:
            raise _BrokenError("a chunk's size is damaged")
        return zstandard.ZstdDecompressor().decompress(chunk.data, max_output_size=size)
    except zstandard.ZstdError as error:
        raise _BrokenError("a chunk cannot be decompressed") from error


def _resumed(data: bytes, at: int) -> int:
    """Return where to go on after a broken record.

    That is the next confirmed chunk, unless the record's own length leads to something else that
    is well-formed before it, such as the metadata behind the last chunk.
    """
    chunk = _next_chunk(data, at + 1)
    try:
        _, _, end = _record(data, at)
        code, body, _ = _record(data, end)
        if end < chunk and code in _SKIPPED_TO:
            _read(_SKIPPED_TO[code], body)
            return end
    except _BrokenError:
        pass  # the length was not to be trusted
    return chunk


_SKIPPED_TO: dict[int, Any] = {Opcode.METADATA: Metadata, Opcode.DATA_END: DataEnd}


def _next_chunk(data: bytes, at: int) -> int:
    """Return where the next confirmed chunk begins, or the end of the data."""
    code = bytes([Opcode.CHUNK])
    while (at := data.find(code, at)) >= 0:
        if data[at + 5 : at + 9] == b"\0\0\0\0":  # no chunk has 4 GiB
            try:
                _, body, _ = _record(data, at)
                _unpacked(_read(Chunk, body))
            except _BrokenError:
                pass
            else:
                return at
        at += 1
    return len(data)
