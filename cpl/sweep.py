"""Run a graph of tasks in one pool: each as soon as what it needs is there, none twice, none lost.

The driver alone writes to the store, so workers need no shared disk. Where the work runs is a word:
processes of this machine (joblib's loky), or the address of a dask scheduler.
"""

# pyright: reportMissingTypeStubs=false, reportUnknownMemberType=false

import heapq
import logging
import sys
import time
import warnings
from collections.abc import Callable, Generator, Hashable, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import closing
from dataclasses import dataclass, field
from graphlib import CycleError, TopologicalSorter
from typing import Any, Protocol, cast

import joblib
import pandas as pd
from joblib.externals import loky
from tqdm import tqdm

from cpl.store import WorkStore, fingerprint, table_digest

__all__ = ["CodeMismatchError", "Finished", "Task", "WorkersLostError", "sweep"]

_log = logging.getLogger(__name__)

_WORKER_WAIT_S = 60
_IDLE_S = 300  # a worker that has nothing to do ends after this time
_THREADS = dict.fromkeys(  # one thread a process, whatever library it asks
    (
        "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "BLIS_NUM_THREADS",
        "VECLIB_MAXIMUM_THREADS", "NUMBA_NUM_THREADS", "NUMEXPR_NUM_THREADS",
    ),
    "1",
)  # fmt: skip

Tables = Sequence[pd.DataFrame]


class CodeMismatchError(RuntimeError):
    """A worker runs other code than the driver: what it computed is refused."""


class WorkersLostError(RuntimeError):
    """Workers died again and again without finishing a single task."""


@dataclass(frozen=True, kw_only=True)
class Task:
    """A call, what it waits for, and where its result is kept.

    Attributes:
        call: Makes the table from the tables of the needs; must be importable by name.
        needs: Which other tasks these are, in the call's order.
        stage: Name of the stage in the store.
        name: Name of the result within the stage.
        key: Gives the key of the stage, see `cpl.store.stage_key`, from the digests of the needs.
        origin: Dotted module whose fingerprint driver and workers must agree on.
        rank: Of the tasks that could start, the one with the greatest starts first [s].
        description: Noted in the store beside the key, for people.
        lasting: Noted there as well; of these what was noted first stays.
    """

    call: Callable[[Tables], pd.DataFrame]
    needs: tuple[Hashable, ...] = ()
    stage: str
    name: str
    key: Callable[[Sequence[str]], str]
    origin: str
    rank: float = 0.0
    description: Mapping[str, Any] = field(default_factory=dict[str, Any])
    lasting: Mapping[str, Any] = field(default_factory=dict[str, Any])


@dataclass(frozen=True, kw_only=True)
class Finished:
    """What became of a task.

    Attributes:
        task: Its name in the graph.
        table: Its result; None if it failed.
        seconds: Processor seconds it took, now or when it was run.
        found: Whether the store had it.
        error: Why there is no result.
        lasting: What was noted first beside its key, of the task's `lasting`.
    """

    task: Any
    table: pd.DataFrame | None
    seconds: float
    found: bool
    error: Exception | None = None
    lasting: Mapping[str, Any] = field(default_factory=dict[str, Any])


def sweep(
    tasks: Mapping[Any, Task],
    given: Mapping[Any, pd.DataFrame] | None = None,
    *,
    store: WorkStore | None = None,
    workers: int | None = None,
    cluster: str | None = None,
    quiet: bool = False,
    patience: int = 3,
    missing: type[Exception] | tuple[type[Exception], ...] = (),
) -> Generator[Finished, None, None]:
    """Run the tasks that the store does not hold yet, and say of each when it is there.

    Each finished task is committed at once: after Ctrl-C, a killed driver or a killed worker, a
    second call runs exactly what is missing. When a worker dies only its tasks are run again.

    Args:
        tasks: By name in the graph.
        given: Tables that tasks need and nobody has to compute, by name.
        store: Work layer; the default one unless given.
        workers: Number of processes, each with one thread; by default one a core. With 1, or with
            one task to run, everything happens in this process.
        cluster: Address of a dask scheduler (``tcp://HOST:PORT``) instead of local processes;
            needs the ``cluster`` extra.
        quiet: Say nothing.
        patience: How many times in a row workers may die without any task being finished.
        missing: Errors that end only their task and those that need it.

    Yields:
        Every task once, as they finish.

    Raises:
        ValueError: If ``workers`` or ``patience`` is not positive, or needs go round in circles.
        CodeMismatchError: If a worker runs other code than the driver.
        WorkersLostError: If workers keep dying.
        TimeoutError: If the cluster has no worker, and none comes within a minute.
        ConnectionError: If the scheduler goes away.
        Exception: Whatever a task raises, with its name noted on it.
    """
    for name, number in (("workers", workers), ("patience", patience)):
        if number is not None and number < 1:
            msg = f"{name} must be positive, got {number!r}"
            raise ValueError(msg)
    run = _Run(tasks, dict(given or {}), WorkStore() if store is None else store)
    steps = _steps(run, lambda left: _pool(left, workers, cluster, patience), missing)
    if quiet:
        yield from steps
        return
    known = 0
    with closing(steps), _bar(len(tasks)) as bar:
        for finished in steps:
            if finished.found:
                bar.total -= 1  # it costs nothing and says nothing of the pace
                known += 1
                bar.set_description(f"pieces ({known} found)")
            else:
                bar.update()
            yield finished


