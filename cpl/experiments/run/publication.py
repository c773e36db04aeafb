"""What all experiments share: find one, run its shards, publish, re-execute, say what is stale."""

import time
from collections.abc import Mapping, Sequence
from typing import Any

import pandas as pd

from cpl.experiments.run.attestation import Attestation
from cpl.experiments.run.execute import run_again, run_job
from cpl.experiments.run.found import module_of
from cpl.experiments.run.job import Job, experiment, job, job_of
from cpl.experiments.run.result import Provenance, Report, Result
from cpl.experiments.run.settings import changed
from cpl.experiments.run.spec import Experiment
from cpl.rng import stream
from cpl.store import (
    Manifest,
    Verification,
    WorkStore,
    module_digests,
    plain,
    publish,
    read_manifest,
    read_published,
    record_verification,
    same_table,
    staleness,
    today,
    versions_below,
)

__all__ = [
    "Job",
    "compute",
    "experiment",
    "job",
    "job_of",
    "manifest_of",
    "publish_result",
    "published",
    "record_agreement",
    "record_attested",
    "run_job",
    "verify",
    "verify_pieces",
]


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


def publish_result(result: Result) -> Manifest:
    """Write a result into the published layer.

    Raises:
        ValueError: If its settings are not those of a profile: only profiles are published.
    """
    told = result.provenance
    if told.profile not in experiment(told.experiment).profiles:
        msg = f"profile must be unchanged to be published, got {told.profile!r}"
        raise ValueError(msg)
    publish(result.table, manifest_of(result))
    return read_manifest(told.experiment, told.profile)


def manifest_of(result: Result) -> Manifest:
    """Return what is to be written beside a result that was just computed."""
    told = result.provenance
    return Manifest(
        experiment=told.experiment,
        profile=told.profile,
        parameters=told.parameters,
        seeds=told.seeds,
        label=told.label,
        commit=told.commit,
        origins=[module_of(told.experiment)],
        modules=told.modules,
        versions=told.versions,
        machine=told.machine,
        made=told.made,
        seconds=round(told.seconds, 3),
        shards=list(told.shards),
        rules=dict(told.rules),
        verified=Verification(
            date=told.made,
            modules=told.modules,
            versions=told.versions,
            shards=[shard.name for shard in told.shards],
            of=len(told.shards),
        ),
    )


def published(name: str, profile: str) -> Result:
    """Read a published result; see `cpl.experiments.published`."""
    table, manifest = read_published(name, profile)
    spec = experiment(name)
    today_config = spec.profiles.get(profile)
    reasons = staleness(
        manifest,
        None if today_config is None else plain(today_config),
        origins=[module_of(name)],
    )
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
        rules=manifest.rules,
    )
    config = _rebuilt(spec, profile, manifest.parameters)
    return Result(table=table, config=config, provenance=provenance)


def verify(name: str, profile: str, *, sample: int, seed: int, record: bool = False) -> Report:
    """Re-execute a sample of shards; see `cpl.experiments.verify`.

    With ``record`` an agreement is written into the manifest, with today's code.
    """
    if sample < 1:
        msg = f"sample must be positive, got {sample!r}"
        raise ValueError(msg)
    manifest = read_manifest(name, profile)
    rng = stream(seed, "verify", name, profile)
    count = min(sample, len(manifest.shards))
    drawn = sorted(rng.choice(len(manifest.shards), size=count, replace=False).tolist())
    report = verify_pieces(name, profile, [manifest.shards[i].name for i in drawn])
    if record and report.agrees:
        _record(manifest, report.checked)
    return report


def verify_pieces(name: str, profile: str, pieces: Sequence[str]) -> Report:
    """Re-execute the named pieces of a published result and compare.

    Raises:
        FileNotFoundError: If nothing is published under these names.
        ValueError: If the result has no such piece, or the experiment is unknown.
        cpl.store.DamagedResultError: If the published files do not agree with each other.
    """
    spec = experiment(name)
    table, manifest = read_published(name, profile)
    places = {shard.name: shard for shard in manifest.shards}
    if unknown := [piece for piece in pieces if piece not in places]:
        raise ValueError(f"pieces must be among those of {name}/{profile}, got {unknown}")
    task = job_of(name, profile, _rebuilt(spec, profile, manifest.parameters))
    begun, differences = time.process_time(), list[str]()
    for shard in (places[piece] for piece in pieces):
        stored = table.iloc[shard.first_row : shard.first_row + shard.rows]
        difference = _difference(task, shard.name, stored)
        if difference:
            differences.append(f"{shard.name}: {difference}")
    return Report(
        experiment=name,
        profile=profile,
        checked=tuple(pieces),
        of=len(manifest.shards),
        differences=tuple(differences),
        seconds=time.process_time() - begun,
    )


def record_agreement(name: str, profile: str, shards: Sequence[str]) -> None:
    """Write down that shards of a published result were computed again, and are the same."""
    _record(read_manifest(name, profile), shards)


def record_attested(name: str, profile: str) -> None:
    """Write into a manifest which pieces today's source computed again, as attested."""
    manifest = read_manifest(name, profile)
    _record(manifest, sorted(Attestation().today(manifest)))


def _difference(task: Job, shard: str, stored: pd.DataFrame) -> str | None:
    if shard not in task.pieces:
        return "the experiment has no such shard any more"
    computed = run_again(task, shard)
    return same_table(computed, stored.reset_index(drop=True), rtol=task.spec.rtol)


def _record(manifest: Manifest, shards: Sequence[str]) -> None:
    verification = Verification(
        date=today(),
        modules=module_digests(module_of(manifest.experiment)),
        versions=versions_below(module_of(manifest.experiment)),
        shards=list(shards),
        of=len(manifest.shards),
    )
    record_verification(manifest, verification)


def _rebuilt(spec: Experiment, profile: str, parameters: Mapping[str, Any]) -> Any:  # noqa: ANN401
    """Return the configuration that published parameters stand for."""
    pattern = spec.profiles.get(profile, next(iter(spec.profiles.values())))
    return changed(pattern, parameters)
