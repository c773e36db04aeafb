"""What describes a run: where it comes from, its configuration and its seed."""

from __future__ import annotations

import hashlib
import json
import reprlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from cpl.logs.clock import LAST_NS
from cpl.logs.errors import ProvenanceError, SchemaError
from cpl.logs.schema import CHANNELS, FRAMES, PROVENANCES
from cpl.store import canonical_json, plain

__all__ = ["METADATA", "BrokenSealError", "Described", "RunInfo", "packed", "stated", "unpacked"]

METADATA = "cpl.run"  # name of the MCAP metadata record
VERSION = "1"
LONGEST = 1 << 20  # [characters] of a configuration
DEEPEST = 50  # levels of a configuration
LARGEST_SEED = 1 << 64


@dataclass(frozen=True, kw_only=True)
class RunInfo:
    """Where a run comes from.

    Args:
        provenance: One of `schema.PROVENANCES`.
        config: Everything that made the run: a dataclass or a mapping, as far as JSON holds it.
        seed: The run's seed; None where there is none, as in the real world.
        start_unix_ns: When it began [ns since 1970]; 0 where that says nothing.
        source: For an import: file, digest, importer and what it had to leave out.

    Raises:
        ValueError: Another provenance; a seed or start that is negative or beyond what is stored; a
            configuration that is no mapping, or that JSON cannot hold.

    Examples:
        >>> RunInfo(provenance="simulated-kinematic", config={"kp": 1.5}, seed=3).label
        'simulated-kinematic, seed 3'
    """

    provenance: str
    config: Any = field(default_factory=dict)
    seed: int | None = None
    start_unix_ns: int = 0
    source: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.provenance not in PROVENANCES:
            msg = f"provenance must be one of {', '.join(PROVENANCES)}, got {self.provenance!r}"
            raise ValueError(msg)
        for name, end in (("seed", LARGEST_SEED), ("start_unix_ns", LAST_NS)):
            value = getattr(self, name)
            whole = isinstance(value, int) and not isinstance(value, bool) and 0 <= value < end
            if not (whole or (name == "seed" and value is None)):
                shown = reprlib.repr(value)
                msg = f"{name} must be a whole number of at least 0 and below {end}, got {shown}"
                raise ValueError(msg)
        for name in ("config", "source"):
            value = plain(getattr(self, name))
            if not isinstance(value, dict):
                msg = f"{name} must be an object with names, got {reprlib.repr(value)}"
                raise ValueError(msg)
            object.__setattr__(self, name, value)

    @property
    def label(self) -> str:
        """The stamp that a figure of this run carries."""
        return self.provenance if self.seed is None else f"{self.provenance}, seed {self.seed}"


@dataclass(frozen=True, kw_only=True)
class Described:
    """What a metadata record says.

    Attributes:
        info: What describes the run.
        topics: The channels that it has, in the order in which they were registered.
        rows: How many rows it has; None in the copy at the file's begin, where nobody knows yet.
    """

    info: RunInfo
    topics: tuple[str, ...]
    rows: int | None


class BrokenSealError(ValueError):
    """The metadata is not what was written."""


def packed(info: RunInfo, channels: tuple[str, ...], rows: int | None = None) -> dict[str, str]:
    """Return what goes into the file's metadata record, sealed with its own digest.

    MCAP guards chunks with checksums, but not metadata: without the seal a flipped bit would turn
    seed 17 into seed 16 and nobody would know.

    Args:
        info: What describes the run.
        channels: Topics that the run has.
        rows: How many rows it has; None while it goes on.
    """
    content = {
        "format": "cpl-log",
        "version": VERSION,
        "provenance": info.provenance,
        "config": canonical_json(info.config),
        "seed": canonical_json(info.seed),
        "start_unix_ns": str(info.start_unix_ns),
        "source": canonical_json(info.source),
        "channels": canonical_json(channels),
        "rows": canonical_json(rows),
        "frames": canonical_json(FRAMES),
        "units": canonical_json({each.topic: each.units for each in CHANNELS}),
    }
    return content | {"sha256": _seal(content)}


