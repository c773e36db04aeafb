"""`cpl metadata`: describe what lies in `data/`, or check that the description is right."""

from __future__ import annotations

import argparse
import sys

from cpl.cli import project_root

__all__ = ["register", "run"]


def register(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    parser = subparsers.add_parser(
        "metadata",
        help="describe data/ anew: checksums, RO-Crate, Croissant",
        description="Exit status 1 if --check finds a file that is missing, changed or not listed.",
    )
    parser.add_argument("--check", action="store_true", help="compare only, write nothing")


def run(args: argparse.Namespace) -> int:
    """Write the three files, or compare."""
    project_root()  # what is published is in the repository
    from cpl.publish.metadata import differences, write

    if not args.check:
        for path in write():
            print(path)
        return 0
    found = differences()
    for line in found:
        print(line, file=sys.stderr)
    return 1 if found else 0
