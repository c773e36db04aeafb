"""`cpl status`: what is computed, what is published, what is stale and why."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from typing import Any

__all__ = ["register", "run"]


def register(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    parser = subparsers.add_parser("status", help="show what is computed, published, stale and why")
    parser.add_argument("experiment", nargs="?", help="its name (default: all)")
    parser.add_argument(
        "--record",
        action="store_true",
        help="note in data/scale how long each piece took that is in the store",
    )


def run(args: argparse.Namespace) -> int:
    """Print one block an experiment."""
    from cpl.cli import UsageError
    from cpl.experiments import names
    from cpl.experiments.run.job import question
    from cpl.optional import explain

    if args.record:
        from cpl.experiments.run.costs import record

        print(f"noted in {record()}")
        return 0
    try:
        chosen = [args.experiment] if args.experiment else list(names())
        for name in chosen:
            try:
                asked, lines = question(name), (*_computed(name), *_published(name))
            except ImportError as error:  # one experiment lacks a library, the others need not
                asked, lines = "cannot be looked at here", (explain(error) or str(error),)
            print(f"{name}: {asked}")
            for line in lines:
                print(f"  {line}")
    except ValueError as error:
        raise UsageError(error) from error
    return 0


def _computed(name: str) -> list[str]:
    """Say for each profile what today's code has computed, and why older results are not used."""
    from cpl.experiments.run.job import experiment, job
    from cpl.store import WorkStore

    store, lines = WorkStore(), list[str]()
    kept = store.descriptions(name)
    for profile in experiment(name).profiles:
        task = job(name, profile)
        ours = {k: note for k, note in kept.items() if note.get("parameters") == task.parameters}
        today = [key for key, note in ours.items() if not _changed(note, task.origin)]
        there = {shard for key in today for shard in store.shards(name, key)} & task.pieces.keys()
        if there:
            lines.append(f"{profile}: {len(there)} of {len(task.pieces)} shards computed")
        elif ours and not today:
            changed = ", ".join(_changed(list(ours.values())[-1], task.origin))
            lines.append(f"{profile}: computed, but stale: {changed} changed")
    return lines or ["nothing computed here"]


def _changed(record: Mapping[str, Any], origin: str) -> list[str]:
    """Name the modules and packages that differ from those of an earlier computation."""
    from cpl.store import module_digests, versions_below

    now = module_digests(origin) | versions_below(origin)
    before = {**record.get("modules", {}), **record.get("versions", {})}
    names = sorted(before.keys() | now.keys())
    return [name for name in names if before.get(name) != now.get(name)]


def _published(name: str) -> list[str]:
    """Say for each profile whether what is published is verified, and if not, why."""
    from cpl.experiments.run.publication import published
    from cpl.store import manifests

    lines: list[str] = []
    for manifest in manifests():
        if manifest.experiment != name:
            continue
        provenance = published(name, manifest.profile).provenance
        checked = f"verified {provenance.verified}" if provenance.verified else "UNVERIFIED"
        lines.append(f"{provenance.profile}: published, made {provenance.made}, {checked}")
        lines += [f"  {reason}" for reason in provenance.stale]
    return lines or ["nothing published"]
