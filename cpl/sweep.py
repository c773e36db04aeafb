"""Fan out: run the missing shards of a stage, commit each as it comes, lose none.

The driver alone writes to the store, so workers need no shared disk. Where the work runs is a word:
processes of this machine (joblib's loky), or the address of a dask scheduler.
"""

# pyright: reportMissingTypeStubs=false, reportUnknownMemberType=false

import logging
import sys
import time
import warnings
from collections.abc import Callable, Generator, Mapping
from concurrent.futures import CancelledError
from contextlib import closing
from dataclasses import dataclass
from typing import Any, TextIO, cast

import joblib
import pandas as pd
from joblib.externals.loky.process_executor import TerminatedWorkerError

from cpl.store import WorkStore, fingerprint

__all__ = ["CodeMismatchError", "Outcome", "Progress", "WorkersLostError", "sweep"]

_log = logging.getLogger(__name__)

_WORKER_WAIT_S = 60


class CodeMismatchError(RuntimeError):
    """A worker runs other code than the driver: what it computed is refused."""


class WorkersLostError(RuntimeError):
    """Workers died again and again without finishing a single shard."""


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """What a sweep did.

    Attributes:
        tables: Result of every shard, in the order in which the shards were given.
        executed: Names of the shards that were run now.
        reused: Names of the shards that were found in the store.
        seconds: Processor seconds of all shards together, whenever they were run.
    """

    tables: dict[str, pd.DataFrame]
    executed: tuple[str, ...]
    reused: tuple[str, ...]
    seconds: float


class Progress:
    """Say how far a sweep is and how long it will still take.

    On a terminal one line is kept up to date; elsewhere a line is written now and then.

    Args:
        total: Number of shards in all.
        reused: How many of them were finished before.
        label: What is being computed.
        stream: Where to write; stderr unless given.
        every_s: Seconds between two lines when not on a terminal.

    Examples:
        >>> progress = Progress(4, 2, "toy", stream=sys.stdout, every_s=0.0)
        >>> progress.done(seconds=1.0)
        toy: 3 of 4 shards (2 found), 0 s left
    """

    def __init__(
        self,
        total: int,
        reused: int,
        label: str,
        *,
        stream: TextIO | None = None,
        every_s: float = 15.0,
    ) -> None:
        self._total, self._reused, self._label = total, reused, label
        self._stream = sys.stderr if stream is None else stream
        self._terminal = self._stream.isatty()
        self._every = 0.1 if self._terminal else every_s
        self._begun = time.monotonic()
        self._said = self._begun
        self._finished = 0

    def done(self, *, seconds: float) -> None:
        """Count one shard that took so many seconds of a worker."""
        del seconds  # a later estimate may weigh shards; the rate of the whole fan-out does now
        self._finished += 1
        now = time.monotonic()
        if now - self._said >= self._every or self._left() == 0:
            self._said = now
            self._say(now)

    def close(self) -> None:
        """End the line that was kept up to date."""
        if self._terminal and self._finished:
            print(file=self._stream, flush=True)

    def _left(self) -> int:
        return self._total - self._reused - self._finished

    def _say(self, now: float) -> None:
        left_s = (now - self._begun) / self._finished * self._left()
        found = f" ({self._reused} found)" if self._reused else ""
        text = f"{self._label}: {self._reused + self._finished} of {self._total} shards{found}"
        line = f"{text}, {_duration(left_s)} left"
        start, end = ("\r\x1b[K", "") if self._terminal else ("", "\n")
        print(start + line, end=end, file=self._stream, flush=True)


def sweep(
    function: Callable[[Any], pd.DataFrame],
    shards: Mapping[str, Any],
    *,
    stage: str,
    key: str | Mapping[str, str],
    origin: str,
    store: WorkStore | None = None,
    workers: int | None = None,
    cluster: str | None = None,
    quiet: bool = False,
    patience: int = 3,
) -> Outcome:
    """Run a function on every shard that the store does not hold yet.

    Each finished shard is committed at once: after Ctrl-C, a killed driver or a killed worker, a
    second call runs exactly the missing ones. When a worker dies only its shards are run again.

    Args:
        function: Pure: shard -> table of plain columns. It must be importable by name.
        shards: Name -> what the function gets.
        stage: Name of the stage in the store.
        key: Key of the stage, from :func:`cpl.store.stage_key`; one for each shard, by its name, if
            they are computed from different inputs.
        origin: Dotted module whose fingerprint driver and workers must agree on.
        store: Work layer; the default one unless given.
        workers: Number of processes, each with one thread; by default one a core. With 1, or with
            one shard to run, everything happens in this process.
        cluster: Address of a dask scheduler (``tcp://HOST:PORT``) instead of local processes;
            needs the ``cluster`` extra.
        quiet: Say nothing.
        patience: How many times in a row workers may die without any shard being finished.

    Returns:
        All tables, and which of them are new.

    Raises:
        ValueError: If ``workers`` or ``patience`` is not positive.
        CodeMismatchError: If a worker runs other code than the driver.
        WorkersLostError: If workers keep dying.
        TimeoutError: If the cluster has no worker, and none comes within a minute.
        ConnectionError: If the scheduler goes away.
        Exception: Whatever the function raises, with the shard's name noted on it.
    """
    for name, number in (("workers", workers), ("patience", patience)):
        if number is not None and number < 1:
            msg = f"{name} must be positive, got {number!r}"
            raise ValueError(msg)
    store = WorkStore() if store is None else store
    keys = dict.fromkeys(shards, key) if isinstance(key, str) else key
    found = {name: store.load(stage, keys[name], name) for name in shards}
    tables = {name: entry.table for name, entry in found.items() if entry is not None}
    spent = {n: float(e.facts.get("seconds", 0.0)) for n, e in found.items() if e is not None}
    missing = {name: shard for name, shard in shards.items() if name not in tables}
    reused = tuple(tables)
    progress = None if quiet else Progress(len(shards), len(reused), stage)
    try:
        with closing(_finished(function, missing, origin, workers, cluster, patience)) as results:
            for name, table, seconds in results:
                store.save(stage, keys[name], name, table, {"seconds": seconds})
                tables[name], spent[name] = table, seconds
                if progress:
                    progress.done(seconds=seconds)
    finally:
        if progress:
            progress.close()
    return Outcome(
        tables={name: tables[name] for name in shards},
        executed=tuple(missing),
        reused=reused,
        seconds=sum(spent.values()),
    )


