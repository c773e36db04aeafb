"""Read a run's MCAP file: all of it if it is whole, what is left if it is not, and say which."""

from __future__ import annotations

import json
from collections import defaultdict
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from mcap.records import Message

from cpl.logs.checks import Sieve, check_run
from cpl.logs.codec import NS, MalformedError, decode
from cpl.logs.errors import (
    DamagedLogError,
    DuplicateChannelError,
    EmptyLogError,
    Fault,
    FrameError,
    LogError,
    MissingChannelError,
    NotALogError,
    ProvenanceError,
    SchemaError,
    TimeOrderError,
    UnitError,
)
from cpl.logs.info import METADATA, BrokenSealError, Described, RunInfo, unpacked
from cpl.logs.run import Recovery, Run
from cpl.logs.salvage import MAGIC, Salvage, salvage
from cpl.logs.schema import CHANNELS, COLUMNS, FRAMES, PROVENANCES, Channel
from cpl.store import canonical_json

__all__ = ["as_table", "content", "finished", "read_mcap"]

LARGEST = 1 << 31  # [byte] a file is read into memory as a whole
_BY_TOPIC = {each.topic: each for each in CHANNELS}


def read_mcap(path: Path) -> Run:
    """Read a run that `cpl.logs` wrote.

    Args:
        path: The file.

    Returns:
        The run with every row that is confirmed and makes sense; `recovery` says what is not there.

    Raises:
        LogError: One of its kinds: there is nothing to be had, or it cannot be trusted.
    """
    data = content(path)
    found = salvage(data)
    if not (data.startswith(MAGIC) or found.messages or found.metadata):
        raise NotALogError("is not an MCAP file", path=path)
    faults = [
        Fault(error=DamagedLogError, where=f"byte {each.at}", what=_dropped(each.what, each.size))
        for each in found.damages
    ]
    said = _described(found, path, faults)
    channels = _channels(found, said.topics, path)
    sieve, notes = Sieve(faults=faults), list[str]()
    topics = _assemble(found, said, channels, sieve, notes, path)
    lost = sum(each.size for each in found.damages)
    return finished(
        sieve, said.info, path, notes, size=len(data), lost=lost, written=said.rows, topics=topics
    )


def content(path: Path) -> bytes:
    """Return a file's bytes.

    Raises:
        EmptyLogError: There are none.
        NotALogError: It is a folder, or larger than what is read at once.
        FileNotFoundError: It is not there.
    """
    if path.is_dir():
        raise NotALogError("is a folder; name one of its files, or use read_runs", path=path)
    if (size := path.stat().st_size) > LARGEST:
        raise NotALogError(f"has {size} bytes; the most that is read is {LARGEST}", path=path)
    data = path.read_bytes()
    if not data:
        raise EmptyLogError("has no content", path=path)
    return data


def finished(
    sieve: Sieve,
    info: RunInfo,
    path: Path,
    notes: list[str],
    *,
    size: int,
    topics: tuple[str, ...],
    written: int | None,
    lost: int = 0,
) -> Run:
    """Return what the sieve let through as a run.

    Args:
        sieve: Rows and faults.
        info: What describes the run.
        path: The file.
        notes: What was done to read it.
        size: Of the file [byte].
        topics: The channels that every row has.
        written: How many rows there were; None if nobody knows.
        lost: Bytes that nothing could be made of.

    Raises:
        EmptyLogError: No row is left.
        UnitError: As `checks.check_run`.
        FrameError: As `checks.check_run`.
    """
    if not sieve.rows:
        causes = "; ".join(str(fault) for fault in sieve.faults[:3])
        raise EmptyLogError(f"has no usable row{': ' * bool(causes)}{causes}", path=path)
    table = as_table(sieve.rows, sieve.numbers, _columns(topics))
    check_run(table, path)
    t_s = table["t_s"].to_numpy()
    recovery = Recovery(
        rows=len(table),
        seconds=float(t_s[-1] - t_s[0]),
        bytes=size,
        rows_dropped=None if written is None else written - len(table),
        bytes_dropped=lost,
        faults=tuple(sieve.faults),
        notes=tuple(notes),
    )
    return Run(path=path, info=info, table=table, recovery=recovery)


