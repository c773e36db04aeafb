"""Run jobs: the pieces of all of them in one pool, each as soon as what it needs is there."""

from collections.abc import Generator, Mapping, Sequence
from contextlib import closing
from typing import Any

import pandas as pd

from cpl.experiments.run.graph import Graph, Place
from cpl.experiments.run.job import Job
from cpl.experiments.run.result import Provenance, Result
from cpl.store import PublishedShard, WorkStore, machine, plain, source_commit, table_digest, today
from cpl.sweep import sweep

__all__ = ["run_again", "run_job", "run_jobs"]


def run_job(
    task: Job,
    *,
    store: WorkStore | None = None,
    workers: int | None = 1,
    cluster: str | None = None,
    quiet: bool = True,
) -> Result:
    """Run the missing shards of a job, and before them what they need; put all together."""
    with closing(
        run_jobs([task], store=store, workers=workers, cluster=cluster, quiet=quiet)
    ) as done:
        ((_, result),) = done
    if isinstance(result, Exception):
        raise result
    return result


def run_jobs(
    jobs: Sequence[Job],
    *,
    store: WorkStore | None = None,
    workers: int | None = None,
    cluster: str | None = None,
    quiet: bool = False,
    missing: type[Exception] | tuple[type[Exception], ...] = (),
    seconds: dict[Place, float] | None = None,
) -> Generator[tuple[Job, Result | Exception], None, None]:
    """Run the missing shards of several jobs and of what they need, in one pool.

    Args:
        jobs: What is to be done.
        store: Work layer; the default one unless given.
        workers: Processes; one a core unless given.
        cluster: Address of a dask scheduler instead.
        quiet: Say nothing.
        missing: Errors that end only the jobs whose pieces they hit: their result is the error.
        seconds: Filled with the processor seconds of every piece.

    Yields:
        Each job with its result, as soon as its last piece is there.
    """
    graph, spent = Graph(), {} if seconds is None else seconds
    places = {number: graph.add(job) for number, job in enumerate(jobs)}
    waits: dict[Place, list[int]] = {}
    for number, own in places.items():
        for place in own:
            waits.setdefault(place, []).append(number)
    left = {number: len(own) for number, own in places.items()}
    tables: dict[Place, pd.DataFrame] = {}
    rules: dict[Place, Mapping[str, str]] = {}
    for done in sweep(
        graph.tasks(), graph.given, store=store, workers=workers, cluster=cluster, quiet=quiet,
        missing=missing,
    ):  # fmt: skip
        spent[done.task] = done.seconds
        rules[done.task] = done.lasting.get("rules", {})
        asking = [number for number in waits.get(done.task, []) if number in left]
        if done.table is not None and asking:
            tables[done.task] = done.table
        for number in asking:
            if done.error is not None:
                del left[number]
                yield jobs[number], done.error
                continue
            left[number] -= 1
            if not left[number]:
                del left[number]
                yield jobs[number], _result(jobs[number], tables, places[number], spent, rules)
                for place in places[number]:
                    if not any(other in left for other in waits[place]):
                        tables.pop(place, None)


def run_again(task: Job, shard: str) -> pd.DataFrame:
    """Run one shard anew, whatever the store holds; its inputs are found, or computed."""
    graph = Graph()
    (place,) = graph.add(task, [shard])
    tasks = graph.tasks()
    own = tasks.pop(place)
    inputs: dict[Any, pd.DataFrame] = {**graph.given}
    for done in sweep(tasks, graph.given, workers=1, quiet=True):
        if done.table is not None:
            inputs[done.task] = done.table
    return own.call([inputs[need] for need in own.needs])


def _result(
    task: Job,
    tables: Mapping[Place, pd.DataFrame],
    places: Sequence[Place],
    seconds: Mapping[Place, float],
    rules: Mapping[Place, Mapping[str, str]],
) -> Result:
    parts = {place[1]: tables[place] for place in places}
    table = pd.concat(parts.values(), ignore_index=True)
    provenance = Provenance(
        experiment=task.name,
        profile=task.profile,
        published=False,
        parameters=plain(task.config),
        seeds=_seeds(plain(task.config)),
        label=task.spec.label,
        commit=source_commit(),
        modules=task.modules,
        versions=task.versions,
        machine=machine(),
        made=today(),
        seconds=sum(seconds[place] for place in places),
        content=table_digest(table),
        verified=today(),
        shards=_stretches(parts),
        rules=_shared([rules[place] for place in places]),
    )
    return Result(table=table, config=task.config, provenance=provenance)


def _shared(rules: Sequence[Mapping[str, str]]) -> dict[str, str]:
    """Return the rules of the ledger that were fixed before any of some pieces was begun."""
    return dict(sorted(set.intersection(*(set(one.items()) for one in rules))))


def _stretches(tables: Mapping[str, pd.DataFrame]) -> tuple[PublishedShard, ...]:
    found: list[PublishedShard] = []
    first = 0
    for name, table in tables.items():
        found.append(PublishedShard(name=name, first_row=first, rows=len(table)))
        first += len(table)
    return tuple(found)


def _seeds(parameters: Mapping[str, Any]) -> dict[str, int]:
    return {name: value for name, value in parameters.items() if name.endswith("seed")}
