"""Run the missing shards of a job, and before them those of other experiments that they need."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import pandas as pd

from cpl.experiments.run.inputs import digests, published_shards
from cpl.experiments.run.job import Job, experiment, job_of
from cpl.experiments.run.result import Provenance, Result
from cpl.experiments.run.spec import Inputs, Need
from cpl.store import (
    PublishedShard,
    WorkStore,
    canonical_json,
    machine,
    plain,
    rules_in_force,
    source_commit,
    table_digest,
    today,
)
from cpl.sweep import Outcome, sweep

__all__ = ["run_again", "run_job"]


def run_job(
    task: Job,
    *,
    store: WorkStore | None = None,
    workers: int | None = 1,
    cluster: str | None = None,
    quiet: bool = True,
) -> Result:
    """Run the missing shards of a job, and before them what they need; put all together."""
    store = WorkStore() if store is None else store
    how = _How(store=store, workers=workers, cluster=cluster, quiet=quiet)
    outcome, rules = _swept(task, tuple(task.pieces), how)
    table = pd.concat(outcome.tables.values(), ignore_index=True)
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
        seconds=outcome.seconds,
        content=table_digest(table),
        verified=today(),
        shards=_stretches(outcome.tables),
        rules=rules,
    )
    return Result(table=table, config=task.config, provenance=provenance)


def run_again(task: Job, shard: str) -> pd.DataFrame:
    """Run one shard anew, whatever the store holds; its inputs are found, or computed."""
    how = _How(store=WorkStore(), workers=1, cluster=None, quiet=True)
    inputs = _inputs(task, [shard], how)[shard]
    return _run_shard(task.name, task.config, _arguments(task, shard, inputs))


@dataclass(frozen=True, kw_only=True)
class _How:
    """Where and how loudly shards are run."""

    store: WorkStore
    workers: int | None
    cluster: str | None
    quiet: bool


def _swept(task: Job, names: Sequence[str], how: _How) -> tuple[Outcome, dict[str, str]]:
    """Run the named shards that the store does not hold, and before them their inputs.

    Returns:
        The shards, and the rules of the ledger that were fixed before any of them was begun.
    """
    inputs = _inputs(task, names, how)
    keys = {n: task.key(digests(task.needs(n), inputs[n])) for n in names}
    known, told = how.store.descriptions(task.name), list[dict[str, str]]()
    for key in set(keys.values()):
        told.append(known[key].get("rules", {}) if key in known else rules_in_force())
        how.store.describe(task.name, key, {**_description(task), "rules": told[-1]})
    outcome = sweep(
        partial(_run_shard, task.name, task.config),
        {n: _arguments(task, n, inputs[n]) for n in names},
        stage=task.name,
        key=keys,
        origin=task.origin,
        store=how.store,
        workers=how.workers,
        cluster=how.cluster,
        quiet=how.quiet,
    )
    shared = set[tuple[str, str]].intersection(*(set(rules.items()) for rules in told))
    return outcome, dict(sorted(shared))


def _arguments(task: Job, shard: str, inputs: Inputs) -> tuple[Any, ...]:
    """Return what a shard is run with: itself, and its inputs if it has any."""
    return (task.pieces[shard], inputs) if inputs else (task.pieces[shard],)


def _run_shard(
    name: str,
    config: Any,  # noqa: ANN401 - its own Config
    shard_and_inputs: tuple[Any, ...],
) -> pd.DataFrame:
    return experiment(name).run(config, *shard_and_inputs)


def _inputs(
    task: Job, names: Sequence[str], how: _How
) -> dict[str, dict[str, dict[str, pd.DataFrame]]]:
    """Find or compute what the shards need, each experiment in one sweep.

    Returns:
        By shard of the task, by need, by shard of the need: the table.
    """
    needs = {name: task.needs(name) for name in names}
    wanted: dict[str, Need] = {}  # one for each experiment and configuration
    for need in (need for several in needs.values() for need in several):
        place = _place(need)
        before = wanted[place].shards if place in wanted else ()
        wanted[place] = replace(need, shards=tuple(dict.fromkeys((*before, *need.shards))))
    tables = {place: _found(need, how) for place, need in wanted.items()}
    return {
        name: {need.label: {s: tables[_place(need)][s] for s in need.shards} for need in several}
        for name, several in needs.items()
    }


def _place(need: Need) -> str:
    return canonical_json([need.experiment, plain(need.config)])


def _found(need: Need, how: _How) -> dict[str, pd.DataFrame]:
    """Return the needed shards: published ones, then those of the store, then new ones."""
    task = job_of(need.experiment, "+", need.config)
    if unknown := [name for name in need.shards if name not in task.pieces]:
        msg = f"shards of {need.experiment!r} must be among its own, got {unknown}"
        raise ValueError(msg)
    found = published_shards(need, task.spec)
    missing = [name for name in need.shards if name not in found]
    return {**found, **(_swept(task, missing, how)[0].tables if missing else {})}


def _description(task: Job) -> dict[str, Any]:
    return {
        "experiment": task.name,
        "parameters": task.parameters,
        "modules": task.modules,
        "versions": task.versions,
        "shards": len(task.pieces),
    }


def _stretches(tables: Mapping[str, pd.DataFrame]) -> tuple[PublishedShard, ...]:
    found: list[PublishedShard] = []
    first = 0
    for name, table in tables.items():
        found.append(PublishedShard(name=name, first_row=first, rows=len(table)))
        first += len(table)
    return tuple(found)


def _seeds(parameters: Mapping[str, Any]) -> dict[str, int]:
    return {name: value for name, value in parameters.items() if name.endswith("seed")}
