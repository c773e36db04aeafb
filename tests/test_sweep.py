import io
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pandas as pd
import pytest
from distributed import LocalCluster

from cpl.store import WorkStore
from cpl.sweep import CodeMismatchError, Progress, WorkersLostError, sweep

KEY = "0" * 64
HERE = Path(__file__).resolve()
SHARDS = {f"part-{i}": i for i in range(6)}
WORDS = {"stage": "toy", "key": KEY, "origin": "cpl.sweep", "quiet": True}


def square(i: int) -> pd.DataFrame:
    return pd.DataFrame({"i": [i], "square": [i * i]})


def slow(i: int) -> pd.DataFrame:
    time.sleep(0.15)
    return square(i)


def fragile(shard: tuple[int, str]) -> pd.DataFrame:
    """Kill the worker of shard 3, once: the mark in the folder says that it was done."""
    i, folder = shard
    mark = Path(folder) / "killed"
    if i == 3 and not mark.exists():
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return square(i)


def deadly(i: int) -> pd.DataFrame:
    os.kill(os.getpid(), signal.SIGKILL)
    return square(i)


def wrong(i: int) -> pd.DataFrame:
    if i == 3:
        msg = "three is not a number we like"
        raise ArithmeticError(msg)
    return square(i)


@pytest.fixture
def store(tmp_path):
    return WorkStore(tmp_path / "store")


def values(outcome) -> list[int]:
    return [int(table["square"].iloc[0]) for table in outcome.tables.values()]


@pytest.mark.parametrize("workers", [1, 2])
def test_every_shard_is_run_once_and_then_found(store, workers):
    first = sweep(square, SHARDS, store=store, workers=workers, **WORDS)
    assert values(first) == [0, 1, 4, 9, 16, 25]
    assert set(first.executed) == set(SHARDS)
    second = sweep(deadly, SHARDS, store=store, workers=workers, **WORDS)
    assert values(second) == values(first)
    assert second.executed == ()
    assert second.reused == tuple(SHARDS)
    assert second.seconds == first.seconds


def test_only_what_is_missing_or_damaged_is_run(store, caplog):
    sweep(square, SHARDS, store=store, workers=1, **WORDS)
    victim = next(store.root.glob("**/part-4.shard"))
    content = bytearray(victim.read_bytes())
    content[-7] ^= 4
    victim.write_bytes(content)
    again = sweep(square, {**SHARDS, "part-6": 6}, store=store, workers=1, **WORDS)
    assert set(again.executed) == {"part-4", "part-6"}
    assert values(again) == [0, 1, 4, 9, 16, 25, 36]
    assert len(store.quarantined()) == 1


def test_a_killed_worker_costs_only_its_shards(store, tmp_path, caplog):
    shards = {name: (i, str(tmp_path)) for name, i in SHARDS.items()}
    outcome = sweep(fragile, shards, store=store, workers=2, **WORDS)
    assert values(outcome) == [0, 1, 4, 9, 16, 25]
    assert "submitted again" in caplog.text
    assert len(store.shards("toy", KEY)) == len(SHARDS)


def test_workers_that_always_die_are_given_up(store, caplog):
    with pytest.raises(WorkersLostError, match="part-0"):
        sweep(deadly, SHARDS, store=store, workers=2, patience=2, **WORDS)


@pytest.mark.parametrize("workers", [1, 2])
def test_an_error_names_its_shard_and_keeps_the_others(store, workers):
    with pytest.raises(ArithmeticError) as caught:
        sweep(wrong, SHARDS, store=store, workers=workers, **WORDS)
    assert "in shard 'part-3'" in caught.value.__notes__
    committed = set(store.shards("toy", KEY))
    assert "part-3" not in committed
    assert workers > 1 or committed == {"part-0", "part-1", "part-2"}
    again = sweep(square, SHARDS, store=store, workers=1, **WORDS)
    assert set(again.executed) == set(SHARDS) - committed
    assert values(again) == [0, 1, 4, 9, 16, 25]


def test_other_code_in_the_worker_is_refused(store, monkeypatch):
    answers = iter(["driver", "worker"])
    monkeypatch.setattr("cpl.sweep.fingerprint", lambda _origin: next(answers))
    with pytest.raises(CodeMismatchError, match=r"part-0.*cpl\.sweep"):
        sweep(square, SHARDS, store=store, workers=1, **WORDS)
    assert store.shards("toy", KEY) == ()


