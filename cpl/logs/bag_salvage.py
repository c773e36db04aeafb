"""Get out of a ROS 1 bag what is left of it when its index is lost.

A bag's index stands at its end, and a recorder that was killed never wrote it: the ordinary reader
finds nothing in such a file. But every chunk stands for itself, with its connections and messages
one behind the other, so they are taken from the front; after damage the next chunk is looked for.
Of a chunk that is cut off in the middle the messages before the cut are whole.

A bag has no checksums. What is taken here is as it stands in the file; only lengths, names and the
message definitions' own MD5 say that it is what was written.
"""

from __future__ import annotations

import bz2
import struct
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

from cpl.logs.salvage import Damage

__all__ = ["BAG_MAGIC", "BagConnection", "BagSalvage", "salvage_bag"]

BAG_MAGIC = b"#ROSBAG V2.0\n"
MESSAGE, HEADER, INDEX, CHUNK, CHUNK_INFO, CONNECTION = range(2, 8)
LARGEST_CHUNK = 1 << 28  # [byte] when unpacked: a length beyond is damage, not data
LONGEST_HEADER = 1 << 16  # [byte]
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
        digest: MD5 of the definition, as ROS computes it.
    """

    id: int
    topic: str
    msgtype: str
    msgdef: str
    digest: str


@dataclass(kw_only=True)
class BagSalvage:
    """What a bag holds; it is asked as rosbags' own reader is.

    Attributes:
        found: Number of the connection, time of receipt [ns] and content of each message.
        damages: What was dropped, and what is missing.
        expected: Messages of each connection by the bag's own count; empty if that is lost.
    """

    known: dict[int, BagConnection] = field(default_factory=dict)
    found: list[tuple[int, int, bytes]] = field(default_factory=list)
    damages: list[Damage] = field(default_factory=list)
    expected: dict[int, int] = field(default_factory=dict)

    @property
    def connections(self) -> list[BagConnection]:
        """The topics that have a message definition."""
        return list(self.known.values())

    def messages(
        self, connections: Iterable[BagConnection]
    ) -> Iterator[tuple[BagConnection, int, bytes]]:
        """Yield connection, receipt [ns] and content of the chosen topics' messages, by time."""
        chosen = {each.id: each for each in connections}
        kept = [each for each in self.found if each[0] in chosen]
        for number, received_ns, raw in sorted(kept, key=lambda each: each[1]):
            yield chosen[number], received_ns, raw

    def deserialize(self, raw: bytes, msgtype: str) -> Any:  # noqa: ANN401 - a message
        """Return a message."""
        return self._types.deserialize_ros1(raw, msgtype)

    @cached_property
    def _types(self) -> Any:  # noqa: ANN401 - rosbags is imported only where a bag is read
        """The definitions that the bag brings along, each held against its MD5."""
        from rosbags.typesys import Stores, get_types_from_msg, get_typestore

        store = get_typestore(Stores.EMPTY)
        types: dict[str, Any] = {}
        for each in self.connections:
            types.update(get_types_from_msg(each.msgdef, each.msgtype))
        store.register(types)
        for each in self.connections:
            if (digest := store.generate_msgdef(each.msgtype)[1]) != each.digest:
                msg = f"the definition of {each.msgtype} has MD5 {digest}, not {each.digest}"
                raise ValueError(msg)
        return store


def salvage_bag(data: bytes) -> BagSalvage:
    """Return what is intact in a ROS 1 bag.

    Args:
        data: The file's bytes; any bytes.

    Returns:
        What was found; never an exception, whatever the bytes are.
    """
    bag, at, told = BagSalvage(), len(BAG_MAGIC), False
    if not data.startswith(BAG_MAGIC):
        at = _next_chunk(data, 0)
        bag.damages.append(Damage(at=0, size=at, what="the file does not begin as a bag does"))
    while at < len(data):
        try:
            fields, begin, end = _record(data, at)
            told |= _take(bag, data, at, fields, begin, end)
        except _BrokenError as error:
            end = _next_chunk(data, at + 1)
            bag.damages.append(Damage(at=at, size=end - at, what=str(error)))
        at = end
    strangers = sum(number not in bag.known for number, _, _ in bag.found)
    if strangers:
        what = f"the topic of {strangers} messages is not known, so they are dropped"
        bag.damages.append(Damage(at=0, size=0, what=what))
    if not told:
        bag.expected = {}
        bag.damages.append(Damage(at=len(data), size=0, what="the index at the end is missing"))
    return bag


