"""Get every intact message out of an MCAP file, however much of the file is left.

The library's own readers give up at the first damage: its indexed reader finds nothing in a file
without its end, its stream reader stops where the damage begins. Here each chunk stands for itself:
what its checksum confirms is taken, what it does not confirm is dropped and counted, and after
damage the next intact chunk is looked for. A file is gone through twice, first to learn what is
confirmed, then for the messages that are wanted; chunks are unpacked in pieces, so that none of
them has to fit into memory.
"""

from __future__ import annotations

import io
import re
import struct
import zlib
from array import array
from collections import Counter
from collections.abc import Container, Iterator
from dataclasses import dataclass, field
from heapq import merge
from typing import Any

from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, DataEnd, Footer, Header, Message, Metadata, Schema, Statistics

from cpl.logs.budget import LARGEST_MESSAGE, MOST_RECORDS, Budget, OverBudgetError
from cpl.logs.source import CannotUnpackError, Flow, ShortError, Source, unpacked

__all__ = ["MAGIC", "Damage", "Survey", "messages", "survey"]

MAGIC = b"\x89MCAP0\r\n"
HEAD = struct.Struct("<BQ")  # operation code and length of a record
CHUNK = struct.Struct("<QQQII")  # first and last time, size unpacked, checksum, length of a name
MESSAGE = struct.Struct("<HIQQ")  # channel, sequence, log time, publish time
LARGEST_RECORD = 4 << 20  # [byte] of a description: schemas of ROS have some ten thousand
MOST_DAMAGES = 1000  # that are told apart
MOST_DESCRIPTIONS = 16  # of a run; it has two
DESCRIPTION = "cpl.run"  # the metadata that is kept; other programs' is of no use here


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
class Survey:
    """What a file holds.

    Attributes:
        source: The file.
        chunks: Where the confirmed chunks begin.
        loose: Where the messages outside of chunks begin.
        channels: Channel records by their number, from what is confirmed.
        schemas: Schema records by their number.
        metadata: What describes a run of cpl (MCAP gives it no checksum of its own).
        damages: What was dropped; empty if every byte of the file is confirmed.
        held: How many confirmed messages each channel has.
        expected: How many messages the file says each channel has; None if that is lost.
        unchecked: How many chunks have no checksum.
        told: Digests of the descriptions.
        library: What the file says wrote it; None if that is lost.
    """

    source: Source
    chunks: array[int] = field(default_factory=lambda: array("q"))
    loose: array[int] = field(default_factory=lambda: array("q"))
    channels: dict[int, Channel] = field(default_factory=dict)
    schemas: dict[int, Schema] = field(default_factory=dict)
    metadata: list[Metadata] = field(default_factory=list)
    damages: list[Damage] = field(default_factory=list)
    held: Counter[int] = field(default_factory=Counter)
    expected: dict[int, int] | None = None
    unchecked: int = 0
    told: set[int] = field(default_factory=set)
    library: str | None = None

    def damage(self, at: int, size: int, what: str) -> None:
        """Note a damage; from some number on, only how many bytes they cost."""
        if len(self.damages) < MOST_DAMAGES:
            self.damages.append(Damage(at=at, size=size, what=what))
            return
        last = self.damages[-1]
        total = last.size + size if last.what.startswith("further") else size
        self.damages[-1:] = [] if last.what.startswith("further") else [last]
        self.damages.append(Damage(at=at, size=total, what="further damages, not told apart"))


def survey(source: Source, *, foreign: bool = False) -> Survey:
    """Return what is intact in an MCAP file.

    Args:
        source: The file; any bytes.
        foreign: Whether another program wrote it. Our own writer puts a checksum over everything,
            so what has none is damage; others leave checksums, chunks and the summary out.

    Returns:
        What was found; never an exception, whatever the bytes are.
    """
    found = Survey(source=source)
    at, done = len(MAGIC), False
    if source.read(0, len(MAGIC)) != MAGIC:
        at = _next_chunk(found, 0, foreign=foreign)
        found.damage(0, at, "the file does not begin as MCAP does")
    records = 0
    while at < source.size and not done:
        records += 1
        if records > MOST_RECORDS:
            found.damage(at, source.size - at, f"more than {MOST_RECORDS} records; no more is read")
            return found
        try:
            code, length = _head(source, at)
            done = _take(found, at, code, length, foreign=foreign)
            at += HEAD.size + length
        except (_BrokenError, OverBudgetError) as error:
            end = _resumed(found, at, foreign=foreign)
            found.damage(at, end - at, str(error))
            at = end
    if not done:
        found.damage(source.size, 0, "the end of the file is missing")
    elif source.read(at, len(MAGIC)) != MAGIC or at + len(MAGIC) != source.size:
        left = max(0, source.size - at - len(MAGIC))
        found.damage(at, left, "the file does not end as MCAP does")
    return found


