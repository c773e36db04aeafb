"""Read a run's MCAP file: all of it if it is whole, what is left if it is not, and say which."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Mapping
from pathlib import Path

from cpl.logs.assembly import Assembly
from cpl.logs.errors import (
    DamagedLogError,
    DuplicateChannelError,
    FrameError,
    LogError,
    MissingChannelError,
    NotALogError,
    ProvenanceError,
    SchemaError,
    UnitError,
)
from cpl.logs.finish import finished
from cpl.logs.info import METADATA, BrokenSealError, Described, unpacked
from cpl.logs.run import Run
from cpl.logs.salvage import MAGIC, Survey, messages, survey
from cpl.logs.schema import CHANNELS, FRAMES, PROVENANCES, Channel
from cpl.logs.sieve import Sieve
from cpl.logs.source import Source
from cpl.store import canonical_json

__all__ = ["read_mcap"]

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
    with Source.open(path) as source:
        found = survey(source)
        if not (source.read(0, len(MAGIC)) == MAGIC or found.chunks or found.metadata):
            raise NotALogError("is not an MCAP file", path=path)
        sieve, notes = Sieve("row {}"), list[str]()
        for each in found.damages:
            what = _dropped(each.what, each.size)
            sieve.drop(DamagedLogError, f"byte {each.at}", what, rows=0)
        said = _described(found, path, sieve)
        channels = _channels(found, said.topics, path)
        topics = _assemble(found, said, channels, sieve, notes, path)
        return finished(
            sieve,
            said.info,
            path,
            notes,
            size=source.size,
            lost=sum(each.size for each in found.damages),
            written=said.rows,
            topics=topics,
            origin="stated",
        )


def _dropped(what: str, size: int) -> str:
    return f"{what} ({size} bytes dropped)" if size else what


def _described(found: Survey, path: Path, sieve: Sieve) -> Described:
    """Return what describes the run, from the last intact copy, which knows the most."""
    copies = [each.metadata for each in found.metadata if each.name == METADATA]
    read: list[Described] = []
    for number, copy in enumerate(copies):
        where = f"metadata copy {number}"
        try:
            read.append(unpacked(copy))
            _check_conventions(copy, path, where)
        except BrokenSealError as error:
            sieve.drop(DamagedLogError, where, str(error), rows=0)
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
    topics = ", ".join(sorted({each.topic for each in found.channels.values()})) or "none"
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


def _channels(found: Survey, topics: tuple[str, ...], path: Path) -> dict[int, Channel | str]:
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
    for each in found.channels.values():
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
    except (ValueError, RecursionError) as error:
        raise UnitError("units are not JSON", path=path, where=known.topic) from error
    if units != known.units:
        what = f"units must be {known.units}, got {units}"
        raise UnitError(what, path=path, where=known.topic)
    if schema != known.schema:
        what = f"schema must be {known.schema!r}, got {schema!r}"
        raise SchemaError(what, path=path, where=known.topic)


def _assemble(
    found: Survey,
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
    foreign: Counter[str] = Counter()
    rows = Assembly(said.topics, sieve)
    for number, count in found.held.items():
        channel = channels.get(number)
        if not isinstance(channel, Channel):
            foreign[channel or f"channel {number}"] += count
    known = {number: each for number, each in channels.items() if isinstance(each, Channel)}
    for at, message in messages(found, known):
        rows.take(known[message.channel_id], message, at)
    notes += [f"{count} messages of {topic} were not read" for topic, count in foreign.items()]
    absent = _absent(rows, said.topics, sieve)
    topics = tuple(topic for topic in said.topics if topic not in absent)
    if rows.count and any(each.required and each.topic not in topics for each in CHANNELS):
        what = "there is no pose, without which a log is not one"
        raise MissingChannelError(what, path=path, where=CHANNELS[0].topic)
    rows.offer(topics)
    return topics


def _absent(rows: Assembly, topics: tuple[str, ...], sieve: Sieve) -> set[str]:
    """Name the channels that the file says it has and of which not one message is there."""
    absent = {each for each in topics if each not in rows.there and not _BY_TOPIC[each].sparse}
    for topic in sorted(absent if rows.count else ()):
        if not _BY_TOPIC[topic].required:
            what = "the file says it has this channel, and has not one message of it"
            sieve.drop(MissingChannelError, topic, what, rows=0)
    return absent