def as_table(rows: list[dict[str, Any]], numbers: list[int], order: list[str]) -> pd.DataFrame:
    """Return rows as a table with the types that the schema states."""
    columns: dict[str, Any] = {}
    for name in order:
        if _KINDS.get(name) == "text":
            columns[name] = pd.array([row.get(name, "") for row in rows], dtype="str")
        else:
            kind = np.int64 if _KINDS.get(name) == "int" else np.float64
            columns[name] = np.array([row[name] for row in rows], dtype=kind)
    return pd.DataFrame(columns, index=pd.Index(numbers, name="row", dtype=np.int64))


_KINDS = {each.column: each.kind for channel in CHANNELS for each in channel.fields}


def _columns(topics: tuple[str, ...]) -> list[str]:
    have = {name for topic in topics if topic in _BY_TOPIC for name in _BY_TOPIC[topic].columns}
    return [name for name in COLUMNS if name == "t_s" or name in have]


def _dropped(what: str, size: int) -> str:
    return f"{what} ({size} bytes dropped)" if size else what


def _described(found: Salvage, path: Path, faults: list[Fault]) -> Described:
    """Return what describes the run, from the last intact copy, which knows the most."""
    copies = [each.metadata for each in found.metadata if each.name == METADATA]
    read: list[Described] = []
    for number, copy in enumerate(copies):
        where = f"metadata copy {number}"
        try:
            read.append(unpacked(copy))
            _check_conventions(copy, path, where)
        except BrokenSealError as error:
            faults.append(Fault(error=DamagedLogError, where=where, what=str(error)))
        except LogError:
            raise
        except ValueError as error:
            known = copy.get("provenance") in PROVENANCES
            kind = SchemaError if known else ProvenanceError
            raise kind(str(error), path=path, where=where) from error
    if len({canonical_json(each.info) for each in read}) > 1:
        raise DamagedLogError("has two descriptions that contradict each other", path=path)
    if read:
        return read[-1]
    if found.library == "cpl.logs" or copies or found.damages:
        what = "what describes the run is lost, so where it comes from is not known"
        raise DamagedLogError(what, path=path)
    topics = ", ".join(sorted({each.topic for each in found.channels})) or "none"
    what = f"is MCAP, but has no {METADATA!r} metadata, so cpl did not write it; topics: {topics}"
    raise SchemaError(what, path=path)


def _check_conventions(said: Mapping[str, str], path: Path, where: str) -> None:
    """Refuse a sealed description whose units or frames are not those of this schema."""
    units = canonical_json({each.topic: each.units for each in CHANNELS})
    if said.get("units") != units:
        raise UnitError(f"units must be {units}, got {said.get('units')}", path=path, where=where)
    if said.get("frames") != (frames := canonical_json(FRAMES)):
        what = f"frames must be {frames}, got {said.get('frames')}"
        raise FrameError(what, path=path, where=where)


def _channels(found: Salvage, topics: tuple[str, ...], path: Path) -> dict[int, Channel | str]:
    """Return the channel of each number: one of ours, or a foreign topic's name.

    The channel records sit in the first chunk. If that is lost, the numbers follow from the order
    of the topics in the metadata, which is the order in which they were registered.
    """
    channels: dict[int, Channel | str] = {}
    for number, topic in enumerate(topics, start=1):
        if topic not in _BY_TOPIC:
            raise SchemaError(f"claims a channel that no version of cpl has: {topic!r}", path=path)
        channels[number] = _BY_TOPIC[topic]
    seen: dict[str, int] = {}
    for each in found.channels:
        if seen.setdefault(each.topic, each.id) != each.id:
            raise DuplicateChannelError(
                "is there twice, so which one is meant is not known", path=path, where=each.topic
            )
        known = _BY_TOPIC.get(each.topic)
        channels[each.id] = known or each.topic
        if known:
            schema = found.schemas.get(each.schema_id)
            _check_channel(known, each.metadata, schema.name if schema else "", path)
    return channels