@pytest.mark.parametrize("words", [{"workers": 0}, {"patience": 0}])
def test_bad_arguments_are_named(store, words):
    with pytest.raises(ValueError, match=f"{next(iter(words))} must be positive, got 0"):
        sweep(square, SHARDS, store=store, **words, **WORDS)


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_progress_on_a_terminal_keeps_one_line(monkeypatch):
    clock = iter([0.0, 10.0, 10.05, 40.0])
    monkeypatch.setattr("cpl.sweep.time.monotonic", lambda: next(clock))
    stream = Terminal()
    progress = Progress(5, 2, "toy", stream=stream)
    for _ in range(3):
        progress.done(seconds=1.0)
    progress.close()
    shown = stream.getvalue().split("\r\x1b[K")
    assert shown[1] == "toy: 3 of 5 shards (2 found), 20 s left"
    assert shown[2] == "toy: 5 of 5 shards (2 found), 0 s left\n"


def test_progress_elsewhere_speaks_now_and_then(monkeypatch):
    clock = iter([0.0, 5.0, 20.0, 25.0])
    monkeypatch.setattr("cpl.sweep.time.monotonic", lambda: next(clock))
    stream = io.StringIO()
    progress = Progress(4000, 0, "toy", stream=stream)
    for _ in range(3):
        progress.done(seconds=1.0)
    progress.close()
    assert stream.getvalue() == "toy: 2 of 4000 shards, 11 h 6 min left\n"


DRIVER = f"""
import sys
sys.path.insert(0, {str(HERE.parent)!r})  # workers import the shards' functions by name
import test_sweep as toy
from pathlib import Path
from cpl.store import WorkStore
store = WorkStore(Path(sys.argv[1]))
toy.sweep(toy.slow, toy.SHARDS, store=store, workers=int(sys.argv[2]), **toy.WORDS)
"""


def listen() -> None:
    """Hear Ctrl-C even where the tests run in the background of a shell, which ignores it."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


def interrupt(store: WorkStore, how: signal.Signals, workers: int, after: int) -> set[str]:
    """Start a driver, hit it when some shards are there, return what it had committed."""
    driver = subprocess.Popen(
        [sys.executable, "-c", DRIVER, str(store.root), str(workers)],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        preexec_fn=listen,
    )
    deadline = time.monotonic() + 60
    while len(store.shards("toy", KEY)) < after and time.monotonic() < deadline:
        assert driver.poll() is None, "the driver ended before it could be hit"
        time.sleep(0.01)
    driver.send_signal(how)
    driver.wait(timeout=30)
    assert driver.returncode != 0
    return set(store.shards("toy", KEY))


@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGKILL], ids=["ctrl-c", "kill-9"])
def test_an_interrupted_driver_loses_nothing(store, how):
    committed = interrupt(store, how, workers=1, after=2)
    assert 2 <= len(committed) < len(SHARDS)
    outcome = sweep(square, SHARDS, store=store, workers=1, **WORDS)
    assert set(outcome.reused) == committed
    assert set(outcome.executed) == set(SHARDS) - committed
    assert values(outcome) == [0, 1, 4, 9, 16, 25]
    assert store.quarantined() == ()


@pytest.mark.faults
@pytest.mark.parametrize("round_", range(8))
@pytest.mark.parametrize("workers", [1, 2])
@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGKILL], ids=["ctrl-c", "kill-9"])
def test_drivers_hit_at_many_times_lose_nothing(store, how, workers, round_):
    committed = interrupt(store, how, workers=workers, after=1 + round_ % 4)
    outcome = sweep(square, SHARDS, store=store, workers=1, **WORDS)
    assert set(outcome.reused) == committed
    assert values(outcome) == [0, 1, 4, 9, 16, 25]
    assert store.quarantined() == ()


def test_a_dask_cluster_gives_the_same(store, tmp_path):
    with LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None
    ) as cluster:
        there = sweep(square, SHARDS, store=store, cluster=cluster.scheduler_address, **WORDS)
    here = sweep(square, SHARDS, store=WorkStore(tmp_path / "other"), workers=1, **WORDS)
    assert values(there) == values(here)


@pytest.mark.faults
def test_a_killed_dask_worker_costs_only_its_shards(store, tmp_path):
    shards = {name: (i, str(tmp_path)) for name, i in SHARDS.items()}
    with LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None
    ) as cluster:
        outcome = sweep(fragile, shards, store=store, cluster=cluster.scheduler_address, **WORDS)
        again = sweep(fragile, shards, store=store, cluster=cluster.scheduler_address, **WORDS)
    assert values(outcome) == [0, 1, 4, 9, 16, 25]
    assert (tmp_path / "killed").exists()
    assert again.executed == ()
