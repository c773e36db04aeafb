"""`cpl claims`: which of the paper's claims hold, computed from the published results."""

from __future__ import annotations

import argparse
import json
import sys
from dataclasses import asdict
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from cpl.claims.row import Row

from cpl.cli import project_root

__all__ = ["register", "run"]


def register(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    parser = subparsers.add_parser(
        "claims",
        help="show the paper's claims with what was found",
        description="Exit status 1 if a verdict differs from the committed one.",
    )
    parser.add_argument("--json", action="store_true", help="one object a claim, for programs")
    parser.add_argument(
        "--accept", action="store_true", help="commit to the verdicts as they are computed now"
    )
    parser.add_argument(
        "--fix",
        action="store_true",
        help="fix the rules as they are now: what is computed later names them",
    )


def run(args: argparse.Namespace) -> int:
    """Print the ledger, then what changed."""
    project_root()  # what is published is in the repository
    from cpl.claims import accept, changes, fix, ledger, own
    from cpl.store import DamagedResultError

    try:
        rows = [*ledger(), *own()]
        if args.fix:
            fix()
        if args.accept:
            accept()
        changed = changes()
    except DamagedResultError as error:
        print(f"cpl claims: {error}", file=sys.stderr)
        return 1
    if args.json:
        objects = ",\n".join(json.dumps(asdict(row), allow_nan=False) for row in rows)
        print(f"[\n{objects}\n]")
    else:
        print("\n".join(_line(row) for row in rows))
    for number, (committed, now) in changed.items():
        print(f"claim {number} changed: {committed} -> {now}", file=sys.stderr)
    return 1 if changed else 0


def _line(row: Row) -> str:
    found = "" if row.value is None else f"  [{row.value:.4g}]"
    flags = [flag for flag in row.flags if flag != row.verdict]
    marks = f"  ({', '.join(flags)})" if flags else ""
    twin = f"\n{'':4s}in the twin: {row.in_the_twin}" if row.in_the_twin else ""
    other = f"\n{'':4s}on other machines: {row.on_other_machines}" if row.on_other_machines else ""
    return f"{row.row:2d}  {row.verdict:36s}{row.claim}{found}{marks}{twin}{other}"