def _take(
    bag: BagSalvage, data: bytes, at: int, fields: Mapping[str, bytes], begin: int, end: int
) -> bool:
    """Keep what a record says; tell whether it belongs to the index at the end."""
    op = _number(fields, "op", 1)
    if op == CHUNK:
        _take_chunk(bag, data, at, fields, begin, end)
        return False
    if end > len(data):
        raise _BrokenError("the file ends inside a record, or its length is damaged")
    if op == CONNECTION:
        _take_connection(bag, fields, data[begin:end])
    elif op == CHUNK_INFO:
        for place in range(begin, end - 7, 8):
            number, count = WORD.unpack_from(data, place)[0], WORD.unpack_from(data, place + 4)[0]
            bag.expected[number] = bag.expected.get(number, 0) + count
    elif op not in (HEADER, INDEX):
        raise _BrokenError(f"a record of kind {op} has no business here")
    return op == CHUNK_INFO


def _take_chunk(
    bag: BagSalvage, data: bytes, at: int, fields: Mapping[str, bytes], begin: int, end: int
) -> None:
    """Keep a chunk's records up to its end, or to where the file or the damage cuts it off."""
    raw = _unpacked(data[begin:end], fields)
    cut = end > len(data)
    place = 0
    try:
        while place < len(raw):
            inner, first, last = _record(raw, place)
            if last > len(raw):
                raise _BrokenError("a record is cut off")
            op = _number(inner, "op", 1)
            if op == CONNECTION:
                _take_connection(bag, inner, raw[first:last])
            elif op == MESSAGE:
                seconds, ns = struct.unpack("<II", _sized(inner, "time", 8))
                message = (_number(inner, "conn", 4), seconds * NS + ns, raw[first:last])
                bag.found.append(message)
            else:
                raise _BrokenError(f"a record of kind {op} has no business in a chunk")
            place = last
    except _BrokenError as error:
        what = "the file ends inside a chunk" if cut else f"a chunk is damaged: {error}"
        bag.damages.append(Damage(at=at, size=len(raw) - place, what=what))
        return
    if len(raw) != _number(fields, "size", 4):
        what = "the file ends inside a chunk" if cut else "a chunk is shorter than it says"
        bag.damages.append(Damage(at=at, size=0, what=what))


def _take_connection(bag: BagSalvage, fields: Mapping[str, bytes], body: bytes) -> None:
    inner, number = _fields(body), _number(fields, "conn", 4)
    try:
        texts = {name: inner[name].decode() for name in ("type", "md5sum", "message_definition")}
        topic = fields["topic"].decode()
    except (KeyError, UnicodeDecodeError) as error:
        raise _BrokenError("a connection is malformed") from error
    package, _, name = texts["type"].rpartition("/")
    said = BagConnection(
        id=number,
        topic=topic,
        msgtype=f"{package}/msg/{name}",
        msgdef=texts["message_definition"],
        digest=texts["md5sum"],
    )
    if bag.known.setdefault(number, said) != said:
        raise _BrokenError(f"connection {number} is described twice, and differently")


def _unpacked(body: bytes, fields: Mapping[str, bytes]) -> bytes:
    """Return a chunk's content, or as much of it as comes out before a cut."""
    kind = fields.get("compression", b"")
    if _number(fields, "size", 4) > LARGEST_CHUNK:
        raise _BrokenError("a chunk's size is damaged")
    if kind == b"none":
        return body
    try:
        if kind == b"bz2":
            return bz2.BZ2Decompressor().decompress(body, LARGEST_CHUNK)
        if kind == b"lz4":
            from lz4.frame import LZ4FrameDecompressor

            return LZ4FrameDecompressor().decompress(body, LARGEST_CHUNK)
    except (OSError, EOFError, ValueError, RuntimeError) as error:
        raise _BrokenError("a chunk cannot be decompressed") from error
    raise _BrokenError(f"a chunk is compressed by {kind!r}")


def _record(data: bytes, at: int) -> tuple[dict[str, bytes], int, int]:
    """Return the header of the record at a place, where its content begins and where it ends."""
    if len(data) - at < 4:
        raise _BrokenError("the file ends inside a record")
    length = WORD.unpack_from(data, at)[0]
    begin = at + 4 + length + 4
    if length > LONGEST_HEADER or begin > len(data):
        raise _BrokenError("the file ends inside a record, or its length is damaged")
    return (
        _fields(data[at + 4 : at + 4 + length]),
        begin,
        begin + WORD.unpack_from(data, begin - 4)[0],
    )


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


def _next_chunk(data: bytes, at: int) -> int:
    """Return where the next chunk begins, or the end of the data."""
    mark = b"\x04\x00\x00\x00op=" + bytes([CHUNK])
    while (found := data.find(mark, at)) >= 0:
        # The fields of a header stand in any order, so it begins some bytes before its op.
        for begin in range(max(at, found - 64), found - 3):
            try:
                fields, _, _ = _record(data, begin)
                if {"op", "compression", "size"} <= fields.keys():
                    return begin
            except _BrokenError:
                continue
        at = found + len(mark)
    return len(data)
