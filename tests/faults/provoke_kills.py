"""Kill -9 at drawn times, full and read-only disks, two drivers on one store.

A committed shard must survive, and what comes out in the end must be what comes out undisturbed.
"""

import contextlib
import errno
import os
import resource
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import pandas as pd

from cpl.rng import stream
from cpl.store import WorkStore, atomic_write, table_digest
from cpl.sweep import Finished, Task, sweep
from tests.faults.frame import Row, tally

_KEY = "0" * 64
_SHARDS = {f"part-{i}": i for i in range(8)}
_DRIVER = """
import sys
from pathlib import Path
from tests.faults import provoke_kills as toy
store = toy.WorkStore(Path(sys.argv[1]))
how = {"workers": int(sys.argv[2]), "cluster": sys.argv[3] if len(sys.argv) > 3 else None}
toy.swept(store, **how)
"""
_ROOT = Path(__file__).resolve().parents[2]


def slow(i: int) -> pd.DataFrame:
    """Take long enough to be hit."""
    time.sleep(0.1)
    return pd.DataFrame({"i": [i], "square": [i * i]})


def swept(store: WorkStore, **how) -> dict[str, Finished]:
    """Run the toy's tasks, which need nothing of each other."""
    tasks = {
        name: Task(call=partial(_alone, i), stage="toy", name=name, key=_key, origin="cpl.sweep")
        for name, i in _SHARDS.items()
    }
    return {one.task: one for one in sweep(tasks, store=store, quiet=True, **how)}


def _alone(i: int, _inputs) -> pd.DataFrame:
    return slow(i)


def _key(_digests) -> str:
    return _KEY


def provoke(count: int) -> Iterator[Row]:
    """Kill a quarter of `count` times each: driver, local worker, dask driver, dask worker."""
    each = max(-(-count // 4), 1)
    yield tally("driver", "kill -9 at a drawn time", (_driver(n) for n in range(each)))
    yield tally("local worker", "kill -9 at a drawn time", (_worker(n) for n in range(each)))
    with _scheduler() as address:
        yield tally(
            "driver of a dask cluster", "kill -9 at a drawn time",
            (_driver(n, address) for n in range(each)),
        )  # fmt: skip
    yield tally("dask worker", "kill -9 at a drawn time", (_dask_worker(n) for n in range(each)))
    yield tally("store", "two drivers at once", (_two(n) for n in range(max(each // 2, 1))))
    yield tally("store", "disk full while a shard is written", (_full(n) for n in range(each)))
    yield tally("store", "folder that is read-only", (_read_only() for _ in range(1)))


def _judged(store: WorkStore, committed: set[str]) -> str:
    """Go on where it stopped, and compare with an undisturbed run."""
    done = swept(store, workers=1)
    lost = committed - {name for name, one in done.items() if one.found}
    same = all(table_digest(done[n].table) == table_digest(slow(i)) for n, i in _SHARDS.items())
    return "recovered" if same and not lost and not store.quarantined() else "silent"


def _start(root: Path, workers: int, cluster: str | None = None) -> subprocess.Popen[bytes]:
    words = [
        sys.executable,
        "-c",
        _DRIVER,
        str(root),
        str(workers),
        *([cluster] if cluster else []),
    ]
    return subprocess.Popen(
        words, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, cwd=_ROOT,
        start_new_session=True,
    )  # fmt: skip


def _hit(driver: subprocess.Popen[bytes], store: WorkStore, number: int, kill: Callable[[], None]):
    """Wait for the first shard, then a drawn time, then kill."""
    deadline = time.monotonic() + 120
    while not store.shards("toy", _KEY) and time.monotonic() < deadline and driver.poll() is None:
        time.sleep(0.005)
    time.sleep(float(stream(number, "faults", "kill").uniform(0.0, 0.5)))
    kill()


def _driver(number: int, cluster: str | None = None) -> str:
    store = WorkStore(Path(tempfile.mkdtemp(prefix="cpl-faults-")))
    driver = _start(store.root, 1 + number % 2, cluster)
    _hit(driver, store, number, driver.kill)
    driver.wait(timeout=60)
    return _judged(store, set(store.shards("toy", _KEY)))


def _worker(number: int) -> str:
    store = WorkStore(Path(tempfile.mkdtemp(prefix="cpl-faults-")))
    driver = _start(store.root, 2)

    def kill() -> None:
        for child in _children(driver.pid):
            if "LokyProcess" in _command(child):
                with contextlib.suppress(ProcessLookupError):
                    os.kill(child, signal.SIGKILL)
                return

    _hit(driver, store, number, kill)
    driver.wait(timeout=120)
    return _judged(store, set(store.shards("toy", _KEY)))


@contextlib.contextmanager
def _scheduler() -> Iterator[str]:
    from distributed import LocalCluster

    with LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None
    ) as cluster:
        yield cluster.scheduler_address


def _dask_worker(number: int) -> str:
    store = WorkStore(Path(tempfile.mkdtemp(prefix="cpl-faults-")))
    with _scheduler() as address:
        driver = _start(store.root, 1, address)

        def kill() -> None:
            workers = [p for p in _children(os.getpid()) if "spawn_main" in _command(p)]
            if workers:
                os.kill(workers[-1], signal.SIGKILL)

        _hit(driver, store, number, kill)
        driver.wait(timeout=120)
    return _judged(store, set(store.shards("toy", _KEY)))


def _two(number: int) -> str:
    del number
    store = WorkStore(Path(tempfile.mkdtemp(prefix="cpl-faults-")))
    drivers = [_start(store.root, 1) for _ in range(2)]
    codes = [driver.wait(timeout=120) for driver in drivers]
    return _judged(store, set(store.shards("toy", _KEY))) if codes == [0, 0] else "silent"


def _full(number: int) -> str:
    """Let no file grow beyond a drawn size: what a full disk does to a writer."""
    folder = Path(tempfile.mkdtemp(prefix="cpl-faults-"))
    limit = int(stream(number, "faults", "full").integers(1, 60_000))
    path, old = folder / "shard", b"old" * 10
    path.write_bytes(old)
    child = os.fork()
    if child == 0:
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
        try:
            atomic_write(path, b"n" * 60_000)
        except OSError as error:
            os._exit(0 if error.errno == errno.EFBIG else 2)
        os._exit(1)
    _, status = os.waitpid(child, 0)
    clean = [p.name for p in folder.iterdir()] == ["shard"]
    refused = os.waitstatus_to_exitcode(status) == 0
    return "refused" if refused and clean and path.read_bytes() == old else "silent"


def _read_only() -> str:
    """Write where nobody may: below a file that stands where a folder should be, or in /proc."""
    try:
        atomic_write(Path("/proc/cpl-faults/shard"), b"content")
    except OSError:
        return "refused"
    return "silent"


def _children(pid: int) -> list[int]:
    found: list[int] = []
    for task in Path(f"/proc/{pid}/task").glob("*/children"):
        with contextlib.suppress(OSError):
            direct = [int(word) for word in task.read_text().split()]
            found += [*direct, *(grand for child in direct for grand in _children(child))]
    return found


def _command(pid: int) -> str:
    try:
        return Path(f"/proc/{pid}/cmdline").read_text().replace("\0", " ")
    except OSError:
        return ""
