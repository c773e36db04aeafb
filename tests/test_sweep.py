import hashlib
import os
import signal
import subprocess
import sys
import time
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import pandas as pd
import pytest
from distributed import LocalCluster

from cpl.experiments.run.schedule import Piece, chains, makespan
from cpl.store import WorkStore
from cpl.sweep import CodeMismatchError, Task, WorkersLostError, sweep

KEY = "0" * 64
HERE = Path(__file__).resolve()
SHARDS = {f"part-{i}": i for i in range(6)}
WORDS = {"quiet": True}


@dataclass(frozen=True)
class Outcome:
    tables: dict[str, pd.DataFrame]
    executed: tuple[str, ...]
    reused: tuple[str, ...]
    seconds: float


def swept(function, shards, *, store, stage="toy", key=KEY, origin="cpl.sweep", **words) -> Outcome:
    """Sweep tasks that need nothing of each other."""
    tasks = {
        name: Task(
            call=partial(alone, function, shard), stage=stage, name=name, origin=origin,
            key=partial(constant, key),
        )
        for name, shard in shards.items()
    }  # fmt: skip
    done = {one.task: one for one in sweep(tasks, store=store, **words)}
    return Outcome(
        {name: done[name].table for name in shards},
        tuple(name for name, one in done.items() if not one.found),
        tuple(name for name, one in done.items() if one.found),
        sum(one.seconds for one in done.values()),
    )


def alone(function, shard, _inputs) -> pd.DataFrame:
    return function(shard)


def constant(key, _digests) -> str:
    return key


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
    first = swept(square, SHARDS, store=store, workers=workers, **WORDS)
    assert values(first) == [0, 1, 4, 9, 16, 25]
    assert set(first.executed) == set(SHARDS)
    second = swept(deadly, SHARDS, store=store, workers=workers, **WORDS)
    assert values(second) == values(first)
    assert second.executed == ()
    assert set(second.reused) == set(SHARDS)
    assert second.seconds == first.seconds


def test_only_what_is_missing_or_damaged_is_run(store, caplog):
    swept(square, SHARDS, store=store, workers=1, **WORDS)
    victim = next(store.root.glob("**/part-4.shard"))
    content = bytearray(victim.read_bytes())
    content[-7] ^= 4
    victim.write_bytes(content)
    again = swept(square, {**SHARDS, "part-6": 6}, store=store, workers=1, **WORDS)
    assert set(again.executed) == {"part-4", "part-6"}
    assert values(again) == [0, 1, 4, 9, 16, 25, 36]
    assert len(store.quarantined()) == 1


def test_a_killed_worker_costs_only_its_shards(store, tmp_path, caplog):
    shards = {name: (i, str(tmp_path)) for name, i in SHARDS.items()}
    outcome = swept(fragile, shards, store=store, workers=2, **WORDS)
    assert values(outcome) == [0, 1, 4, 9, 16, 25]
    assert "submitted again" in caplog.text
    assert len(store.shards("toy", KEY)) == len(SHARDS)


def test_workers_that_always_die_are_given_up(store, caplog):
    with pytest.raises(WorkersLostError, match="part-0"):
        swept(deadly, SHARDS, store=store, workers=2, patience=2, **WORDS)


@pytest.mark.parametrize("workers", [1, 2])
def test_an_error_names_its_shard_and_keeps_the_others(store, workers):
    with pytest.raises(ArithmeticError) as caught:
        swept(wrong, SHARDS, store=store, workers=workers, **WORDS)
    assert "in shard 'part-3'" in caught.value.__notes__
    committed = set(store.shards("toy", KEY))
    assert "part-3" not in committed
    assert workers > 1 or committed == {"part-0", "part-1", "part-2"}
    again = swept(square, SHARDS, store=store, workers=1, **WORDS)
    assert set(again.executed) == set(SHARDS) - committed
    assert values(again) == [0, 1, 4, 9, 16, 25]


def test_other_code_in_the_worker_is_refused(store, monkeypatch):
    answers = iter(["driver", "worker"])
    monkeypatch.setattr("cpl.sweep.fingerprint", lambda _origin: next(answers))
    with pytest.raises(CodeMismatchError, match=r"part-0.*cpl\.sweep"):
        swept(square, SHARDS, store=store, workers=1, **WORDS)
    assert store.shards("toy", KEY) == ()


@pytest.mark.parametrize("words", [{"workers": 0}, {"patience": 0}])
def test_bad_arguments_are_named(store, words):
    with pytest.raises(ValueError, match=f"{next(iter(words))} must be positive, got 0"):
        swept(square, SHARDS, store=store, **words, **WORDS)


