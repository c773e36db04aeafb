"""A real dask scheduler and its workers on loopback: the same results, only lost work again."""

import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections import Counter
from contextlib import ExitStack, contextmanager
from functools import partial
from pathlib import Path
from shutil import copytree, ignore_patterns

import dask
import pandas as pd
import pytest

from cpl.cli import main
from cpl.experiments.run.publication import job, run_job
from cpl.store import WorkStore, project_root
from cpl.sweep import CodeMismatchError, Task, WorkersLostError, sweep

NOWHERE = "tcp://127.0.0.1:1"  # nothing listens there
KEY = "0" * 64
ALONE = ("--nthreads", "1", "--no-nanny", "--no-dashboard")


def swept(function, shards, *, store, **words):
    """Sweep tasks that need nothing of each other, and return their tables."""
    tasks = {
        name: Task(
            call=partial(alone, function, shard), stage="toy", name=name, origin="cpl.sweep",
            key=partial(constant, KEY),
        )
        for name, shard in shards.items()
    }  # fmt: skip
    done = {one.task: one.table for one in sweep(tasks, store=store, quiet=True, **words)}
    return {name: done[name] for name in shards}


def alone(function, shard, _inputs) -> pd.DataFrame:
    return function(shard)


def constant(key, _digests) -> str:
    return key


def traced(shard: tuple[int, str]) -> pd.DataFrame:
    """Leave a mark for each time that a shard is run, and take a while."""
    number, folder = shard
    (Path(folder) / f"{number}.{os.getpid()}").touch()
    time.sleep(0.2)
    return pd.DataFrame({"i": [number], "square": [number**2]})


@contextmanager
def running(*words, code=None):
    """Run a program of dask as a user would, with the code of a folder."""
    folder = str(code or project_root())
    with subprocess.Popen(
        [sys.executable, "-m", *words],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        cwd=folder,
        env={**os.environ, "PYTHONPATH": folder},
    ) as process:
        try:
            yield process
        finally:
            process.kill()


@contextmanager
def scheduler(folder):
    """Start a scheduler that listens on loopback; tell its address and where workers find it."""
    told = folder / "scheduler.json"
    words = ("--host", "127.0.0.1", "--port", "0", "--no-dashboard", "--scheduler-file", str(told))
    with running("distributed.cli.dask_scheduler", *words):
        deadline = time.monotonic() + 60
        while not _whole(told) and time.monotonic() < deadline:
            time.sleep(0.05)
        yield json.loads(told.read_text())["address"], told


def _whole(told):
    """Say whether the scheduler has finished writing where it is."""
    return told.exists() and told.read_text().rstrip().endswith("}")


def worker(told, folder, code=None):
    words = (*ALONE, "--scheduler-file", str(told), "--local-directory", str(folder))
    return running("distributed.cli.dask_worker", *words, code=code)


def wait_for(address, workers):
    from distributed import Client

    with Client(address) as client:
        client.wait_for_workers(workers, timeout=120)


@pytest.fixture(scope="module")
def cluster(tmp_path_factory):
    folder = tmp_path_factory.mktemp("cluster")
    with ExitStack() as stack:
        address, told = stack.enter_context(scheduler(folder))
        for _ in range(2):
            stack.enter_context(worker(told, folder))
        wait_for(address, 2)
        yield address


@pytest.fixture
def here(tmp_path):
    return WorkStore(tmp_path / "here")


@pytest.fixture
def there(tmp_path):
    return WorkStore(tmp_path / "there")


def test_the_digest_is_the_local_one_and_a_second_run_executes_nothing(cluster, here, there):
    task = job("miscoverage", "smoke")
    local = run_job(task, store=here).provenance
    remote = run_job(task, store=there, cluster=cluster).provenance
    assert remote.content == local.content
    assert len(remote.shards) == len(task.pieces) > 2
    again = run_job(task, store=there, cluster=NOWHERE).provenance  # it does not even call
    assert (again.content, again.seconds) == (local.content, remote.seconds)


def test_inputs_are_computed_on_the_cluster_too(cluster, here, there):
    """Trained networks go over the wire and back: a shard's input is another shard's result."""
    task = job("quadruped_predictor", "smoke")
    remote = run_job(task, store=there, cluster=cluster)
    assert there.descriptions("quadruped_collect")
    assert remote.table["model"].map(bool).any()
    assert run_job(task, store=here).provenance.content == remote.provenance.content