def messages(found: Survey, channels: Container[int]) -> Iterator[tuple[int, Message]]:
    """Yield the confirmed messages of some channels, in the order of the file.

    Args:
        found: What the survey found.
        channels: Their numbers.

    Yields:
        Where the message's chunk begins, and the message; its data is empty where it is longer
        than any message of a robot's pose, and then it is not held.
    """
    source = found.source
    source.budget.again()
    for at in merge(found.chunks, found.loose):
        code, length = _head(source, at)
        if code == Opcode.CHUNK:
            _, begin, size, kind = _chunk(source, at, length)
            flow = Flow(unpacked(source, begin, size, kind))
            while not flow.ended():
                inner, inside = HEAD.unpack(flow.take(HEAD.size))
                if inner == Opcode.MESSAGE:
                    message = _message(flow, inside, channels)
                    if message is not None:
                        yield at, message
                else:
                    flow.skip(inside)
        else:
            flow = Flow(source.pieces(at + HEAD.size, length))
            message = _message(flow, length, channels)
            if message is not None:
                yield at, message


def _message(flow: Flow, length: int, channels: Container[int]) -> Message | None:
    number, sequence, log_time, publish_time = MESSAGE.unpack(flow.take(MESSAGE.size))
    rest = length - MESSAGE.size
    if number not in channels or rest > LARGEST_MESSAGE:
        flow.skip(rest)
        if number not in channels:
            return None
        data = b""
    else:
        data = flow.take(rest)
    return Message(
        channel_id=number,
        sequence=sequence,
        log_time=log_time,
        publish_time=publish_time,
        data=data,
    )


def _head(source: Source, at: int) -> tuple[int, int]:
    """Return code and length of the record at a place."""
    head = source.read(at, HEAD.size)
    if len(head) < HEAD.size:
        raise _BrokenError("the file ends inside a record")
    code, length = HEAD.unpack(head)
    if not Opcode.HEADER <= code <= Opcode.DATA_END:
        raise _BrokenError(f"there is no kind of record {code}")
    if length > source.size - at - HEAD.size:
        name = Opcode(code).name.lower().replace("_", " ")
        raise _BrokenError(f"the file ends inside a {name} record, or its length is damaged")
    return code, length


def _take(found: Survey, at: int, code: int, length: int, *, foreign: bool) -> bool:
    """Keep what a record says; tell whether it is the last one."""
    match code:
        case Opcode.CHUNK:
            _take_chunk(found, at, length, foreign=foreign)
        case Opcode.METADATA:
            _take_metadata(found, at, length)
        case Opcode.HEADER:
            found.library = _record(found, at, length, Header).library
        case Opcode.STATISTICS:
            told = _record(found, at, length, Statistics)
            found.expected = dict(told.channel_message_counts)
        case Opcode.DATA_END:
            _check_data(found, at, _record(found, at, length, DataEnd).data_section_crc, foreign)
        case Opcode.FOOTER:
            _check_summary(found, at, _record(found, at, length, Footer), foreign)
        case Opcode.MESSAGE | Opcode.CHANNEL | Opcode.SCHEMA:
            _take_loose(found, at, code, length, foreign=foreign)
        case _:
            pass  # indexes: the summary's checksum covers them, and nothing here needs them
    return code == Opcode.FOOTER


def _take_chunk(found: Survey, at: int, length: int, *, foreign: bool) -> None:
    """Confirm a chunk, and only then keep what it says of channels."""
    channels, schemas, held = _confirmed(found.source, at, length, foreign=foreign)
    declared, _, _, _ = _chunk(found.source, at, length)
    found.unchecked += not declared[1]
    found.chunks.append(at)
    found.held.update(held)
    for each in channels:
        found.channels.setdefault(each.id, each)
        if found.channels[each.id] != each:
            found.damage(at, 0, f"channel {each.id} is described twice, and differently")
    for each in schemas:
        found.schemas.setdefault(each.id, each)