def _check_channel(known: Channel, said: Mapping[str, str], schema: str, path: Path) -> None:
    if said.get("frame", "") != known.frame:
        what = f"frame must be {known.frame!r}, got {said.get('frame')!r}"
        raise FrameError(what, path=path, where=known.topic)
    try:
        units = json.loads(said.get("units", "{}"))
    except json.JSONDecodeError as error:
        raise UnitError("units are not JSON", path=path, where=known.topic) from error
    if units != known.units:
        what = f"units must be {known.units}, got {units}"
        raise UnitError(what, path=path, where=known.topic)
    if schema != known.schema:
        what = f"schema must be {known.schema!r}, got {schema!r}"
        raise SchemaError(what, path=path, where=known.topic)


def _assemble(
    found: Salvage,
    said: Described,
    channels: dict[int, Channel | str],
    sieve: Sieve,
    notes: list[str],
    path: Path,
) -> tuple[str, ...]:
    """Put messages together to rows, offer these to the sieve in the order of the file.

    Returns:
        The channels that every row has.
    """
    foreign: dict[str, int] = defaultdict(int)
    rows: dict[int, dict[str, Message]] = {}
    broken = set[int]()
    for at, message in found.messages:
        channel, number = channels.get(message.channel_id), message.sequence
        if not isinstance(channel, Channel):
            foreign[channel or f"channel {message.channel_id}"] += 1
            continue
        row = rows.setdefault(number, {})
        if channel.topic not in row:
            row[channel.topic] = message
            continue
        same = (row[channel.topic].data, row[channel.topic].log_time) == (
            message.data, message.log_time)  # fmt: skip
        what = "is there twice, the same" if same else "is there twice and differs"
        where = f"row {number}, {channel.topic}, chunk at byte {at}"
        new = not same and number not in broken
        sieve.drop(DuplicateChannelError, where, what, rows=int(new))
        broken |= set() if same else {number}
    notes += [f"{count} messages of {topic} were not read" for topic, count in foreign.items()]
    absent = _absent(rows, said.topics, sieve)
    topics = tuple(topic for topic in said.topics if topic not in absent)
    if rows and any(each.required and each.topic not in topics for each in CHANNELS):
        what = "there is no pose, without which a log is not one"
        raise MissingChannelError(what, path=path, where=CHANNELS[0].topic)
    for number, messages in rows.items():
        if number not in broken:
            _offer(number, messages, said.info, topics, sieve)
    return topics


def _absent(rows: dict[int, dict[str, Message]], topics: tuple[str, ...], sieve: Sieve) -> set[str]:
    """Name the channels that the file says it has and of which not one message is there."""
    there = {topic for messages in rows.values() for topic in messages}
    absent = {topic for topic in topics if topic not in there and not _BY_TOPIC[topic].sparse}
    for topic in sorted(absent if rows else ()):
        if not _BY_TOPIC[topic].required:
            what = "the file says it has this channel, and has not one message of it"
            sieve.drop(MissingChannelError, topic, what, rows=0)
    return absent


def _offer(
    number: int,
    messages: dict[str, Message],
    info: RunInfo,
    topics: tuple[str, ...],
    sieve: Sieve,
) -> None:
    where = f"row {number}"
    for topic in topics:
        if topic not in messages and not _BY_TOPIC[topic].sparse:
            sieve.drop(MissingChannelError, where, f"has no message of {topic}")
            return
    stamps = {each.log_time for each in messages.values()}
    if len(stamps) != 1:
        spread = (max(stamps) - min(stamps)) / NS
        sieve.drop(TimeOrderError, where, f"its messages are up to {spread} s apart")
        return
    row: dict[str, Any] = {"t_s": (stamps.pop() - info.start_unix_ns) / NS}
    for topic, message in messages.items():
        try:
            row |= decode(_BY_TOPIC[topic], message.data)
        except MalformedError as error:
            sieve.drop(error.error, f"{where}, {topic}", str(error))
            return
    sieve.offer(number, row, where)
