"""Everything again from nothing: each experiment into an empty store, then number against number.

What was published is not read while computing: inputs are recomputed as well. The results go into a
layer of their own, which is compared with the published one in two ways:

- piece by piece: a piece of an experiment that is computed again must give the same table;
- claim by claim: the ledger's rules are applied to that layer as they are to the published one.

One training seed is enough for the first and not for the second: a rule that takes its interval
over seeds cannot decide on one, and the report then says so instead of a verdict.
"""

from __future__ import annotations

import json
import os
import time
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cpl.reproduce._agreement import Claim, Pieces, claims_again, pieces_again
from cpl.store import atomic_write, machine, source_commit, today

if TYPE_CHECKING:
    from cpl.experiments.run.graph import Graph, Place
    from cpl.experiments.run.job import Job
    from cpl.experiments.run.result import Result

__all__ = ["Claim", "Pieces", "Step", "plan", "reproduce", "unpublished"]

_PUBLISHED = "paper"
_SEEDS = ("pairs", "seeds")  # a setting that ends like this counts training seeds
_MOST_SEEDS = 10  # as many as anything published has


@dataclass(frozen=True, kw_only=True)
class Step:
    """One experiment of a reproduction.

    Attributes:
        experiment: Its name.
        job: What is run.
        whole: Whether that is the experiment as it is published; else it has fewer seeds.
        expected_s: Processor seconds it should take, without what it stands on; None if it was
            never timed.
    """

    experiment: str
    job: Job
    whole: bool
    expected_s: float | None


def plan(
    profile: str = _PUBLISHED, only: Sequence[str] = (), *, without: Sequence[str] = ()
) -> list[Step]:
    """List what a reproduction runs: every published experiment, with one training seed.

    Args:
        profile: Whose sizes; settings that count training seeds (``pairs``, ``..._seeds``) are set
            to 1, everything else stays: episodes, steps, trajectories, folds.
        only: Names of experiments; all that are published unless given.
        without: Names of experiments to leave out.

    Returns:
        The steps, each behind those whose results it needs.

    Raises:
        ValueError: If there is no such experiment or profile.
    """
    from cpl.experiments import names
    from cpl.experiments.run.job import experiment, job, job_of

    steps: dict[str, Step] = {}
    for name in without:
        experiment(name)
    nothing = set() if only else set(unpublished())
    for name in only or names():
        if name in without or name in nothing:
            continue
        whole = job(name, profile)
        steps[name] = _step(whole, job_of(name, f"{profile}+", _with_seeds(whole, 1)))
    for name, wanted in _needed(steps.values()).items():
        if name in steps and wanted - steps[name].job.pieces.keys():
            steps[name] = _grown(job(name, profile), wanted)
    return _in_order(steps)


def unpublished() -> list[str]:
    """Return the experiments without a published result: there is nothing to compare them with.

    They make material for pages, or recordings, which have a place and a provenance of their own.
    """
    from cpl.experiments import names
    from cpl.store import manifests

    there = {manifest.experiment for manifest in manifests() if manifest.profile == _PUBLISHED}
    return [name for name in names() if name not in there]