def _confirmed(
    source: Source, at: int, length: int, *, foreign: bool
) -> tuple[list[Channel], list[Schema], Counter[int]]:
    """Go through a chunk whose checksum must hold.

    Returns:
        Its channels, its schemas, and how many messages each channel has in it.
    """
    (size, checksum), begin, packed, kind = _chunk(source, at, length)
    if size > source.budget.most_unpacked:
        raise _BrokenError("a chunk's size is damaged")
    if not (checksum or foreign):
        raise _BrokenError("a chunk has no checksum, so nothing confirms it")
    sums = [0, 0]  # checksum and size of what came out

    def watched() -> Iterator[bytes]:
        for piece in unpacked(source, begin, packed, kind):
            sums[0] = zlib.crc32(piece, sums[0])
            sums[1] += len(piece)
            if sums[1] > size:
                raise _BrokenError("a chunk's size is damaged")
            yield piece

    flow = Flow(watched())
    try:
        told = _contents(flow, source.budget)
    except (ShortError, McapError, struct.error, ValueError, MemoryError, OverflowError) as error:
        _drained(flow)
        _check_sums(sums, size, checksum)
        raise _BrokenError("a chunk is whole, but its records are malformed") from error
    except CannotUnpackError as error:
        raise _BrokenError(f"a chunk {error}") from error
    _check_sums(sums, size, checksum)
    return told


def _drained(flow: Flow) -> None:
    try:
        flow.rest()
    except CannotUnpackError as error:
        raise _BrokenError(f"a chunk {error}") from error


def _check_sums(sums: list[int], size: int, checksum: int) -> None:
    if sums[1] != size:
        raise _BrokenError("a chunk's size is damaged")
    if checksum and sums[0] != checksum:
        raise _BrokenError("the checksum of a chunk differs")


def _contents(flow: Flow, budget: Budget) -> tuple[list[Channel], list[Schema], Counter[int]]:
    bodies: dict[int, bytes] = {}
    schemas: dict[int, bytes] = {}
    held: Counter[int] = Counter()
    while not flow.ended():
        code, length = HEAD.unpack(flow.take(HEAD.size))
        budget.record()
        if code == Opcode.MESSAGE:
            if length < MESSAGE.size:
                raise ValueError("a message is shorter than its head")
            held[int.from_bytes(flow.take(2), "little")] += 1
            flow.skip(length - 2)
        elif code in (Opcode.CHANNEL, Opcode.SCHEMA) and 2 <= length <= LARGEST_RECORD:
            body = flow.take(length)
            known = bodies if code == Opcode.CHANNEL else schemas
            if known.setdefault(int.from_bytes(body[:2], "little"), body) != body:
                raise ValueError("a channel or schema is described twice, and differently")
        else:
            flow.skip(length)
    budget.record(10 * len(bodies) + 10 * len(schemas))
    return (
        [_parsed(Channel, body) for body in bodies.values()],
        [_parsed(Schema, body) for body in schemas.values()],
        held,
    )


def _take_loose(found: Survey, at: int, code: int, length: int, *, foreign: bool) -> None:
    """Keep what stands outside of chunks, or repeats in the summary what chunks said."""
    if code == Opcode.MESSAGE:
        if not foreign:
            raise _BrokenError("a message outside a chunk has no checksum")
        if length < MESSAGE.size:
            raise _BrokenError("a message is shorter than its head")
        found.loose.append(at)
        head = found.source.read(at + HEAD.size, 2)
        found.held[int.from_bytes(head, "little")] += 1
    elif foreign and code == Opcode.CHANNEL:
        channel = _record(found, at, length, Channel)
        found.channels.setdefault(channel.id, channel)
    elif foreign:
        schema = _record(found, at, length, Schema)
        found.schemas.setdefault(schema.id, schema)


def _take_metadata(found: Survey, at: int, length: int) -> None:
    """Keep what describes a run, once."""
    if length > LARGEST_RECORD:
        raise _BrokenError(f"a metadata record has {length} bytes")
    digest = hash(found.source.read(at + HEAD.size, length))
    if digest in found.told:
        return  # a copy, of which there may be very many
    told = _record(found, at, length, Metadata)
    if told.name != DESCRIPTION:
        return
    if len(found.metadata) >= MOST_DESCRIPTIONS:
        raise _BrokenError(f"the run is described in more than {MOST_DESCRIPTIONS} ways")
    found.told.add(digest)
    found.metadata.append(told)


_CHECKSUM = "the checksum of the {} differs"


