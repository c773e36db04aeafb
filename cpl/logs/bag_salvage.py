"""Get out of a ROS 1 bag what is in it, whether or not its index is there.

A bag's index stands at its end, and a recorder that was killed never wrote it. But every chunk
stands for itself, with its connections and messages one behind the other, so they are taken from
the front; after damage the next chunk is looked for. Of a chunk that is cut off in the middle the
messages before the cut are whole. A bag is gone through twice, first for its topics, then for the
messages of one; chunks are unpacked in pieces.

A bag has no checksums. What is taken here is as it stands in the file; only lengths, names and the
layout of the messages say that it is what was written.
"""

from __future__ import annotations

import re
import struct
from array import array
from collections import Counter
from collections.abc import Container, Iterator, Mapping
from dataclasses import dataclass, field

from cpl.logs.budget import LARGEST_MESSAGE, MOST_RECORDS, OverBudgetError
from cpl.logs.salvage import Damage
from cpl.logs.source import CannotUnpackError, Flow, ShortError, Source, unpacked

__all__ = ["BAG_MAGIC", "BagConnection", "BagSurvey", "bag_messages", "survey_bag"]

BAG_MAGIC = b"#ROSBAG V2.0\n"
MESSAGE, HEADER, INDEX, CHUNK, CHUNK_INFO, CONNECTION = range(2, 8)
LONGEST_HEADER = 1 << 16  # [byte]
LARGEST_DESCRIPTION = 4 << 20  # [byte] of a connection with its message definition
MOST_DAMAGES = 1000  # that are told apart
WORD = struct.Struct("<I")
NS = 1_000_000_000


class _BrokenError(Exception):
    """A record is not what its lengths and names say."""


@dataclass(frozen=True, kw_only=True)
class BagConnection:
    """A topic of the bag.

    Attributes:
        id: Its number.
        topic: Its name.
        msgtype: Its type, as ROS 2 writes it: ``nav_msgs/msg/Odometry``.
        msgdef: Definition of the type.
    """

    id: int
    topic: str
    msgtype: str
    msgdef: str


@dataclass(kw_only=True)
class BagSurvey:
    """What a bag holds.

    Attributes:
        source: The file.
        chunks: Where the chunks begin.
        sound: How many whole records each chunk has before its end or its damage.
        connections: The topics by number.
        held: How many messages each connection has.
        expected: How many it has by the bag's own count; None if that is lost.
        damages: What was dropped, and what is missing.
    """

    source: Source
    chunks: array[int] = field(default_factory=lambda: array("q"))
    sound: array[int] = field(default_factory=lambda: array("q"))
    connections: dict[int, BagConnection] = field(default_factory=dict)
    held: Counter[int] = field(default_factory=Counter)
    expected: dict[int, int] | None = None
    damages: list[Damage] = field(default_factory=list)

    def damage(self, at: int, size: int, what: str) -> None:
        """Note a damage, as far as there is room."""
        if len(self.damages) < MOST_DAMAGES:
            self.damages.append(Damage(at=at, size=size, what=what))


def survey_bag(source: Source) -> BagSurvey:
    """Return what is intact in a ROS 1 bag.

    Args:
        source: The file; any bytes.

    Returns:
        What was found; never an exception, whatever the bytes are.
    """
    bag, at, counts = BagSurvey(source=source), len(BAG_MAGIC), Counter[int]()
    told, records = False, 0
    if source.read(0, len(BAG_MAGIC)) != BAG_MAGIC:
        at = _next_chunk(bag, 0)
        bag.damage(0, at, "the file does not begin as a bag does")
    while at < source.size:
        records += 1
        if records > MOST_RECORDS:
            bag.damage(at, source.size - at, f"more than {MOST_RECORDS} records; no more is read")
            break
        try:
            fields, begin, end = _record(source, at)
            told |= _take(bag, counts, at, fields, begin, end)
        except (_BrokenError, OverBudgetError) as error:
            end = _next_chunk(bag, at + 1)
            bag.damage(at, end - at, str(error))
        at = end
    strangers = sum(held for number, held in bag.held.items() if number not in bag.connections)
    if strangers:
        bag.damage(0, 0, f"the topic of {strangers} messages is not known, so they are dropped")
    if told:
        bag.expected = dict(counts)
    else:
        bag.damage(source.size, 0, "the index at the end is missing")
    return bag


