"""What the pieces of the experiments cost: seconds that were measured when they were computed.

`data/scale/seconds.json` keeps the processor seconds of each piece, as the work store noted them;
where a piece was never timed by itself, the mean of its published result stands for it.
"""

from __future__ import annotations

import json
from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cpl.experiments.run.found import names
from cpl.experiments.run.job import Job, experiment, job
from cpl.experiments.run.schedule import Piece
from cpl.store import Manifest, WorkStore, atomic_write, data_path, read_manifest

__all__ = ["Stage", "expected_seconds", "piece_seconds", "record", "stages"]

_PUBLISHED = "paper"
_FILE = ("scale", "seconds.json")


@dataclass(frozen=True, kw_only=True)
class Stage:
    """One experiment with what its pieces cost.

    Attributes:
        experiment: Its name.
        pieces: By experiment and shard.
        timed: How many of them were timed by themselves; for the others a mean stands.
    """

    experiment: str
    pieces: dict[tuple[str, str], Piece]
    timed: int


def stages() -> tuple[list[Stage], list[str]]:
    """Return the published experiments in an order in which each has what it needs.

    Returns:
        The stages, and the experiments of that profile that have no cost yet.
    """
    known = _read()
    found: dict[str, Stage] = {}
    unknown: list[str] = []

    def add(name: str) -> None:
        if name in found or name in unknown:
            return
        task = job(name, _PUBLISHED)
        needs = {
            piece: tuple(
                (need.experiment, shard) for need in task.needs(piece) for shard in need.shards
            )
            for piece in task.pieces
        }
        for below in sorted({place[0] for places in needs.values() for place in places}):
            add(below)
        mean = _mean(name, known)
        if mean is None:
            unknown.append(name)
            return
        own = known.get(name, {})
        pieces = {
            (name, piece): Piece(
                seconds=own.get(piece, mean),
                needs=tuple(place for place in needs[piece] if place[0] in found),
            )
            for piece in task.pieces
        }
        found[name] = Stage(
            experiment=name, pieces=pieces, timed=len(own.keys() & task.pieces.keys())
        )

    for name in names():
        if _PUBLISHED in experiment(name).profiles:
            add(name)
    return list(found.values()), unknown


def expected_seconds(name: str, pieces: Collection[str]) -> dict[str, float] | None:
    """Return the processor seconds that pieces should take; None if none was ever timed."""
    known = _read()
    mean = _mean(name, known)
    if mean is None:
        return None
    own = known.get(name, {})
    return {piece: own.get(piece, mean) for piece in pieces}


def piece_seconds(manifest: Manifest) -> dict[str, float]:
    """Return what each piece of a published result should take, by name."""
    mean = manifest.seconds / len(manifest.shards)
    own = _read().get(manifest.experiment, {}) if manifest.profile == _PUBLISHED else {}
    return {shard.name: own.get(shard.name, mean) for shard in manifest.shards}


def record(store: WorkStore | None = None) -> Path:
    """Note the seconds of every piece that the work store holds with the published settings.

    What was noted before and is not in the store any more stays.

    Returns:
        The file.
    """
    store = WorkStore() if store is None else store
    known = _read()
    for name in names():
        if _PUBLISHED not in experiment(name).profiles:
            continue
        task = job(name, _PUBLISHED)
        fresh = _stored(store, task)
        pieces = {**known.get(name, {}), **fresh}
        kept = {piece: pieces[piece] for piece in task.pieces if piece in pieces}
        known[name] = kept
    told = {name: pieces for name, pieces in sorted(known.items()) if pieces}
    text = json.dumps(told, indent=1) + "\n"
    return atomic_write(data_path(*_FILE), text)


def _stored(store: WorkStore, task: Job) -> dict[str, float]:
    """Return the seconds of the pieces, those that were computed last where there are several."""
    asked = task.parameters
    seconds: dict[str, tuple[float, float]] = {}
    for key, told in store.descriptions(task.name).items():
        if told.get("parameters") != asked:
            continue
        for piece in set(store.shards(task.name, key)) & task.pieces.keys():
            entry = store.load(task.name, key, piece)
            if entry is None or "seconds" not in entry.facts:
                continue
            made = (store.root / task.name / key / f"{piece}.shard").stat().st_mtime
            if made > seconds.get(piece, (0.0, 0.0))[0]:
                seconds[piece] = (made, round(float(entry.facts["seconds"]), 3))
    return {piece: value for piece, (_, value) in seconds.items()}


def _mean(name: str, known: dict[str, dict[str, float]]) -> float | None:
    """Return what a piece costs on average, by the published result, else by what was timed."""
    try:
        manifest = read_manifest(name, _PUBLISHED)
    except FileNotFoundError:
        own = known.get(name)
        return sum(own.values()) / len(own) if own else None
    return manifest.seconds / len(manifest.shards)


def _read() -> dict[str, dict[str, float]]:
    path = data_path(*_FILE)
    told: Any = json.loads(path.read_text(encoding="utf-8")) if path.is_file() else {}
    return told