def _steps(
    run: "_Run",
    open_pool: "Callable[[int], _Pool]",
    missing: type[Exception] | tuple[type[Exception], ...],
) -> Generator[Finished, None, None]:
    """Settle what the store has, and run the rest in a pool, if there is anything left."""
    yield from run.settle()
    if not run.ready:
        return
    with open_pool(run.left) as pool:
        while run.ready or pool.busy:
            while run.ready and pool.room:
                pool.submit(run.next())
            done = pool.next()
            if not isinstance(done.outcome, Exception):
                yield run.commit(done.work, done.outcome, done.seconds)
            elif isinstance(done.outcome, missing):
                yield from run.fail(done.work.place, done.outcome)
            else:
                raise done.outcome
            yield from run.settle()


@dataclass(frozen=True, kw_only=True)
class _Work:
    """A task that is ready to run."""

    place: Any
    task: Task
    key: str
    inputs: Tables
    lasting: Mapping[str, Any]


@dataclass(frozen=True, kw_only=True)
class _Done:
    """What came back from a pool."""

    work: _Work
    outcome: pd.DataFrame | Exception
    seconds: float = 0.0


class _Run:
    """The state of a graph that is being run: what is there, what is ready, what waits."""

    def __init__(
        self, tasks: Mapping[Any, Task], tables: dict[Any, pd.DataFrame], store: WorkStore
    ) -> None:
        self.ready: list[tuple[float, int, _Work]] = []
        self.left = len(tasks)
        self._tasks, self._tables, self._store = tasks, tables, store
        self._digests: dict[Any, str] = {}
        self._order = {place: number for number, place in enumerate(tasks)}
        self._users = dict.fromkeys((*tables, *tasks), 0)
        self._noted: dict[tuple[str, str], Mapping[str, Any]] = {}
        self._before: dict[str, dict[str, dict[str, Any]]] = {}
        self._open = set(tasks)
        needs = {p: [n for n in task.needs if n not in tables] for p, task in tasks.items()}
        for task in tasks.values():
            for need in task.needs:
                if need not in self._users:
                    msg = f"needs must name tasks, got {need!r} in {task.name!r}"
                    raise ValueError(msg)
                self._users[need] += 1
        self._sorter = TopologicalSorter[Any](needs)
        try:
            self._sorter.prepare()
        except CycleError as error:
            msg = f"needs must not go round in circles, got {error.args[1]}"
            raise ValueError(msg) from error

    def settle(self) -> Generator[Finished, None, None]:
        """Yield what the store has of that which could start; the rest is `ready`."""
        while self._sorter.is_active() and (places := self._sorter.get_ready()):
            for place in places:
                work = self._work(place)
                entry = self._store.load(work.task.stage, work.key, work.task.name)
                if entry is None:
                    rank = (-work.task.rank, self._order[place], work)
                    heapq.heappush(self.ready, rank)
                    continue
                seconds = float(entry.facts.get("seconds", 0.0))
                yield self._finish(work, entry.table, seconds, found=True)

    def next(self) -> _Work:
        """Take the most urgent of what is ready."""
        return heapq.heappop(self.ready)[2]

    def commit(self, work: _Work, table: pd.DataFrame, seconds: float) -> Finished:
        """Write a result to the store; what waited for it may be ready now."""
        self._store.save(work.task.stage, work.key, work.task.name, table, {"seconds": seconds})
        return self._finish(work, table, seconds, found=False)

    def fail(self, place: Any, error: Exception) -> Generator[Finished, None, None]:  # noqa: ANN401
        """Give up a task and all that needs it."""
        lost = [place]
        for one in lost:
            if one in self._open:
                self._open.remove(one)
                self.left -= 1
                yield Finished(task=one, table=None, seconds=0.0, found=False, error=error)
                lost += [p for p, task in self._tasks.items() if one in task.needs]

    def _work(self, place: Any) -> _Work:  # noqa: ANN401 - any name
        task = self._tasks[place]
        key = task.key([self._digest(need) for need in task.needs])
        inputs = [self._tables[need] for need in task.needs]
        lasting = self._note(task, key)
        return _Work(place=place, task=task, key=key, inputs=inputs, lasting=lasting)

    def _note(self, task: Task, key: str) -> Mapping[str, Any]:
        """Note beside a key what it stands for, once, and return what lasts of it."""
        place = (task.stage, key)
        if place not in self._noted:
            if task.stage not in self._before:
                self._before[task.stage] = self._store.descriptions(task.stage)
            before = self._before[task.stage].get(key)
            self._noted[place] = {
                name: value if before is None else before.get(name, {})
                for name, value in task.lasting.items()
            }
            if task.description:
                self._store.describe(*place, {**task.description, **self._noted[place]})
        return self._noted[place]

    def _digest(self, place: Any) -> str:  # noqa: ANN401 - any name
        if place not in self._digests:
            self._digests[place] = table_digest(self._tables[place])
        return self._digests[place]

    def _finish(self, work: _Work, table: pd.DataFrame, seconds: float, *, found: bool) -> Finished:
        self.left -= 1
        self._open.discard(work.place)
        if self._users[work.place]:  # what was given serves the others, be it computed anew here
            self._tables.setdefault(work.place, table)
        for need in work.task.needs:
            self._users[need] -= 1
            if not self._users[need]:  # nobody else waits for it
                self._tables.pop(need, None)
        self._sorter.done(work.place)
        return Finished(
            task=work.place, table=table, seconds=seconds, found=found, lasting=work.lasting
        )