def bag_messages(bag: BagSurvey, wanted: Container[int]) -> Iterator[tuple[int, int, bytes]]:
    """Yield the messages of some connections, in the order of the file.

    Args:
        bag: What the survey found.
        wanted: Numbers of the connections.

    Yields:
        Number of the connection, time of receipt [ns] and content; empty where a message is longer
        than any pose, and then it is not held.
    """
    source = bag.source
    source.budget.again()
    for at, sound in zip(bag.chunks, bag.sound, strict=True):
        fields, begin, end = _record(source, at)
        kind = _compression(fields)
        flow = Flow(unpacked(source, begin, min(end, source.size) - begin, kind))
        for _ in range(sound):
            inner, length = _inner(flow)
            number = _number(inner, "conn", 4)
            if _number(inner, "op", 1) != MESSAGE or number not in wanted:
                flow.skip(length)
                continue
            seconds, ns = struct.unpack("<II", _sized(inner, "time", 8))
            if length > LARGEST_MESSAGE:
                flow.skip(length)
                yield number, seconds * NS + ns, b""
            else:
                yield number, seconds * NS + ns, flow.take(length)


def _take(
    bag: BagSurvey,
    counts: Counter[int],
    at: int,
    fields: Mapping[str, bytes],
    begin: int,
    end: int,
) -> bool:
    """Keep what a record says; tell whether it belongs to the index at the end."""
    op = _number(fields, "op", 1)
    if op == CHUNK:
        _take_chunk(bag, at, fields, begin, end)
        return False
    if end > bag.source.size:
        raise _BrokenError("the file ends inside a record, or its length is damaged")
    if op == CONNECTION:
        if end - begin > LARGEST_DESCRIPTION:
            raise _BrokenError(f"a connection is described by {end - begin} bytes")
        _take_connection(bag, fields, bag.source.read(begin, end - begin))
    elif op == CHUNK_INFO:
        if end - begin > LARGEST_DESCRIPTION:
            raise _BrokenError(f"a chunk is counted in {end - begin} bytes")
        told = bag.source.read(begin, end - begin)
        for number, count in struct.iter_unpack("<II", told[: len(told) // 8 * 8]):
            counts[number] += count
    elif op not in (HEADER, INDEX):
        raise _BrokenError(f"a record of kind {op} has no business here")
    return op == CHUNK_INFO


def _take_chunk(bag: BagSurvey, at: int, fields: Mapping[str, bytes], begin: int, end: int) -> None:
    """Go through a chunk up to its end, or to where the file or the damage cuts it off."""
    source, declared, kind = bag.source, _number(fields, "size", 4), _compression(fields)
    if declared > source.budget.most_unpacked:
        raise _BrokenError("a chunk's size is damaged")
    cut = end > source.size
    flow = Flow(unpacked(source, begin, min(end, source.size) - begin, kind))
    sound, whole, why = 0, 0, ""
    try:
        while not flow.ended():
            source.budget.record()
            fields, length = _inner(flow)
            op, number = _number(fields, "op", 1), _number(fields, "conn", 4)
            if op == CONNECTION and length <= LARGEST_DESCRIPTION:
                _take_connection(bag, fields, flow.take(length))
            elif op == MESSAGE:
                _sized(fields, "time", 8)
                flow.skip(length)
                bag.held[number] += 1
            else:
                raise _BrokenError(f"a record of kind {op} has no business in a chunk")
            sound, whole = sound + 1, flow.taken
    except ShortError:
        why = "a record is cut off"
    except (_BrokenError, CannotUnpackError, OverBudgetError) as error:
        why = str(error)
    bag.chunks.append(at)
    bag.sound.append(sound)
    if cut:
        bag.damage(at, max(0, declared - whole), "the file ends inside a chunk")
    elif why:
        bag.damage(at, max(0, declared - whole), f"a chunk is damaged: {why}")
    elif whole != declared:
        bag.damage(at, 0, "a chunk's size is not what it says")


def _take_connection(bag: BagSurvey, fields: Mapping[str, bytes], body: bytes) -> None:
    inner, number = _fields(body), _number(fields, "conn", 4)
    try:
        kind, definition = (inner[name].decode() for name in ("type", "message_definition"))
        topic = fields["topic"].decode()
    except (KeyError, UnicodeDecodeError) as error:
        raise _BrokenError("a connection is malformed") from error
    package, _, name = kind.rpartition("/")
    said = BagConnection(id=number, topic=topic, msgtype=f"{package}/msg/{name}", msgdef=definition)
    if bag.connections.setdefault(number, said) != said:
        raise _BrokenError(f"connection {number} is described twice, and differently")


def _compression(fields: Mapping[str, bytes]) -> str:
    kind = fields.get("compression", b"").decode("ascii", errors="replace")
    if kind not in ("none", "bz2", "lz4"):
        raise _BrokenError(f"a chunk is compressed by {kind!r}")
    return "" if kind == "none" else kind


def _record(source: Source, at: int) -> tuple[dict[str, bytes], int, int]:
    """Return the header of the record at a place, where its content begins and where it ends."""
    length = source.read(at, 4)
    if len(length) < 4:
        raise _BrokenError("the file ends inside a record")
    size = WORD.unpack(length)[0]
    begin = at + 4 + size + 4
    if size > LONGEST_HEADER or begin > source.size:
        raise _BrokenError("the file ends inside a record, or its length is damaged")
    head = source.read(at + 4, size + 4)
    return _fields(head[:size]), begin, begin + WORD.unpack_from(head, size)[0]


def _inner(flow: Flow) -> tuple[dict[str, bytes], int]:
    """Return the header of a chunk's next record, and the length of its content."""
    size = WORD.unpack(flow.take(4))[0]
    if size > LONGEST_HEADER:
        raise _BrokenError("a record's length is damaged")
    return _fields(flow.take(size)), WORD.unpack(flow.take(4))[0]


def _fields(header: bytes) -> dict[str, bytes]:
    found: dict[str, bytes] = {}
    at = 0
    while at < len(header):
        if len(header) - at < 4:
            raise _BrokenError("a header is malformed")
        length = WORD.unpack_from(header, at)[0]
        name, equals, value = header[at + 4 : at + 4 + length].partition(b"=")
        at += 4 + length
        if not equals or at > len(header):
            raise _BrokenError("a header is malformed")
        found[name.decode("latin-1")] = value
    return found


def _number(fields: Mapping[str, bytes], name: str, size: int) -> int:
    return int.from_bytes(_sized(fields, name, size), "little")


def _sized(fields: Mapping[str, bytes], name: str, size: int) -> bytes:
    value = fields.get(name, b"")
    if len(value) != size:
        raise _BrokenError(f"a header's {name} is missing or malformed")
    return value


def _next_chunk(bag: BagSurvey, at: int) -> int:
    """Return where the next chunk begins, or the end of the file."""
    source = bag.source
    try:
        for found in source.matches(_MARK, at, source.size, reach=8):
            # The fields of a header stand in any order, so it begins some bytes before its op.
            source.budget.look(256)
            for begin in range(max(at, found - 64), found - 3):
                try:
                    fields, _, _ = _record(source, begin)
                except _BrokenError:
                    continue
                if {"op", "compression", "size"} <= fields.keys():
                    return begin
    except OverBudgetError as error:
        bag.damage(at, 0, str(error))
    return source.size


_MARK = re.compile(rb"\x04\0\0\0op=\x05")
