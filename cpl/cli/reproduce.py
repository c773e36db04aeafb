"""`cpl reproduce`: everything again from an empty store, and do the claims come out the same?"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from cpl.cli import UsageError, project_root

__all__ = ["register", "run"]


def register(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the command to the parser."""
    parser = subparsers.add_parser(
        "reproduce",
        help="recompute everything from an empty store and compare the claims",
        description="Every experiment at the paper's own sizes with one training seed, from "
        "nothing. Stopped, the same command goes on where it was.",
        epilog="Exit status: 0 every claim agrees, 1 some do not.",
    )
    parser.add_argument("experiment", nargs="*", help="only these, with what they rest on")
    parser.add_argument("--profile", default="paper", help="smoke, book or paper (default)")
    parser.add_argument("--out", type=Path, metavar="DIR", help="default: _build/reproduce")
    parser.add_argument("--workers", type=int, help="processes (default: one a core)")
    parser.add_argument("--dry-run", action="store_true", help="list what would run, and stop")
    parser.add_argument(
        "--publish", action="store_true", help="keep the report as data/reproduction/report.json"
    )


def run(args: argparse.Namespace) -> int:
    """Compute, then print claim against claim."""
    from cpl.publish.reproduction import plan, reproduce
    from cpl.store import atomic_write, data_path

    if args.workers is not None and args.workers < 1:
        msg = f"--workers must be positive, got {args.workers}"
        raise UsageError(msg)
    try:
        steps = plan(args.profile, args.experiment)
    except ValueError as error:
        raise UsageError(error) from error
    if args.dry_run:
        for step in steps:
            expected = "never timed" if step.expected_s is None else f"{step.expected_s:.1f} s"
            print(f"{step.experiment}: {len(step.job.pieces)} shards, {expected}")
        return 0
    folder = args.out or project_root() / "_build" / "reproduce"

    def report(line: str) -> None:
        print(line, file=sys.stderr, flush=True)

    try:
        told = reproduce(steps, folder, workers=args.workers, report=report)
    except KeyboardInterrupt:
        print("stopped; the same command goes on from here", file=sys.stderr)
        return 130
    if args.publish:
        content = (folder / "report.json").read_bytes()
        atomic_write(data_path("reproduction", "report.json"), content)
    return _print(told)


def _print(told: Mapping[str, Any]) -> int:
    """Print claim against claim; return the exit status."""
    for step in told["steps"]:
        if step["missing"]:
            print(f"left out: {step['experiment']} ({step['missing']})")
    for claim in told["claims"]:
        mark = "agrees" if claim["agrees"] else "DIFFERS"
        published, again = _number(claim["published"]), _number(claim["again"])
        print(f"{claim['row']:2d}  {mark:8s}{published} {claim['verdict_published']}")
        print(f"{'':12s}{again} {claim['verdict_again']}")
    differ = sum(not claim["agrees"] for claim in told["claims"])
    minutes = told["wall_s"] / 60
    print(f"{len(told['claims'])} claims, {differ} differ; {minutes:.1f} min", file=sys.stderr)
    return 1 if differ else 0


def _number(told: tuple[float | None, float | None, float | None]) -> str:
    value, low, high = told
    if value is None:
        return "-"
    interval = "" if low is None or high is None else f" [{low:.4g}, {high:.4g}]"
    return f"{value:.4g}{interval}"
