"""`cpl build`: the book's pages, executing only what changed (this is `make book`)."""

from __future__ import annotations

import argparse
import sys
import time

from cpl.cli import project_root
from cpl.publish.chapters import ChapterError

__all__ = ["register", "run"]


def register(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    parser = subparsers.add_parser("build", help="build the book into _build/html")
    parser.add_argument(
        "--jobs", type=int, default=2, metavar="N", help="chapters executed at a time (2)"
    )
    parser.add_argument("--pdf", action="store_true", help="print it, too, into _build/pdf")


def run(args: argparse.Namespace) -> int:
    """Build the book and say where it is."""
    from cpl.publish.execute import ExecutionError
    from cpl.publish.pdf import PdfError, print_book
    from cpl.publish.render import SiteError
    from cpl.publish.site import build

    begin = time.perf_counter()
    try:
        page = build(project_root(), jobs=max(1, args.jobs), report=_say)
        printed = print_book(project_root()) if args.pdf else []
    except (ChapterError, ExecutionError, SiteError, PdfError) as error:
        print(f"cpl build: {error}", file=sys.stderr)
        return 1
    for path in printed:
        print(path)
    print(f"{page} ({time.perf_counter() - begin:.0f} s)")
    return 0


def _say(text: str) -> None:
    print(text, file=sys.stderr, flush=True)
