import logging
import multiprocessing
import os
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from cpl.rng import stream
from cpl.store import WorkStore, same_table

KEY = "0" * 64


@pytest.fixture
def store(tmp_path):
    return WorkStore(tmp_path)


@pytest.fixture
def table():
    return pd.DataFrame({"n": np.arange(5), "q": np.linspace(0, 1, 5), "rule": list("abcde")})


def only_file(store: WorkStore) -> Path:
    (path,) = store.root.glob("**/*.shard")
    return path


def test_save_and_load(store, table):
    store.save("toy", KEY, "part-0", table, {"seconds": 0.5})
    found = store.load("toy", KEY, "part-0")
    assert same_table(found.table, table, rtol=0, atol=0) is None
    assert found.facts == {"seconds": 0.5}
    assert store.shards("toy", KEY) == ("part-0",)
    assert store.load("toy", KEY, "part-1") is None
    assert store.load("toy", "1" * 64, "part-0") is None


def test_the_default_place_is_the_work_path(monkeypatch, tmp_path):
    monkeypatch.setenv("CPL_STORE", str(tmp_path / "here"))
    assert WorkStore().root == (tmp_path / "here").resolve()


def damaged(store, table, change, caplog):
    """Save, damage, load: it must be refused, reported, put aside; and then be recomputable."""
    store.save("toy", KEY, "part-0", table)
    path = only_file(store)
    path.write_bytes(change(path.read_bytes()))
    caplog.clear()
    with caplog.at_level(logging.WARNING):
        assert store.load("toy", KEY, "part-0") is None
    assert "put aside" in caplog.text
    assert store.shards("toy", KEY) == ()
    aside = store.quarantined()
    assert len(aside) == 1
    aside[0].unlink()
    store.save("toy", KEY, "part-0", table)
    assert store.load("toy", KEY, "part-0") is not None


def check_faults(store, table, caplog, count):
    rng = stream(0, "faults", "shard")
    size = 0

    def cut(content: bytes) -> bytes:
        return content[: int(rng.integers(0, len(content)))]

    def flip(content: bytes) -> bytes:
        nonlocal size
        size = len(content)
        place, bit = int(rng.integers(0, size)), int(rng.integers(0, 8))
        return content[:place] + bytes([content[place] ^ (1 << bit)]) + content[place + 1 :]

    for _ in range(count):
        damaged(store, table, cut, caplog)
        damaged(store, table, flip, caplog)
    assert size > 0


def test_truncation_and_bit_flips_are_detected(store, table, caplog):
    check_faults(store, table, caplog, 20)


@pytest.mark.faults
def test_truncation_and_bit_flips_are_detected_200_each(store, table, caplog):
    check_faults(store, table, caplog, 200)


@pytest.mark.parametrize(
    "change",
    [lambda c: b"", lambda c: c + b"\0", lambda c: c.replace(b"cpl-shard 1", b"cpl-shard 2")],
    ids=["empty", "longer", "other-format"],
)
def test_other_damage_is_detected(store, table, change, caplog):
    damaged(store, table, change, caplog)


def test_every_byte_counts(store, table, caplog):
    """Exhaustive on a tiny shard: no byte can change unnoticed."""
    store.save("toy", KEY, "part-0", table.iloc[:1][["n"]])
    path = only_file(store)
    whole = path.read_bytes()
    for place in range(len(whole)):
        path.write_bytes(whole[:place] + bytes([whole[place] ^ 1]) + whole[place + 1 :])
        assert store.load("toy", KEY, "part-0") is None


def test_a_whole_shard_under_another_name_is_refused(store, table, caplog):
    store.save("toy", KEY, "part-0", table)
    path = only_file(store)
    path.rename(path.with_name("part-1.shard"))
    assert store.load("toy", KEY, "part-1") is None
    assert "written for shard 'part-0'" in caplog.text


@pytest.mark.parametrize("name", ["", "../x", "a/b", ".hidden", "a b", "a\nb", "x" * 200, "a..b"])
def test_names_cannot_leave_the_store(store, table, name):
    for words in [(name, KEY, "p"), ("toy", name, "p"), ("toy", KEY, name)]:
        with pytest.raises(ValueError, match="plain name"):
            store.save(*words, table)


def test_descriptions_are_kept_beside_the_key(store):
    store.describe("toy", KEY, {"parameters": {"n": 1}})
    store.describe("toy", KEY, {"parameters": {"n": 1}})
    assert store.descriptions("toy") == {KEY: {"parameters": {"n": 1}}}
    assert store.shards("toy", KEY) == ()


def test_a_read_only_store_says_so(store, table, monkeypatch):
    def refuse(*_args, **_words):
        raise PermissionError(13, "Permission denied")

    store.save("toy", KEY, "part-0", table)
    monkeypatch.setattr("cpl.store.paths.tempfile.mkstemp", refuse)
    with pytest.raises(PermissionError):
        store.save("toy", KEY, "part-1", table)
    assert store.load("toy", KEY, "part-0") is not None


def test_a_full_disk_leaves_no_shard(store, table, monkeypatch):
    def full(_handle):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OSError, match="No space"):
        store.save("toy", KEY, "part-0", table)
    assert store.shards("toy", KEY) == ()


def _drive(root: str, worker: int) -> None:
    store = WorkStore(Path(root))
    for shard in range(12):
        if store.load("toy", KEY, f"part-{shard}") is None:
            store.save("toy", KEY, f"part-{shard}", pd.DataFrame({"n": [shard]}), {"by": worker})


def test_two_drivers_on_one_store(store):
    context = multiprocessing.get_context("spawn")
    drivers = [context.Process(target=_drive, args=(str(store.root), w)) for w in range(2)]
    for driver in drivers:
        driver.start()
    for driver in drivers:
        driver.join()
        assert driver.exitcode == 0
    found = [store.load("toy", KEY, f"part-{s}").table["n"].tolist() for s in range(12)]
    assert found == [[s] for s in range(12)]
    assert store.quarantined() == ()
