"""Every stored format, cut short and with flipped bits."""

import json
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pandas as pd

from cpl.logs import LogError, RunInfo, read_run
from cpl.logs.writer import encoded_run
from cpl.publish import cache
from cpl.store import (
    DamagedModelError,
    DamagedResultError,
    Manifest,
    PublishedShard,
    Verification,
    WorkStore,
    decode_model,
    encode_model,
    publish,
    read_published,
    table_digest,
)
from tests.faults.frame import Row, damaged, tally
from tests.logs.conftest import make_rows

Outcome = Callable[[bytes], str]


def provoke(count: int) -> Iterator[Row]:
    """Damage one sample of each format `count` times by cutting and `count` times by a flip."""
    for place, (content, outcome) in _samples().items():
        assert outcome(content) == "harmless", place
        for how, fault in (("cut", "cut short"), ("flip", "one bit flipped")):
            yield tally(place, fault, map(outcome, damaged(content, how, count)))


def _samples() -> dict[str, tuple[bytes, Outcome]]:
    folder = Path(tempfile.mkdtemp(prefix="cpl-faults-"))
    return {
        "shard of the work store": _shard(folder / "store"),
        **_published(folder / "data" / "results"),
        "trained network (safetensors)": _network(),
        "log (MCAP)": _log(folder),
        **_execution(folder / "executed"),
    }


def _table() -> pd.DataFrame:
    models = [b"", encode_model({"w": np.arange(40.0)}, {"seed": 3})]
    return pd.DataFrame({"n": [1, 2], "share": [0.1, 0.2], "rule": ["a", "b"], "model": models})


def _shard(root: Path) -> tuple[bytes, Outcome]:
    store, key, table = WorkStore(root), "0" * 64, _table()
    store.save("toy", key, "part", table)
    path = next(root.glob("**/part.shard"))

    def outcome(content: bytes) -> str:
        path.write_bytes(content)
        found = store.load("toy", key, "part")
        if found is None:  # put aside and said so: it will be computed again
            return "refused"
        return "harmless" if table_digest(found.table) == table_digest(table) else "silent"

    return path.read_bytes(), outcome


def _published(root: Path) -> dict[str, tuple[bytes, Outcome]]:
    table = _table()
    manifest = Manifest(
        experiment="toy", profile="paper", parameters={"n": 2}, seeds={}, label="exact",
        commit="0" * 40, origins=["cpl.rng"], modules={}, versions={}, machine={},
        made="2026-01-01",
        seconds=0.0, shards=[PublishedShard(name="part", first_row=0, rows=2)],
        verified=Verification(date="2026-01-01", modules={}, versions={}, shards=["part"], of=1),
    )  # fmt: skip
    publish(table, manifest, root=root)
    sound = read_published("toy", "paper", root=root)
    files = {
        "published table (Parquet)": root / "toy" / "paper.parquet",
        "its manifest (JSON)": root / "toy" / "paper.json",
        "its model (safetensors)": root.parent / "models" / "toy-paper" / "part.safetensors",
    }

    def outcome_of(path: Path, whole: bytes) -> Outcome:
        def outcome(content: bytes) -> str:
            path.write_bytes(content)
            try:
                found, told = read_published("toy", "paper", root=root)
            except DamagedResultError:
                return "refused"
            finally:
                path.write_bytes(whole)
            same = table_digest(found) == table_digest(sound[0]) and told == sound[1]
            return "harmless" if same else "silent"

        return outcome

    contents = {place: path.read_bytes() for place, path in files.items()}
    return {
        place: (content, outcome_of(files[place], content)) for place, content in contents.items()
    }


def _network() -> tuple[bytes, Outcome]:
    content = encode_model({"w": np.arange(400.0), "b": np.ones(3, np.float32)}, {"seed": 3})
    sound = decode_model(content)

    def outcome(damage: bytes) -> str:
        try:
            found = decode_model(damage)
        except DamagedModelError:
            return "refused"
        same = found.config == sound.config and all(
            np.array_equal(found.arrays[name], sound.arrays[name]) for name in sound.arrays
        )
        return "harmless" if same else "silent"

    return content, outcome


def _log(folder: Path) -> tuple[bytes, Outcome]:
    info = RunInfo(provenance="simulated-kinematic", config={"kp": 1.5}, seed=17)
    content, path = encoded_run(make_rows(60), info), folder / "run.mcap"
    path.write_bytes(content)
    sound = read_run(path, strict=True)

    def outcome(damage: bytes) -> str:
        path.write_bytes(damage)
        try:
            found = read_run(path)
        except LogError:
            return "refused"
        if found.recovery.faults or found.recovery.rows_dropped or not found.recovery.whole:
            kept = sound.table.loc[found.table.index]
            return "recovered" if found.table.equals(kept[found.table.columns]) else "silent"
        return "harmless" if found.table.equals(sound.table) else "silent"

    return content, outcome


def _execution(folder: Path) -> dict[str, tuple[bytes, Outcome]]:
    notebook = json.dumps({"cells": [{"source": f"cell {n}"} for n in range(20)]})
    cache.save(folder, "small", notebook, {"key": "k", "chosen": {}, "seconds": 1.5})
    sound = cache.load(folder, "small", "k")
    files = {
        "executed chapter (notebook)": folder / "small.ipynb",
        "its record (JSON)": folder / "small.json",
    }

    def outcome_of(path: Path, whole: bytes) -> Outcome:
        def outcome(content: bytes) -> str:
            path.write_bytes(content)
            found = cache.load(folder, "small", "k")
            path.write_bytes(whole)
            if found is None:  # it is executed again
                return "refused"
            return "harmless" if found == sound else "silent"

        return outcome

    contents = {place: path.read_bytes() for place, path in files.items()}
    return {
        place: (content, outcome_of(files[place], content)) for place, content in contents.items()
    }
