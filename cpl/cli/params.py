"""`cpl params`: which chapters there are, and what can be set in them."""

from __future__ import annotations

import argparse
import json
from dataclasses import asdict

from cpl.cli import UsageError, project_root
from cpl.publish.chapters import find_chapter, find_chapters
from cpl.settings.words import Parameter, ParameterError

__all__ = ["register", "run"]


def register(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    parser = subparsers.add_parser("params", help="list the chapters, or a chapter's parameters")
    parser.add_argument("chapter", nargs="?", help="its name; without it, all chapters are listed")
    parser.add_argument("--json", action="store_true", help="write JSON, for programs")


def run(args: argparse.Namespace) -> int:
    """Print chapters or parameters."""
    root = project_root()
    if args.chapter is None:
        names = list(find_chapters(root))
        print(json.dumps(names, indent=2) if args.json else "\n".join(names))
        return 0
    try:
        parameters = find_chapter(root, args.chapter).parameters
    except ParameterError as error:
        raise UsageError(error) from error
    if args.json:
        print(json.dumps([_plain(parameter) for parameter in parameters], indent=2))
    else:
        for parameter in parameters:
            unit = "" if parameter.unit == "-" else f" [{parameter.unit}]"
            print(f"{parameter.name} = {parameter.default!r}{unit}")
            print(f"    {parameter.meaning}\n    {parameter.allowed()}")
    return 0


def _plain(parameter: Parameter) -> dict[str, object]:
    range_ = None if parameter.range is None else str(parameter.range)
    return {**asdict(parameter), "range": range_}