class _Pool(Protocol):
    """Where tasks run."""

    @property
    def busy(self) -> bool: ...
    @property
    def room(self) -> bool: ...
    def submit(self, work: _Work) -> None: ...
    def next(self) -> _Done: ...
    def __enter__(self) -> "_Pool": ...
    def __exit__(self, *error: object) -> None: ...


def _pool(left: int, workers: int | None, cluster: str | None, patience: int) -> _Pool:
    """Return where at most so many tasks are run."""
    if cluster is not None:
        return _Cluster(cluster)
    count = min(workers or joblib.cpu_count(), left)
    return _Here() if count == 1 else _Processes(count, patience)


class _Here:
    """This process, one task at a time."""

    def __init__(self) -> None:
        self._waiting: list[_Work] = []
        self._code = _Code()

    def __enter__(self) -> "_Here":
        return self

    def __exit__(self, *error: object) -> None:
        self._waiting.clear()

    @property
    def busy(self) -> bool:
        return bool(self._waiting)

    @property
    def room(self) -> bool:
        return not self._waiting

    def submit(self, work: _Work) -> None:
        self._code.expect(work.task)
        self._waiting.append(work)

    def next(self) -> _Done:
        work = self._waiting.pop()
        try:
            return self._code.checked(work, _run(*_call(work)))
        except Exception as error:
            return _Done(work=work, outcome=error)


class _Processes:
    """Processes of this machine; those that die are replaced, and their tasks run again."""

    def __init__(self, count: int, patience: int) -> None:
        # loky replaces workers that have grown, and says so where nobody can do anything about it.
        warnings.filterwarnings("ignore", "A worker stopped while some jobs", UserWarning)
        self._count, self._patience, self._deaths = count, patience, 0
        self._running: dict[Future[_Computed], _Work] = {}
        self._code = _Code()

    def __enter__(self) -> "_Processes":
        return self

    def __exit__(self, *error: object) -> None:
        if not self._running:
            return
        # Left early: nobody waits for these any more. What loky has not handed out yet when it is
        # told to stop, it stumbles over.
        deadline = time.monotonic() + 1.0
        while time.monotonic() < deadline and any(
            not (one.running() or one.done()) for one in self._running
        ):
            time.sleep(0.005)
        self._executor().shutdown(wait=True, kill_workers=True)

    @property
    def busy(self) -> bool:
        return bool(self._running)

    @property
    def room(self) -> bool:
        return len(self._running) <= self._count  # one more, so that nobody waits for the driver

    def submit(self, work: _Work) -> None:
        self._code.expect(work.task)
        try:
            future = self._executor().submit(_run, *_call(work))
        except BrokenProcessPool:  # a worker died just now: the next pool is another one
            future = self._executor().submit(_run, *_call(work))
        self._running[future] = work

    def next(self) -> _Done:
        while True:
            done, _ = wait(self._running, return_when=FIRST_COMPLETED)
            whole = [one for one in done if not isinstance(one.exception(), BrokenProcessPool)]
            if whole:
                self._deaths = 0
                work = self._running.pop(whole[0])
                error = whole[0].exception()
                if isinstance(error, Exception):
                    return _Done(work=work, outcome=error)
                return self._code.checked(work, whole[0].result())
            self._again()

    def _again(self) -> None:
        """Submit again what a pool had that lost a worker."""
        self._deaths += 1
        wait(self._running)
        lost = [one for one in self._running if isinstance(one.exception(), BrokenProcessPool)]
        names = sorted(self._running[one].task.name for one in lost)
        if self._deaths >= self._patience:
            msg = f"workers died {self._deaths} times without finishing any of {names[:5]}"
            raise WorkersLostError(msg) from lost[0].exception()
        _log.warning("a worker died; %d of its shards are submitted again", len(lost))
        for work in [self._running.pop(one) for one in lost]:
            self.submit(work)

    def _executor(self) -> Any:  # noqa: ANN401 - loky has no types
        return cast("Any", loky).get_reusable_executor(
            max_workers=self._count, timeout=_IDLE_S, env=_THREADS
        )