def reproduce(
    steps: Sequence[Step],
    folder: Path,
    *,
    left_out: Mapping[str, str] | None = None,
    workers: int | None = None,
    cluster: str | None = None,
    record: bool = False,
    report: Callable[[str], None] = print,
) -> dict[str, Any]:
    """Compute everything into a folder, compare, and write `report.json` there.

    The pieces of all steps are run in one pool, each as soon as what it needs is there, that at
    the head of the longest chain first. Stopped and called again with the same folder it goes on
    where it was, and the report says so. Called again when everything is there, it compares anew
    and keeps what the report says of the computation.

    Args:
        steps: From `plan`, at least one.
        folder: Holds the store, the results and the report; empty at first.
        left_out: What is not run, and why: goes into the report.
        workers: Processes; one a core unless given.
        cluster: Address of a dask scheduler instead.
        record: Call a published result verified, with today's code, if its pieces are the same.
        report: Called with a line for each step, and an estimate of the time left.

    Returns:
        The report: machine, versions, steps with their seconds and pieces, claims, and beside the
        time that it took the time that the schedule was to take: `predicted_s` by what the pieces
        took when they were last noted, `scheduled_s` by what they took now.
    """
    from cpl.experiments.run.execute import run_jobs
    from cpl.experiments.run.publication import record_agreement
    from cpl.store import WorkStore

    store, results = WorkStore(folder / "store"), folder / "results"
    resumed, there = store.root.exists(), _shards(store.root)
    by_name = {step.experiment: step for step in steps}
    begun, done, seconds = time.monotonic(), list[dict[str, Any]](), dict[Any, float]()
    with _from_nothing():
        graph = _graph(steps)
        predicted_s = _makespan(graph, workers)
        report(f"about {predicted_s / 60:.0f} min to go")
        for job, result in run_jobs(
            [step.job for step in steps], store=store, workers=workers, cluster=cluster,
            missing=ModuleNotFoundError, seconds=seconds,
        ):  # fmt: skip
            step, ended_s = by_name[job.name], time.monotonic() - begun
            if isinstance(result, Exception):  # it needs an extra that is not installed
                done.append(_entry(step, None, ended_s, str(result)))
                continue
            _publish(result, results)
            pieces = pieces_again(job, result)
            if record and pieces.agree:
                record_agreement(step.experiment, _PUBLISHED, pieces.shards)
            done.append(_entry(step, result, ended_s, None, pieces))
            left = _left(steps, done, ended_s)
            report(f"[{len(done)}/{len(steps)}] {step.experiment}{left}")
        scheduled_s = _makespan(graph, workers, seconds)
    claims = claims_again(results, {s.experiment for s in steps if s.whole})
    found = {
        "made": today(),
        "commit": source_commit(),
        "machine": machine(),
        "workers": workers or os.cpu_count(),
        "cluster": cluster is not None,
        "resumed": resumed,
        "compared": {"date": today(), "commit": source_commit()},
        "wall_s": round(time.monotonic() - begun, 1),
        "predicted_s": round(predicted_s, 1),
        "scheduled_s": round(scheduled_s, 1),
        "processor_s": round(sum(step["processor_s"] or 0.0 for step in done), 1),
        "left_out": dict(left_out or {}),
        "steps": done,
        "claims": [asdict(claim) for claim in claims],
    }
    if there and there == _shards(store.root):
        found |= _computed_before(folder / "report.json", done)
    text = json.dumps(found, indent=1, sort_keys=True, allow_nan=False)
    atomic_write(folder / "report.json", text + "\n")
    return found


def _graph(steps: Sequence[Step]) -> Graph:
    from cpl.experiments.run.graph import Graph

    graph = Graph()
    for step in steps:
        graph.add(step.job)
    return graph


def _makespan(
    graph: Graph, workers: int | None, seconds: Mapping[Place, float] | None = None
) -> float:
    """Return how long the schedule takes that `cpl.sweep` runs, by expected or by given times."""
    from cpl.experiments.run.schedule import makespan

    pieces = graph.costs()
    if seconds is not None:
        pieces = {place: replace(p, seconds=seconds.get(place, 0.0)) for place, p in pieces.items()}
    return makespan(pieces, workers or os.cpu_count() or 1).seconds


def _step(whole: Job, task: Job) -> Step:
    from cpl.experiments.run.costs import expected_seconds

    expected = expected_seconds(task.name, tuple(task.pieces))
    return Step(
        experiment=task.name,
        job=task,
        whole=task.config == whole.config,
        expected_s=None if expected is None else sum(expected.values()),
    )


def _needed(steps: Iterable[Step]) -> dict[str, set[str]]:
    """Return the pieces that steps stand on, by experiment."""
    found: dict[str, set[str]] = {}
    for step in steps:
        for need in (need for piece in step.job.pieces for need in step.job.needs(piece)):
            found.setdefault(need.experiment, set()).update(need.shards)
    return found


def _shards(root: Path) -> frozenset[str]:
    return frozenset(str(path.relative_to(root)) for path in root.rglob("*.shard"))


