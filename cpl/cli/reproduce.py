"""`cpl reproduce`: everything again from an empty store, and do the claims come out the same?"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cpl.cli import UsageError, project_root

if TYPE_CHECKING:
    from cpl.reproduce.reproduction import Step

__all__ = ["register", "run"]


def register(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    parser = subparsers.add_parser(
        "reproduce",
        help="recompute everything from an empty store and compare the claims",
        description="Every experiment at the paper's own sizes with one training seed, from "
        "nothing, compared with what is published. Stopped, the same command goes on where it was.",
        epilog="Exit status: 0 everything agrees, 1 some piece or claim does not.",
    )
    parser.add_argument("experiment", nargs="*", help="only these, with what they rest on")
    parser.add_argument("--profile", default="paper", help="smoke, book or paper (default)")
    parser.add_argument("--out", type=Path, metavar="DIR", help="default: _build/reproduce")
    parser.add_argument(
        "--without",
        action="append",
        default=[],
        metavar="NAME",
        help="leave an experiment out, and say so in the report",
    )
    parser.add_argument("--cluster", metavar="ADDRESS", help="dask scheduler, tcp://HOST:PORT")
    parser.add_argument("--workers", type=int, help="processes (default: one a core)")
    parser.add_argument("--dry-run", action="store_true", help="list what would run, and stop")
    parser.add_argument(
        "--publish",
        action="store_true",
        help="keep the report as data/reproduction/report.json, and call what agreed verified",
    )


def run(args: argparse.Namespace) -> int:
    """Compute, then print claim against claim."""
    root = project_root()
    from cpl.reproduce.reproduction import plan, reproduce, unpublished
    from cpl.store import atomic_write, data_path

    if args.workers is not None and args.workers < 1:
        msg = f"--workers must be positive, got {args.workers}"
        raise UsageError(msg)
    try:
        steps = plan(args.profile, args.experiment, without=args.without)
    except ValueError as error:
        raise UsageError(error) from error
    if not steps:
        raise UsageError("nothing is left to compute")
    if args.dry_run:
        return _expected(steps)
    chosen = dict.fromkeys(args.without, "by choice")
    nothing = {} if args.experiment else dict.fromkeys(unpublished(), "nothing published")
    folder = args.out or root / "_build" / "reproduce"

    def report(line: str) -> None:
        print(line, file=sys.stderr, flush=True)

    try:
        outcome = reproduce(
            steps,
            folder,
            left_out={**nothing, **chosen},
            workers=args.workers,
            cluster=args.cluster,
            record=args.publish,
            report=report,
        )
    except KeyboardInterrupt:
        print("stopped; the same command goes on from here", file=sys.stderr)
        return 130
    if args.publish:
        content = (folder / "report.json").read_bytes()
        atomic_write(data_path("reproduction", "report.json"), content)
    return _print(outcome)


def _expected(steps: Sequence[Step]) -> int:
    """Say what would run and how long it should take."""
    import os

    for step in steps:
        expected = "never timed" if step.expected_s is None else f"{step.expected_s:.1f} s"
        extent = "as published" if step.whole else "one training seed"
        print(f"{step.experiment}: {len(step.job.pieces)} pieces, {extent}, {expected}")
    known = sum(step.expected_s or 0.0 for step in steps)
    unknown = sum(step.expected_s is None for step in steps)
    cores = os.cpu_count() or 1
    more = f", and {unknown} experiments never timed" if unknown else ""
    print(f"{known / 60:.1f} min of work, {known / cores / 60:.1f} min on {cores} cores{more}")
    return 0


def _print(outcome: Mapping[str, Any]) -> int:
    """Print pieces, then claim against claim; return the exit status."""
    differing = 0
    for step in outcome["steps"]:
        if step["missing"]:
            print(f"left out: {step['experiment']} ({step['missing']})")
            continue
        pieces = step["pieces"]
        differing += len(pieces["differing"])
        same = pieces["compared"] - len(pieces["differing"])
        print(f"{step['experiment']}: {same} of {pieces['compared']} published pieces the same")
        for line in pieces["differing"]:
            print(f"  {line}")
    marks = {True: "agrees", False: "DIFFERS", None: "one seed"}
    for claim in outcome["claims"]:
        published, again = _number(claim["published"]), _number(claim["again"])
        print(f"{claim['row']:2d}  {marks[claim['agrees']]:10s}{published}")
        print(f"{'':14s}{again} {claim['reason']}".rstrip())
    against = [claim["row"] for claim in outcome["claims"] if claim["agrees"] is False]
    minutes = outcome["wall_s"] / 60
    took, planned, expected = (outcome[f"{n}_s"] for n in ("wall", "scheduled", "predicted"))
    print(
        f"{took:.0f} s; the schedule of these pieces takes {planned:.0f} s, and took "
        f"{expected:.0f} s by what they were noted to take",
        file=sys.stderr,
    )
    print(
        f"{differing} pieces differ, {len(against)} of {len(outcome['claims'])} claims differ; "
        f"{minutes:.1f} min",
        file=sys.stderr,
    )
    return 1 if differing or against else 0


def _number(number: Sequence[float | None]) -> str:
    value, low, high = number
    if value is None:
        return "-"
    interval = "" if low is None or high is None else f" [{low:.4g}, {high:.4g}]"
    return f"{value:.4g}{interval}"