def _check_data(found: Survey, at: int, checksum: int, foreign: bool) -> None:
    if not checksum:
        if not foreign:
            what = "the data section has no checksum, so it is not confirmed"
            found.damage(at, 0, what)
    elif checksum != _crc(found.source, 0, at):
        found.damage(0, 0, _CHECKSUM.format("data section"))


def _check_summary(found: Survey, at: int, footer: Footer, foreign: bool) -> None:
    if foreign and not footer.summary_crc:
        return
    begin = footer.summary_start or at
    end = at + HEAD.size + 16
    if begin > end or footer.summary_crc != _crc(found.source, begin, end - begin):
        found.expected = None
        found.damage(at, 0, _CHECKSUM.format("summary"))


def _crc(source: Source, at: int, count: int) -> int:
    total = 0
    for piece in source.pieces(at, count):
        total = zlib.crc32(piece, total)
    return total


def _record(found: Survey, at: int, length: int, kind: Any) -> Any:  # noqa: ANN401 - a record class
    """Read a record that must fill its content exactly."""
    if length > LARGEST_RECORD:
        raise _BrokenError(f"a {kind.__name__.lower()} record has {length} bytes")
    try:
        return _parsed(kind, found.source.read(at + HEAD.size, length))
    except (McapError, struct.error, ValueError, MemoryError, OverflowError) as error:
        name = kind.__name__.lower()
        raise _BrokenError(f"a {name} record is malformed") from error


def _parsed(kind: Any, body: bytes) -> Any:  # noqa: ANN401 - one of the record classes
    stream = ReadDataStream(io.BytesIO(body))
    record = kind.read(stream)
    if stream.count != len(body):
        raise ValueError("the record does not fill its length")
    return record


def _chunk(source: Source, at: int, length: int) -> tuple[tuple[int, int], int, int, str]:
    """Return a chunk's size and checksum, and where its content is: begin, length, compression."""
    head = source.read(at + HEAD.size, min(length, CHUNK.size + 64))
    if len(head) < CHUNK.size + 8:
        raise _BrokenError("a chunk record is malformed")
    _, _, size, checksum, name = CHUNK.unpack_from(head)
    if name > 32 or len(head) < CHUNK.size + name + 8:
        raise _BrokenError("a chunk record is malformed")
    kind = head[CHUNK.size : CHUNK.size + name].decode("ascii", errors="replace")
    packed = int.from_bytes(head[CHUNK.size + name : CHUNK.size + name + 8], "little")
    if CHUNK.size + name + 8 + packed != length:
        raise _BrokenError("a chunk record does not fill its length")
    return (size, checksum), at + HEAD.size + CHUNK.size + name + 8, packed, kind


def _resumed(found: Survey, at: int, *, foreign: bool) -> int:
    """Return where to go on after a broken record.

    That is the next confirmed chunk, unless the record's own length leads to something else that
    is well-formed before it, such as the next chunk's index or the metadata behind the last chunk.
    """
    source = found.source
    try:
        _, length = _head(source, at)
        end = at + HEAD.size + length
        code, length = _head(source, end)
        if code in _SKIPPED_TO:
            _record(found, end, length, _SKIPPED_TO[code])
            chunk = _next_chunk(found, at + 1, foreign=foreign, until=end)
            return min(end, chunk)
        if foreign and code in (Opcode.MESSAGE_INDEX, Opcode.MESSAGE):
            return end
    except (_BrokenError, OverBudgetError):
        pass  # the length was not to be trusted
    return _next_chunk(found, at + 1, foreign=foreign)


_SKIPPED_TO: dict[int, Any] = {Opcode.METADATA: Metadata, Opcode.DATA_END: DataEnd}


def _next_chunk(found: Survey, at: int, *, foreign: bool, until: int | None = None) -> int:
    """Return where the next confirmed chunk begins, or the end of the data."""
    source = found.source
    end = source.size if until is None else until
    try:
        for place in source.matches(_CHUNK_HEAD, at, end, reach=HEAD.size):
            try:
                _, length = _head(source, place)
                _chunk(source, place, length)
                source.budget.look(length)
                _confirmed(source, place, length, foreign=foreign)
            except _BrokenError:
                continue
            return place
    except OverBudgetError as error:
        found.damage(at, 0, str(error))
        return source.size
    return end


_CHUNK_HEAD = re.compile(b"\x06(?=.{4}\\0{4})", re.DOTALL)  # no chunk has 4 GiB
