"""`cpl record`: write the walks of the simulated quadruped as logs, one file a run."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from cpl.cli import UsageError

__all__ = ["register", "run"]


def register(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the command to the parser."""
    parser = subparsers.add_parser(
        "record",
        help="walk the simulated quadruped and write its logs",
        description="What `cpl compute quadruped_walks` has computed before is not computed again.",
    )
    parser.add_argument("folder", type=Path, metavar="FOLDER", help="it must not exist yet")
    parser.add_argument("--profile", default="book", help="smoke, book (default) or paper")


def run(args: argparse.Namespace) -> int:
    """Compute what is missing, then write all files or none."""
    from cpl.experiments._machinery import job, run_job
    from cpl.experiments._quadruped_logs import record

    if args.folder.exists():
        msg = f"FOLDER must not exist yet, got {str(args.folder)!r}"
        raise UsageError(msg)
    try:
        plan = job("quadruped_walks", args.profile)
    except ValueError as error:
        raise UsageError(error) from error
    try:
        print(record(run_job(plan, workers=None, quiet=False), args.folder))
    except OSError as error:
        print(f"cpl record: {error}", file=sys.stderr)
        return 1
    return 0
