"""What all experiments share: find one, run its shards, publish, re-execute, say what is stale."""

import time
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from importlib import import_module
from typing import Any, Protocol, cast

import pandas as pd

from cpl.experiments import names
from cpl.experiments._result import Provenance, Report, Result
from cpl.experiments._settings import changed, nearest
from cpl.experiments._shard import Shard
from cpl.rng import stream
from cpl.store import (
    Manifest,
    PublishedShard,
    Verification,
    WorkStore,
    fingerprint,
    machine,
    module_digests,
    plain,
    publish,
    read_manifest,
    read_published,
    record_verification,
    same_table,
    source_commit,
    stage_key,
    staleness,
    table_digest,
    today,
    versions_below,
)
from cpl.sweep import sweep

__all__ = [
    "Experiment",
    "Job",
    "compute",
    "experiment",
    "job",
    "publish_result",
    "published",
    "run_job",
    "verify",
]


class Experiment(Protocol):
    """What a module of `cpl.experiments` offers."""

    __doc__: str
    LABEL: str
    PROFILES: Mapping[str, Any]

    def shards(self, config: Any) -> list[Shard]:  # noqa: ANN401 - its own Config
        """Cut the experiment into pieces."""
        ...

    def run_shard(self, config: Any, shard: Shard) -> pd.DataFrame:  # noqa: ANN401
        """Compute one piece."""
        ...


@dataclass(frozen=True, kw_only=True)
class Job:
    """An experiment with its configuration, and the key under which its shards are kept."""

    name: str
    profile: str
    module: Experiment
    config: Any
    pieces: dict[str, Shard]
    key: str
    modules: dict[str, str]
    versions: dict[str, str]

    @property
    def origin(self) -> str:
        """Dotted name of the module that computes."""
        return f"cpl.experiments.{self.name}"


def experiment(name: str) -> Experiment:
    """Import an experiment by name.

    Raises:
        ValueError: If there is none of that name.
    """
    known = names()
    if name not in known:
        raise ValueError(nearest("experiment", name, known))
    return cast("Experiment", import_module(f"cpl.experiments.{name}"))


def job(name: str, profile: str, changes: Mapping[str, object] | None = None) -> Job:
    """Check everything that was asked for, before any work.

    Raises:
        ValueError: If there is no such experiment, profile or setting, or a value does not fit.
    """
    module = experiment(name)
    if profile not in module.PROFILES:
        raise ValueError(nearest(f"profile of {name}", profile, module.PROFILES))
    config = changed(module.PROFILES[profile], changes or {})
    same = config == module.PROFILES[profile]
    return _job(name, profile if same else f"{profile}+", config)


def compute(
    name: str,
    profile: str,
    changes: Mapping[str, object],
    *,
    store: WorkStore | None = None,
    workers: int | None = 1,
    cluster: str | None = None,
    quiet: bool = True,
) -> Result:
    """Compute what the work layer does not hold yet; see `cpl.experiments.compute`."""
    return run_job(
        job(name, profile, changes), store=store, workers=workers, cluster=cluster, quiet=quiet
    )


def run_job(
    task: Job,
    *,
    store: WorkStore | None = None,
    workers: int | None = 1,
    cluster: str | None = None,
    quiet: bool = True,
) -> Result:
    """Run the missing shards of a job and put all of them together."""
    store = WorkStore() if store is None else store
    store.describe(task.name, task.key, _description(task))
    outcome = sweep(
        partial(task.module.run_shard, task.config),
        task.pieces,
        stage=task.name,
        key=task.key,
        origin=task.origin,
        store=store,
        workers=workers,
        cluster=cluster,
        quiet=quiet,
    )
    table = pd.concat(outcome.tables.values(), ignore_index=True)
    provenance = Provenance(
        experiment=task.name,
        profile=task.profile,
        published=False,
        parameters=plain(task.config),
        seeds=_seeds(plain(task.config)),
        label=task.module.LABEL,
        commit=source_commit(),
        modules=task.modules,
        versions=task.versions,
        machine=machine(),
        made=today(),
        seconds=outcome.seconds,
        content=table_digest(table),
        verified=today(),
        shards=_stretches(outcome.tables),
    )
    return Result(table=table, config=task.config, provenance=provenance)


def publish_result(result: Result) -> Manifest:
    """Write a result into the published layer.

    Raises:
        ValueError: If its settings are not those of a profile: only profiles are published.
    """
    told = result.provenance
    if told.profile not in experiment(told.experiment).PROFILES:
        msg = f"profile must be unchanged to be published, got {told.profile!r}"
        raise ValueError(msg)
    manifest = Manifest(
        experiment=told.experiment,
        profile=told.profile,
        parameters=told.parameters,
        seeds=told.seeds,
        label=told.label,
        commit=told.commit,
        origins=[f"cpl.experiments.{told.experiment}"],
        modules=told.modules,
        versions=told.versions,
        machine=told.machine,
        made=told.made,
        seconds=round(told.seconds, 3),
        shards=list(told.shards),
        verified=Verification(
            date=told.made,
            modules=told.modules,
            versions=told.versions,
            shards=[shard.name for shard in told.shards],
            of=len(told.shards),
        ),
    )
    publish(result.table, manifest)
    return read_manifest(told.experiment, told.profile)