_Finished = tuple[str, pd.DataFrame, float]


def _finished(
    function: Callable[[Any], pd.DataFrame],
    missing: Mapping[str, Any],
    origin: str,
    workers: int | None,
    cluster: str | None,
    patience: int,
) -> Generator[_Finished, None, None]:
    """Yield shards as they are finished; when workers die, submit again what is missing."""
    code = fingerprint(origin)
    left, deaths = dict(missing), 0
    while left:
        before = len(left)
        try:
            with closing(_fan_out(function, left, origin, workers, cluster)) as computed:
                for name, table, seconds, theirs in computed:
                    if theirs != code:
                        msg = (
                            f"shard {name!r} was computed by other code of {origin} than the "
                            "driver started with; start again"
                        )
                        raise CodeMismatchError(msg)
                    yield name, table, seconds
                    del left[name]
        except TerminatedWorkerError as death:
            deaths = 1 if len(left) < before else deaths + 1
            if deaths >= patience:
                msg = f"workers died {deaths} times without finishing any of {sorted(left)[:5]}"
                raise WorkersLostError(msg) from death
            _log.warning("a worker died; %d of its shards are submitted again", len(left))


_Computed = tuple[str, pd.DataFrame, float, str]


def _fan_out(
    function: Callable[[Any], pd.DataFrame],
    shards: Mapping[str, Any],
    origin: str,
    workers: int | None,
    cluster: str | None,
) -> Generator[_Computed, None, None]:
    """Yield shards in the order in which they are finished, wherever they run."""
    if cluster is not None:
        yield from _on_cluster(function, shards, origin, cluster)
        return
    count = min(workers or joblib.cpu_count(), len(shards))
    work = list(shards.items())  # the caller strikes off what is finished while we go on
    if count == 1:
        for name, shard in work:
            yield _run(function, name, shard, origin)
        return
    one_by_one = cast("Any", 1)  # joblib's annotation knows only "auto"
    with joblib.parallel_config("loky", inner_max_num_threads=1):
        pool = joblib.Parallel(n_jobs=count, return_as="generator_unordered", batch_size=one_by_one)
        results = cast(
            "Generator[_Computed, None, None]",
            pool(joblib.delayed(_run)(function, *item, origin) for item in work),
        )
        try:
            yield from results
        finally:
            with warnings.catch_warnings():  # joblib warns that it cancelled what we give up
                warnings.simplefilter("ignore", UserWarning)
                results.close()


def _on_cluster(
    function: Callable[[Any], pd.DataFrame], shards: Mapping[str, Any], origin: str, address: str
) -> Generator[_Computed, None, None]:
    """Yield shards from the workers of a dask scheduler, which runs again what a dead one had."""
    try:
        from distributed import Client, KilledWorker, as_completed
    except ImportError as error:
        msg = f"cluster {address!r} needs the extra: pip install 'cpl[cluster]'"
        raise ImportError(msg) from error
    with Client(address) as client:
        try:
            client.wait_for_workers(1, timeout=_WORKER_WAIT_S)
        except TimeoutError as error:
            msg = f"no worker has come to {address} within {_WORKER_WAIT_S} s"
            raise TimeoutError(msg) from error
        # pure: a shard's name and this sweep make the key, not a hash of arguments and code.
        futures = [
            client.submit(_run, function, name, shard, origin, pure=False)
            for name, shard in shards.items()
        ]
        try:
            done = cast("Any", as_completed(futures, with_results=True))
            for future, computed in done:
                if isinstance(computed, CancelledError):  # dask hands it out like a result
                    msg = f"lost the scheduler at {address}; the same command goes on from here"
                    raise ConnectionError(msg) from computed
                # What is fetched and still held, dask would compute again when its worker dies.
                future.release()
                yield computed
        except KilledWorker as death:
            raise WorkersLostError(str(death)) from death
        finally:
            client.cancel(futures)


def _run(function: Callable[[Any], pd.DataFrame], name: str, shard: Any, origin: str) -> _Computed:  # noqa: ANN401
    """Run one shard (in a worker); tell how long it took and with which code."""
    begun = time.process_time()
    try:
        table = function(shard)
    except Exception as error:
        error.add_note(f"in shard {name!r}")
        raise
    return name, table, time.process_time() - begun, fingerprint(origin)


def _duration(seconds: float) -> str:
    """Write a time as a person would: ``45 s``, ``12 min``, ``3 h 5 min``."""
    whole = round(seconds)
    if whole < 100:
        return f"{whole} s"
    minutes = round(seconds / 60)
    return f"{minutes} min" if minutes < 100 else f"{minutes // 60} h {minutes % 60} min"