class _Cluster:
    """The workers of a dask scheduler, which runs again what a dead one had."""

    def __init__(self, address: str) -> None:
        try:
            from distributed import Client, as_completed
        except ImportError as error:
            msg = f"cluster {address!r} needs the extra: pip install 'cpl[cluster]'"
            raise ImportError(msg) from error
        self._address, self._code = address, _Code()
        self._running: dict[Any, _Work] = {}
        self._client: Any = Client(address)
        self._done: Any = as_completed(with_results=True, raise_errors=False)

    def __enter__(self) -> "_Cluster":
        try:
            self._client.wait_for_workers(1, timeout=_WORKER_WAIT_S)
        except TimeoutError as error:
            self._client.close()
            msg = f"no worker has come to {self._address} within {_WORKER_WAIT_S} s"
            raise TimeoutError(msg) from error
        return self

    def __exit__(self, *error: object) -> None:
        try:
            self._client.cancel(list(self._running))
        finally:
            self._client.close()

    @property
    def busy(self) -> bool:
        return bool(self._running)

    @property
    def room(self) -> bool:
        return True  # the scheduler keeps the order

    def submit(self, work: _Work) -> None:
        self._code.expect(work.task)
        # pure: a task's name and this sweep make the key, not a hash of arguments and code.
        future = self._client.submit(_run, *_call(work), pure=False, priority=work.task.rank)
        self._running[future] = work
        self._done.add(future)

    def next(self) -> _Done:
        from distributed import KilledWorker

        future, computed = next(self._done)
        work = self._running.pop(future)
        if future.status == "error":
            error = future.exception()
            if isinstance(error, KilledWorker):
                raise WorkersLostError(str(error)) from error
            return _Done(work=work, outcome=cast("Exception", error))
        if future.status != "finished" or isinstance(computed, CancelledError):
            msg = f"lost the scheduler at {self._address}; the same command goes on from here"
            raise ConnectionError(msg)
        # What is fetched and still held, dask would compute again when its worker dies.
        future.release()
        return self._code.checked(work, cast("_Computed", computed))


class _Code:
    """The code that the driver started with, and that every worker must have."""

    def __init__(self) -> None:
        self._expected: dict[str, str] = {}

    def expect(self, task: Task) -> None:
        if task.origin not in self._expected:
            self._expected[task.origin] = fingerprint(task.origin)

    def checked(self, work: _Work, computed: "_Computed") -> _Done:
        table, seconds, theirs = computed
        if theirs == self._expected[work.task.origin]:
            return _Done(work=work, outcome=table, seconds=seconds)
        msg = (
            f"shard {work.task.name!r} was computed by other code of {work.task.origin} than the "
            "driver started with; start again"
        )
        raise CodeMismatchError(msg)


_Computed = tuple[pd.DataFrame, float, str]


def _call(work: _Work) -> tuple[Callable[[Tables], pd.DataFrame], Tables, str, str]:
    """Return what a worker has to know."""
    return work.task.call, work.inputs, work.task.name, work.task.origin


def _run(
    call: Callable[[Tables], pd.DataFrame], inputs: Tables, name: str, origin: str
) -> _Computed:
    """Run one task (in a worker); say how long it took and with which code."""
    begun = time.process_time()
    try:
        table = call(inputs)
    except Exception as error:
        error.add_note(f"in shard {name!r}")
        raise
    return table, time.process_time() - begun, fingerprint(origin)


def _bar(total: int) -> Any:  # noqa: ANN401 - a tqdm, which has no types
    """Say how far a sweep is; elsewhere than on a terminal a line now and then."""
    every_s = 0.2 if sys.stderr.isatty() else 20.0
    return tqdm(total=total, desc="pieces", unit="", mininterval=every_s, maxinterval=every_s)
