"""`cpl record`: write the walks of a simulated quadruped as logs, one file a run."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from cpl.cli import UsageError

__all__ = ["register", "run"]


def register(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    parser = subparsers.add_parser(
        "record",
        help="walk a simulated quadruped and write its logs",
        description="What `cpl compute quadruped_walks` (or `legged_walks`) has computed before is "
        "not computed again. The legged twin needs the extra `legged`.",
    )
    parser.add_argument("folder", type=Path, metavar="FOLDER", help="it must not exist yet")
    parser.add_argument("--profile", default="book", help="smoke, book (default) or paper")
    parser.add_argument(
        "--twin", choices=("kinematic", "legged"), default="kinematic", help="which of the twins"
    )
    parser.add_argument("--repeats", type=int, help="runs a cell, instead of the profile's")
    parser.add_argument("--workers", type=int, help="processes (default: one a core)")


def run(args: argparse.Namespace) -> int:
    """Compute what is missing, then write all files or none."""
    from cpl.experiments.quadruped.recording import beside, record
    from cpl.experiments.run.publication import job, run_job

    if args.folder.exists():
        msg = f"FOLDER must not exist yet, got {str(args.folder)!r}"
        raise UsageError(msg)
    name = {"kinematic": "quadruped_walks", "legged": "legged_walks"}[args.twin]
    changes = {} if args.repeats is None else {"repeats": args.repeats}
    try:
        plan = job(name, args.profile, changes)
    except ValueError as error:
        raise UsageError(error) from error
    try:
        result = run_job(plan, workers=args.workers, quiet=False)
        print(record(result, args.folder, beside(result)))
    except (ImportError, OSError) as error:
        print(f"cpl record: {error}", file=sys.stderr)
        return 1
    return 0