DRIVER = f"""
import sys
sys.path.insert(0, {str(HERE.parent)!r})  # workers import the shards' functions by name
import test_sweep as toy
from pathlib import Path
from cpl.store import WorkStore
store = WorkStore(Path(sys.argv[1]))
toy.swept(toy.slow, toy.SHARDS, store=store, workers=int(sys.argv[2]), **toy.WORDS)
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
    outcome = swept(square, SHARDS, store=store, workers=1, **WORDS)
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
    outcome = swept(square, SHARDS, store=store, workers=1, **WORDS)
    assert set(outcome.reused) == committed
    assert values(outcome) == [0, 1, 4, 9, 16, 25]
    assert store.quarantined() == ()


def test_a_dask_cluster_gives_the_same(store, tmp_path):
    with LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None
    ) as cluster:
        there = swept(square, SHARDS, store=store, cluster=cluster.scheduler_address, **WORDS)
    here = swept(square, SHARDS, store=WorkStore(tmp_path / "other"), workers=1, **WORDS)
    assert values(there) == values(here)


@pytest.mark.faults
def test_a_killed_dask_worker_costs_only_its_shards(store, tmp_path):
    shards = {name: (i, str(tmp_path)) for name, i in SHARDS.items()}
    with LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None
    ) as cluster:
        outcome = swept(fragile, shards, store=store, cluster=cluster.scheduler_address, **WORDS)
        again = swept(fragile, shards, store=store, cluster=cluster.scheduler_address, **WORDS)
    assert values(outcome) == [0, 1, 4, 9, 16, 25]
    assert (tmp_path / "killed").exists()
    assert again.executed == ()


def noted(order, name, inputs):
    order.append(name)
    return pd.DataFrame({"name": [name], "sum": [sum(int(t["sum"].iloc[0]) for t in inputs) + 1]})


def digested(digests):
    return hashlib.sha256(" ".join(digests).encode()).hexdigest()


def graph(order, needs, ranks=None):
    """Tasks by name that need others; each counts itself and what it needs."""
    return {
        name: Task(
            call=partial(noted, order, name), needs=tuple(below), stage="toy", name=name,
            key=digested, origin="cpl.sweep", rank=(ranks or {}).get(name, 0.0),
        )
        for name, below in needs.items()
    }  # fmt: skip


DIAMOND = {"end": ["left", "right"], "left": ["start"], "right": ["start"], "start": []}


def test_each_task_waits_for_what_it_needs_and_runs_once(store):
    order = []
    done = {one.task: one for one in sweep(graph(order, DIAMOND), store=store, workers=1, **WORDS)}
    assert sorted(order) == sorted(DIAMOND)
    assert (order[0], order[-1]) == ("start", "end")
    assert int(done["end"].table["sum"].iloc[0]) == 5
    again = list(sweep(graph(order, DIAMOND), store=store, workers=1, **WORDS))
    assert all(one.found for one in again)
    assert len(order) == 4


def test_the_greatest_rank_starts_first_as_the_schedule_has_it(store):
    costs = {name: Piece(seconds=s) for name, s in {"a": 1.0, "b": 4.0, "c": 2.0}.items()}
    costs["d"] = Piece(seconds=5.0, needs=("c",))
    order = []
    tasks = graph(order, {name: piece.needs for name, piece in costs.items()}, chains(costs))
    list(sweep(tasks, store=store, workers=1, **WORDS))
    assert order == ["c", "d", "b", "a"]
    assert makespan(costs, 1).seconds == 12.0


def test_what_is_given_is_not_computed(store):
    order = []
    tasks = {name: task for name, task in graph(order, DIAMOND).items() if name != "start"}
    given = {"start": pd.DataFrame({"name": ["start"], "sum": [10]})}
    done = {one.task: one for one in sweep(tasks, given, store=store, workers=1, **WORDS)}
    assert int(done["end"].table["sum"].iloc[0]) == 23
    assert "start" not in order


def absent(_inputs):
    raise ModuleNotFoundError("no such library")


def test_what_cannot_be_imported_ends_only_what_needs_it(store):
    order = []
    tasks = graph(order, {**DIAMOND, "other": []})
    tasks["left"] = replace(tasks["left"], call=absent)
    done = {
        one.task: one
        for one in sweep(tasks, store=store, workers=1, missing=ModuleNotFoundError, **WORDS)
    }
    assert {name for name, one in done.items() if one.error} == {"left", "end"}
    assert set(order) == {"start", "right", "other"}
    with pytest.raises(ModuleNotFoundError):
        list(sweep(tasks, store=store, workers=1, **WORDS))


@pytest.mark.parametrize(
    ("needs", "named"),
    [({"a": ["b"], "b": ["a"]}, "circles"), ({"a": ["nobody"]}, "needs must name tasks")],
)
def test_impossible_needs_are_refused(store, needs, named):
    with pytest.raises(ValueError, match=named):
        list(sweep(graph([], needs), store=store, workers=1, **WORDS))
