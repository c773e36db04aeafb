"""Everything again from nothing: each experiment into an empty store, then claim against claim.

What was published is not read while computing: inputs are recomputed as well. The results go into a
layer of their own, and the ledger's rules are applied to that layer as they are to the published
one. So the report says for every claim whether somebody who starts today finds the same.
"""

from __future__ import annotations

import json
import os
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cpl.store import atomic_write, machine, source_commit, today

if TYPE_CHECKING:
    from cpl.claims._ledger import Row
    from cpl.experiments._job import Job
    from cpl.experiments._result import Result

__all__ = ["Claim", "Step", "plan", "reproduce"]

_PUBLISHED = "paper"


@dataclass(frozen=True, kw_only=True)
class Step:
    """One experiment of a reproduction.

    Attributes:
        experiment: Its name.
        job: What is run.
        expected_s: Processor seconds it should take, from those of the published result; None if
            nothing was published.
    """

    experiment: str
    job: Job
    expected_s: float | None


@dataclass(frozen=True, kw_only=True)
class Claim:
    """One claim as published and as found again.

    Attributes:
        row: Its number in the ledger.
        claim: What the paper claims.
        published: Our published number with its interval, as far as there are.
        again: The same from this reproduction.
        verdict_published: The published verdict.
        verdict_again: The verdict from this reproduction.
        agrees: Whether the intervals meet; the numbers themselves where there is no interval.
    """

    row: int
    claim: str
    published: tuple[float | None, float | None, float | None]
    again: tuple[float | None, float | None, float | None]
    verdict_published: str
    verdict_again: str
    agrees: bool


def plan(profile: str = _PUBLISHED, only: Sequence[str] = ()) -> list[Step]:
    """List what a reproduction runs: every experiment, with one training seed.

    Args:
        profile: Whose sizes; settings that only count seeds (`EXTENT`) are set to 1.
        only: Names of experiments; all unless given.

    Raises:
        ValueError: If there is no such experiment or profile.
    """
    from cpl.experiments import names
    from cpl.experiments._job import experiment, job, job_of

    steps: list[Step] = []
    for name in only or names():
        offered = tuple(experiment(name).PROFILES)
        if not only and profile not in offered:
            continue  # it makes material for a page, no evidence
        whole = job(name, profile)
        task = job_of(name, f"{profile}+", _one_seed(whole))
        steps.append(Step(experiment=name, job=task, expected_s=_expected(task)))
    return steps


def reproduce(
    steps: Sequence[Step],
    folder: Path,
    *,
    workers: int | None = None,
    report: Callable[[str], None] = print,
) -> dict[str, Any]:
    """Compute everything into a folder, compare the claims, and write `report.json` there.

    Stopped and called again with the same folder it goes on where it was.

    Args:
        steps: From `plan`.
        folder: Holds the store, the results and the report; empty at first.
        workers: Processes; one a core unless given.
        report: Told of each step, with an estimate of the time left.

    Returns:
        The report: the machine, the steps with their seconds, the claims.
    """
    from cpl.claims import ledger
    from cpl.experiments._machinery import run_job
    from cpl.store import WorkStore

    store, results = WorkStore(folder / "store"), folder / "results"
    begun, done = time.monotonic(), list[dict[str, Any]]()
    with _from_nothing():
        for number, step in enumerate(steps, 1):
            left = _left(steps, number - 1, done, time.monotonic() - begun)
            report(f"[{number}/{len(steps)}] {step.experiment}{left}")
            start = time.monotonic()
            try:
                result = run_job(step.job, store=store, workers=workers, quiet=False)
            except ModuleNotFoundError as error:  # it needs an extra that is not installed
                done.append(_told(step, None, time.monotonic() - start, str(error)))
                continue
            _publish(result, results)
            done.append(_told(step, result, time.monotonic() - start, None))
    claims = _claims({r.row: r for r in ledger()}, ledger(root=results))
    told = {
        "made": today(),
        "commit": source_commit(),
        "machine": machine(),
        "wall_s": round(time.monotonic() - begun, 1),
        "steps": done,
        "claims": [asdict(claim) for claim in claims],
    }
    atomic_write(folder / "report.json", json.dumps(told, indent=1, sort_keys=True) + "\n")
    return told


def _one_seed(whole: Job) -> Any:  # noqa: ANN401 - its own Config
    """Return the settings with a single seed, as far as the experiment allows it."""
    config = whole.config
    for name in {field.name for field in fields(config)} & set(getattr(whole.module, "EXTENT", ())):
        if type(getattr(config, name)) is not int:  # a list of seeds or parts is no count
            continue
        try:
            config = replace(config, **{name: 1})
        except ValueError:  # this one needs several, as folds of a cross-validation do
            continue
    return config


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


def _expected(task: Job) -> float | None:
    """Return the published processor seconds of these shards, were they all alike."""
    from cpl.store import read_manifest

    try:
        manifest = read_manifest(task.name, _PUBLISHED)
    except FileNotFoundError:
        return None
    return manifest.seconds * len(task.pieces) / len(manifest.shards)


def _left(steps: Sequence[Step], at: int, done: Sequence[dict[str, Any]], elapsed_s: float) -> str:
    """Say how long it will still take, at the pace of what is done."""
    expected = sum(step.expected_s or 0.0 for step in steps[:at])
    ahead = sum(step.expected_s or 0.0 for step in steps[at:])
    unknown = sum(step.expected_s is None for step in steps[at:])
    cores = os.cpu_count() or 1
    pace = elapsed_s / expected if done and expected > 1 else 1 / cores
    minutes = ahead * pace / 60
    more = f", and {unknown} steps never timed" if unknown else ""
    return f": about {minutes:.0f} min left{more}"


def _told(step: Step, result: Result | None, wall_s: float, missing: str | None) -> dict[str, Any]:
    return {
        "experiment": step.experiment,
        "shards": len(step.job.pieces),
        "processor_s": None if result is None else round(result.provenance.seconds, 2),
        "expected_s": None if step.expected_s is None else round(step.expected_s, 2),
        "wall_s": round(wall_s, 2),
        "rows": None if result is None else len(result.table),
        "content": None if result is None else result.provenance.content,
        "missing": missing,
    }


def _publish(result: Result, root: Path) -> None:
    """Write a result into the reproduction's own layer, under the profile that rules read."""
    from cpl.experiments._machinery import manifest_of
    from cpl.store import publish

    publish(result.table, replace(manifest_of(result), profile=_PUBLISHED), root=root)


def _claims(published: dict[int, Row], again: Sequence[Row]) -> list[Claim]:
    """Compare the rows that this reproduction could compute."""
    return [
        Claim(
            row=row.row,
            claim=row.claim,
            published=(published[row.row].value, published[row.row].low, published[row.row].high),
            again=(row.value, row.low, row.high),
            verdict_published=published[row.row].verdict,
            verdict_again=row.verdict,
            agrees=_agree(published[row.row], row),
        )
        for row in again
        if row.computed_from
    ]


def _agree(one: Row, other: Row) -> bool:
    if one.value is None or other.value is None:
        return one.verdict == other.verdict
    low, high = _ends(one)
    other_low, other_high = _ends(other)
    slack = 1e-6 * max(abs(one.value), abs(other.value))
    return other_low <= high + slack and low <= other_high + slack


def _ends(row: Row) -> tuple[float, float]:
    value = row.value if row.value is not None else 0.0
    return (value if row.low is None else row.low, value if row.high is None else row.high)