def _computed_before(path: Path, steps: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Return what an earlier report says of the computation; the steps take their times from it."""
    if not path.exists():
        return {}
    earlier = json.loads(path.read_text(encoding="utf-8"))
    times = {step["experiment"]: step["ended_s"] for step in earlier["steps"]}
    for step in steps:
        step["ended_s"] = times.get(step["experiment"], step["ended_s"])
    names = (
        "made", "commit", "machine", "workers", "cluster", "resumed",
        "wall_s", "predicted_s", "scheduled_s",
    )  # fmt: skip
    return {name: earlier[name] for name in names}


def _grown(whole: Job, wanted: Collection[str]) -> Step:
    """Return the step with the fewest training seeds that has the wanted pieces.

    A later pair needs those before it; a choice made over several seeds, such as the penalties'
    weights, needs all of them.
    """
    from cpl.experiments.run.job import job_of

    for seeds in range(2, _MOST_SEEDS + 1):
        fewer = job_of(whole.name, f"{whole.profile}+", _with_seeds(whole, seeds))
        if fewer.pieces.keys() >= set(wanted):
            return _step(whole, fewer)
    return _step(whole, whole)


def _with_seeds(whole: Job, seeds: int) -> Any:  # noqa: ANN401 - its own Config
    """Return the settings with so few training seeds, as far as the experiment allows it."""
    config = whole.config
    for name in (field.name for field in fields(config)):
        value = getattr(config, name)
        if not name.endswith(_SEEDS) or type(value) is not int or value <= seeds:
            continue
        try:
            config = replace(config, **{name: seeds})
        except ValueError:  # this one needs several
            continue
    return config


def _in_order(steps: Mapping[str, Step]) -> list[Step]:
    """Put each step behind those that it stands on."""
    ordered: dict[str, Step] = {}

    def place(name: str) -> None:
        if name in ordered or name not in steps:
            return
        for below in sorted(_needed([steps[name]])):
            place(below)
        ordered[name] = steps[name]

    for name in steps:
        place(name)
    return list(ordered.values())


@contextmanager
def _from_nothing() -> Iterator[None]:
    """Let nothing that was published serve as an input, in workers neither."""
    before = os.environ.get("CPL_FRESH")
    os.environ["CPL_FRESH"] = "1"
    try:
        yield
    finally:
        if before is None:
            del os.environ["CPL_FRESH"]
        else:
            os.environ["CPL_FRESH"] = before


def _left(steps: Sequence[Step], done: Sequence[Mapping[str, Any]], elapsed_s: float) -> str:
    """Say how long it will still take, at the pace of what is done."""
    names = {entry["experiment"] for entry in done}
    expected = sum(step.expected_s or 0.0 for step in steps if step.experiment in names)
    open_s = sum(step.expected_s or 0.0 for step in steps if step.experiment not in names)
    unknown = sum(step.expected_s is None for step in steps if step.experiment not in names)
    pace = elapsed_s / expected if expected > 1 else 1 / (os.cpu_count() or 1)
    more = f", and {unknown} steps never timed" if unknown else ""
    return f": about {open_s * pace / 60:.0f} min left{more}"


def _entry(
    step: Step,
    result: Result | None,
    ended_s: float,
    missing: str | None,
    pieces: Pieces | None = None,
) -> dict[str, Any]:
    return {
        "experiment": step.experiment,
        "whole": step.whole,
        "shards": len(step.job.pieces),
        "processor_s": None if result is None else round(result.provenance.seconds, 2),
        "expected_s": None if step.expected_s is None else round(step.expected_s, 2),
        "ended_s": round(ended_s, 2),
        "rows": None if result is None else len(result.table),
        "content": None if result is None else result.provenance.content,
        "pieces": pieces and {"compared": pieces.compared, "differing": list(pieces.differing)},
        "missing": missing,
    }


def _publish(result: Result, root: Path) -> None:
    """Write a result into the reproduction's own layer, under the profile that rules read."""
    from cpl.experiments.run.publication import manifest_of
    from cpl.store import publish

    publish(result.table, replace(manifest_of(result), profile=_PUBLISHED), root=root)