def unpacked(content: Mapping[str, str]) -> Described:
    """Return what :func:`packed` was given.

    Raises:
        BrokenSealError: It is not what was written.
        ValueError: The version is unknown, or a value is missing or makes no sense.
    """
    rest = {name: text for name, text in content.items() if name != "sha256"}
    if content.get("sha256") != _seal(rest):
        msg = "the description of the run is not what was written: its digest differs"
        raise BrokenSealError(msg)
    if rest.get("version") != VERSION:
        msg = f"version must be {VERSION!r}, got {rest.get('version')!r}"
        raise ValueError(msg)
    try:
        info = RunInfo(
            provenance=rest["provenance"],
            config=_json(rest["config"], "config"),
            seed=_json(rest["seed"], "seed"),
            start_unix_ns=int(rest["start_unix_ns"]),
            source=_json(rest["source"], "source"),
        )
        topics, rows = _json(rest["channels"], "channels"), _json(rest["rows"], "rows")
        if not isinstance(topics, list) or not all(isinstance(each, str) for each in topics):
            msg = f"channels must be a list of topics, got {reprlib.repr(topics)}"
            raise ValueError(msg)
        counted = isinstance(rows, int) and not isinstance(rows, bool) and rows >= 0
        if not (rows is None or counted):
            msg = f"rows must be a count, got {reprlib.repr(rows)}"
            raise ValueError(msg)
        return Described(info=info, topics=tuple(topics), rows=rows)
    except KeyError as error:
        msg = f"the description of the run lacks {error.args[0]!r}"
        raise ValueError(msg) from error


def stated(
    said: Mapping[str, str],
    provenance: str | None,
    path: Path,
    source: Mapping[str, Any],
    *,
    silent: str | None = None,
) -> RunInfo:
    """Return what describes a recording, from what it says itself and what its reader says.

    Args:
        said: The file's own statements: `provenance`, `seed`, `start_unix_ns`, `config`, `source`.
        provenance: The reader's; None for nothing.
        path: The file.
        source: What the import says of itself, unless the file states a source.
        silent: The provenance where neither says anything; None if that is an error.

    Raises:
        ProvenanceError: Nobody says where it comes from, or both do and differ.
        SchemaError: A statement makes no sense.
    """
    own = said.get("provenance")
    if provenance and own and own != provenance:
        raise ProvenanceError(f"says it is {own}, but {provenance} was asked for", path=path)
    chosen = provenance or own or silent
    if chosen not in PROVENANCES:
        have = "does not say where it comes from" if chosen is None else f"says it is {chosen!r}"
        what = (
            f"{have}: give provenance, one of {', '.join(PROVENANCES)} (--provenance WORD; "
            "provenance= in Python)"
        )
        raise ProvenanceError(what, path=path)
    try:
        return RunInfo(
            provenance=chosen,
            config=_json(said.get("config", "{}"), "config"),
            seed=_json(said.get("seed", "null"), "seed"),
            start_unix_ns=int(said.get("start_unix_ns", "0")),
            source=_json(said.get("source", "{}"), "source") or {"file": path.name, **source},
        )
    except ValueError as error:
        raise SchemaError(str(error), path=path) from error


def _json(text: str, name: str) -> Any:  # noqa: ANN401 - JSON
    """Return what a description holds; refuse what is so deep that nothing could print it."""
    if len(text) > LONGEST:
        msg = f"{name} must have at most {LONGEST} characters, got {len(text)}"
        raise ValueError(msg)
    try:
        value = json.loads(text)
    except RecursionError as error:
        msg = f"{name} is nested too deep"
        raise ValueError(msg) from error
    except ValueError as error:
        msg = f"{name} must be JSON: {error}"
        raise ValueError(msg) from error
    level = [value]
    for _ in range(DEEPEST):
        level = [
            inner
            for each in level
            if isinstance(each, (dict, list))
            for inner in (each.values() if isinstance(each, dict) else each)
        ]
    if level:
        msg = f"{name} is nested deeper than {DEEPEST} levels"
        raise ValueError(msg)
    return value


def _seal(content: Mapping[str, str]) -> str:
    return hashlib.sha256(canonical_json(dict(content)).encode()).hexdigest()
