"""Scale: what the driver of a dask cluster costs a piece, and whether the schedule is believed.

Real schedulers and workers on loopback. Pieces that only wait measure the fan-out and not the
processor, so that more workers than cores make sense.
"""

import tempfile
import time
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import pandas as pd

from cpl.experiments.run.schedule import Piece, makespan
from cpl.rng import stream
from cpl.store import WorkStore
from cpl.sweep import Task, sweep
from tests.bench.frame import Row

PACKAGES = ("dask", "distributed", "joblib", "pandas", "pyarrow")
FEW, MANY = 50, 250  # empty pieces; the difference leaves out what connecting costs
WORKERS = (1, 2, 4)
WAITS = 48
MEAN_S = 0.4


def measure() -> Iterator[Row]:
    """Time empty pieces and waiting pieces in the driver, and on clusters of several sizes."""
    yield from _empty("in the driver", None)
    waits = _waits()
    for count in WORKERS:
        with _cluster(count) as address:
            yield from _empty(f"{count} workers", address)
            yield from _waiting(count, address, waits)


def empty(number: int, wait_s: float = 0.0) -> pd.DataFrame:
    """Wait, and return a small table."""
    time.sleep(wait_s)
    return pd.DataFrame({"number": [number], "square": [number**2]})


def waiting(shard: tuple[int, float]) -> pd.DataFrame:
    """Wait for as long as the shard says."""
    return empty(*shard)


def _empty(subject: str, address: str | None) -> Iterator[Row]:
    run = partial(_swept, empty, address)
    run({f"warm-{n}": n for n in range(FEW)})
    few, many = (run({f"part-{n}": n for n in range(count)}) for count in (FEW, MANY))
    wall, busy = (1e3 * (b - a) / (MANY - FEW) for a, b in zip(few, many, strict=True))
    bench = "scale: empty pieces"
    yield Row(bench=bench, subject=f"{subject}, elapsed", value=wall, unit="ms/piece")
    yield Row(bench=bench, subject=f"{subject}, driver busy", value=busy, unit="ms/piece")


def _waiting(count: int, address: str, waits: list[float]) -> Iterator[Row]:
    shards = {f"part-{n}": (n, wait) for n, wait in enumerate(waits)}
    wall, _ = _swept(waiting, address, shards)
    pieces = {name: Piece(seconds=wait) for name, (_, wait) in shards.items()}
    predicted = makespan(pieces, count, longest_first=False).seconds
    yield Row(
        bench=f"scale: {WAITS} pieces that wait",
        subject=f"{count} workers",
        value=wall,
        unit="s",
        peer="prediction",
        ratio=predicted / wall,
    )


def _swept(function, address: str | None, shards: dict[str, object]) -> tuple[float, float]:
    """Return elapsed and driver's processor seconds of a sweep into an empty store."""
    with tempfile.TemporaryDirectory(prefix="cpl-bench-") as folder:
        store = WorkStore(Path(folder))
        elapsed, busy = time.perf_counter(), time.process_time()
        tasks = {
            name: Task(
                call=partial(_alone, function, shard), stage="toy", name=name, origin="cpl.rng",
                key=_key,
            )
            for name, shard in shards.items()
        }  # fmt: skip
        for _ in sweep(tasks, store=store, workers=1, cluster=address, quiet=True):
            pass
        return time.perf_counter() - elapsed, time.process_time() - busy


def _alone(function, shard: object, _inputs: object) -> pd.DataFrame:
    return function(shard)


def _key(_digests: object) -> str:
    return "0" * 64


def _waits() -> list[float]:
    """Draw durations as uneven as those of real pieces."""
    return (MEAN_S * stream(0, "bench", "scale").gamma(2.0, 0.5, size=WAITS)).tolist()


def _cluster(count: int):
    from contextlib import contextmanager

    from distributed import Client, LocalCluster

    @contextmanager
    def running():
        with LocalCluster(
            n_workers=count, threads_per_worker=1, processes=True, dashboard_address=None
        ) as cluster:
            with Client(cluster) as client:
                client.wait_for_workers(count)
                client.run(_warm)
            yield cluster.scheduler_address

    return running()


def _warm() -> None:
    """Import on a worker what its first piece would import."""
    import cpl.sweep  # noqa: F401