def test_the_command_takes_an_address(cluster, capsys, tmp_path, monkeypatch):
    words = ["compute", "windows", "--profile", "smoke", "--quiet"]
    monkeypatch.setenv("CPL_STORE", str(tmp_path / "one"))
    assert main([*words, "--workers", "1"]) == 0
    local = capsys.readouterr().out
    monkeypatch.setenv("CPL_STORE", str(tmp_path / "two"))
    assert main([*words, "--cluster", cluster]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[-1].startswith("content ")
    assert lines[-1] == local.splitlines()[-1]


def test_a_scheduler_that_is_not_there_is_named(capsys, tmp_path, monkeypatch):
    monkeypatch.setenv("CPL_STORE", str(tmp_path))
    with dask.config.set({"distributed.comm.timeouts.connect": "1s"}):
        assert main(["compute", "windows", "--profile", "smoke", "--cluster", NOWHERE]) == 1
    assert NOWHERE in capsys.readouterr().err


def test_a_single_worker_does_the_work_not_the_driver(there, tmp_path):
    marks = tmp_path / "marks"
    marks.mkdir()
    shards = {f"part-{n}": (n, str(marks)) for n in range(3)}
    with scheduler(tmp_path) as (address, told), worker(told, tmp_path) as only:
        wait_for(address, 1)
        swept(
            traced, shards, store=there,
            cluster=address,
        )  # fmt: skip
    assert {mark.suffix for mark in marks.iterdir()} == {f".{only.pid}"}


def test_a_cluster_without_a_worker_is_named(there, tmp_path, monkeypatch):
    monkeypatch.setattr("cpl.sweep._WORKER_WAIT_S", 0.2)
    with scheduler(tmp_path) as (address, _), pytest.raises(TimeoutError, match="no worker"):
        swept(
            traced, {"one": (0, str(tmp_path))}, store=there, cluster=address,
        )  # fmt: skip


def deadly(shard: int) -> pd.DataFrame:
    """End whoever runs it."""
    os.kill(os.getpid(), signal.SIGKILL)
    return pd.DataFrame({"i": [shard]})


def test_a_shard_that_kills_its_worker_is_given_up(there, tmp_path, monkeypatch):
    monkeypatch.setenv("DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES", "0")
    with scheduler(tmp_path) as (address, told), worker(told, tmp_path):
        wait_for(address, 1)
        with pytest.raises(WorkersLostError, match="died"):
            swept(
                deadly, {"one": 0}, store=there,
                cluster=address,
            )  # fmt: skip


def test_a_scheduler_that_goes_away_ends_the_run_and_loses_nothing(there, tmp_path):
    from distributed import Client

    marks = tmp_path / "marks"
    marks.mkdir()
    shards = {f"part-{n}": (n, str(marks)) for n in range(40)}
    with scheduler(tmp_path) as (address, told), worker(told, tmp_path):
        wait_for(address, 1)
        with Client(address) as client:
            pid = client.run_on_scheduler(os.getpid)

        def strike():
            while len(there.shards("toy", KEY)) < 3:
                time.sleep(0.01)
            os.kill(pid, signal.SIGKILL)

        killer = threading.Thread(target=strike)
        killer.start()
        with pytest.raises(ConnectionError, match="lost the scheduler"):
            swept(
                traced, shards, store=there,
                cluster=address,
            )  # fmt: skip
        killer.join()
    assert len(there.shards("toy", KEY)) >= 3
    assert there.quarantined() == ()


def test_a_worker_killed_on_the_way_costs_only_its_shards(there, tmp_path):
    marks = tmp_path / "marks"
    marks.mkdir()
    shards = {f"part-{n}": (n, str(marks)) for n in range(16)}
    with (
        scheduler(tmp_path) as (address, told),
        worker(told, tmp_path) as victim,
        worker(told, tmp_path),
    ):
        wait_for(address, 2)
        committed = []

        def strike():
            while len(committed) < 4:
                committed[:] = there.shards("toy", KEY)
                time.sleep(0.01)
            os.kill(victim.pid, signal.SIGKILL)

        killer = threading.Thread(target=strike)
        killer.start()
        tables = swept(
            traced, shards, store=there,
            cluster=address,
        )  # fmt: skip
        killer.join()
    assert [int(t["square"].iloc[0]) for t in tables.values()] == [n**2 for n in range(16)]
    runs = Counter(mark.stem for mark in marks.iterdir())
    pids = {mark.suffix for mark in marks.iterdir()}
    assert len(pids) == 2
    assert f".{victim.pid}" in pids
    again = {number for number, count in runs.items() if count > 1}
    assert not again & {name.removeprefix("part-") for name in committed}
    assert all((marks / f"{number}.{victim.pid}").exists() for number in again)
    assert len(again) <= 3  # what ran, and what was finished and not fetched yet


def test_a_worker_with_other_code_is_refused(there, tmp_path):
    other = tmp_path / "other"
    copytree(project_root() / "cpl", other / "cpl", ignore=ignore_patterns("__pycache__"))
    source = other / "cpl" / "experiments" / "theory" / "miscoverage.py"
    source.write_text(source.read_text() + "\n_CHANGED = 1\n")
    task = job("miscoverage", "smoke")
    with ExitStack() as stack:
        address, told = stack.enter_context(scheduler(tmp_path))
        stack.enter_context(worker(told, tmp_path, code=other))
        wait_for(address, 1)
        with pytest.raises(CodeMismatchError, match=r"other code of cpl\..*\.miscoverage"):
            run_job(task, store=there, cluster=address)
    assert not list(there.root.glob("miscoverage/*/*.shard"))