def published(name: str, profile: str) -> Result:
    """Read a published result; see `cpl.experiments.published`."""
    table, manifest = read_published(name, profile)
    module = experiment(name)
    today_config = module.PROFILES.get(profile)
    reasons = staleness(manifest, None if today_config is None else plain(today_config))
    provenance = Provenance(
        experiment=name,
        profile=profile,
        published=True,
        parameters=manifest.parameters,
        seeds=manifest.seeds,
        label=manifest.label,
        commit=manifest.commit,
        modules=manifest.modules,
        versions=manifest.versions,
        machine=manifest.machine,
        made=manifest.made,
        seconds=manifest.seconds,
        content=manifest.content,
        verified=None if reasons else manifest.verified.date,
        stale=tuple(reasons),
        shards=tuple(manifest.shards),
    )
    config = _rebuilt(module, profile, manifest.parameters)
    return Result(table=table, config=config, provenance=provenance)


def verify(name: str, profile: str, *, sample: int, seed: int, record: bool = False) -> Report:
    """Re-execute a sample of shards; see `cpl.experiments.verify`.

    With ``record`` an agreement is written into the manifest, with today's code.
    """
    if sample < 1:
        msg = f"sample must be positive, got {sample!r}"
        raise ValueError(msg)
    module = experiment(name)
    table, manifest = read_published(name, profile)
    config = _rebuilt(module, profile, manifest.parameters)
    pieces = {shard.name: shard for shard in module.shards(config)}
    rng = stream(seed, "verify", name, profile)
    count = min(sample, len(manifest.shards))
    drawn = sorted(rng.choice(len(manifest.shards), size=count, replace=False).tolist())
    begun, differences = time.process_time(), list[str]()
    for shard in (manifest.shards[i] for i in drawn):
        stored = table.iloc[shard.first_row : shard.first_row + shard.rows]
        difference = _difference(module, config, pieces.get(shard.name), stored)
        if difference:
            differences.append(f"{shard.name}: {difference}")
    report = Report(
        experiment=name,
        profile=profile,
        checked=tuple(manifest.shards[i].name for i in drawn),
        of=len(manifest.shards),
        differences=tuple(differences),
        seconds=time.process_time() - begun,
    )
    if record and report.agrees:
        _record(manifest, report)
    return report


def _job(name: str, profile: str, config: Any) -> Job:  # noqa: ANN401 - its own Config
    module, origin = experiment(name), f"cpl.experiments.{name}"
    modules, versions = module_digests(origin), versions_below(origin)
    pieces = {shard.name: shard for shard in module.shards(config)}
    key = stage_key(name, config, fingerprint=fingerprint(origin), versions=versions)
    return Job(
        name=name,
        profile=profile,
        module=module,
        config=config,
        pieces=pieces,
        key=key,
        modules=modules,
        versions=versions,
    )


def _description(task: Job) -> dict[str, Any]:
    return {
        "experiment": task.name,
        "parameters": plain(task.config),
        "modules": task.modules,
        "versions": task.versions,
        "shards": len(task.pieces),
    }


def _difference(
    module: Experiment,
    config: Any,  # noqa: ANN401 - its own Config
    shard: Shard | None,
    stored: pd.DataFrame,
) -> str | None:
    if shard is None:
        return "the experiment has no such shard any more"
    rtol = float(getattr(module, "RTOL", 1e-9))
    return same_table(module.run_shard(config, shard), stored.reset_index(drop=True), rtol=rtol)


def _record(manifest: Manifest, report: Report) -> None:
    verification = Verification(
        date=today(),
        modules=module_digests(*manifest.origins),
        versions=versions_below(*manifest.origins),
        shards=list(report.checked),
        of=report.of,
    )
    record_verification(manifest, verification)


def _rebuilt(module: Experiment, profile: str, parameters: Mapping[str, Any]) -> Any:  # noqa: ANN401
    """Return the configuration that published parameters stand for."""
    pattern = module.PROFILES.get(profile, next(iter(module.PROFILES.values())))
    return changed(pattern, parameters)


def _stretches(tables: Mapping[str, pd.DataFrame]) -> tuple[PublishedShard, ...]:
    found: list[PublishedShard] = []
    first = 0
    for name, table in tables.items():
        found.append(PublishedShard(name=name, first_row=first, rows=len(table)))
        first += len(table)
    return tuple(found)


def _seeds(parameters: Mapping[str, Any]) -> dict[str, int]:
    return {name: value for name, value in parameters.items() if name.endswith("seed")}
