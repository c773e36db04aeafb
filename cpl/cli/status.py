"""`cpl status`: what is computed, what is published, what is stale and why."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from typing import Any

__all__ = ["register", "run"]


def register(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the command to the parser."""
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
    from cpl.experiments.run.publication import experiment

    if args.record:
        from cpl.experiments.run.costs import record

        print(f"noted in {record()}")
        return 0
    try:
        chosen = [args.experiment] if args.experiment else list(names())
        for name in chosen:
            question = (experiment(name).__doc__ or "").partition("\n")[0]
            print(f"{name}: {question}")
            for line in (*_computed(name), *_published(name)):
                print(f"  {line}")
    except ValueError as error:
        raise UsageError(error) from error
    return 0


def _computed(name: str) -> list[str]:
    """Say for each profile what today's code has computed, and why older results are not used."""
    from cpl.experiments.run.inputs import without_extent
    from cpl.experiments.run.publication import experiment, job
    from cpl.store import WorkStore, plain

    store, lines = WorkStore(), list[str]()
    kept = store.descriptions(name)
    for profile in experiment(name).PROFILES:
        task = job(name, profile)
        asked = without_extent(task.module, plain(task.config))
        ours = {key: told for key, told in kept.items() if told.get("parameters") == asked}
        today = [key for key, told in ours.items() if not _changed(told, task.origin)]
        there = {shard for key in today for shard in store.shards(name, key)} & task.pieces.keys()
        if there:
            lines.append(f"{profile}: {len(there)} of {len(task.pieces)} shards computed")
        elif ours and not today:
            changed = ", ".join(_changed(list(ours.values())[-1], task.origin))
            lines.append(f"{profile}: computed, but stale: {changed} changed")
    return lines or ["nothing computed here"]


def _changed(told: Mapping[str, Any], origin: str) -> list[str]:
    """Name the modules and packages that differ from those of an earlier computation."""
    from cpl.store import module_digests, versions_below

    now = module_digests(origin) | versions_below(origin)
    before = {**told.get("modules", {}), **told.get("versions", {})}
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
        told = published(name, manifest.profile).provenance
        checked = f"verified {told.verified}" if told.verified else "UNVERIFIED"
        lines.append(f"{told.profile}: published, made {told.made}, {checked}")
        lines += [f"  {reason}" for reason in told.stale]
    return lines or ["nothing published"]
