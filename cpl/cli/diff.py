"""`cpl diff`: which numbers moved between two runs of a chapter."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import NamedTuple

from cpl.cli import UsageError, project_root

__all__ = ["register", "run"]


class _Run(NamedTuple):
    chapter: str
    parameters: dict[str, object]
    numbers: dict[str, str]
    where: str


def register(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    parser = subparsers.add_parser(
        "diff",
        help="show which numbers moved between two runs of a chapter",
        description="Compare the numbers that two runs of a chapter quote. A number has moved when "
        "it differs by more than one unit of its last printed digit.",
        epilog="Exit status: 0 nothing moved, 1 something did.",
    )
    parser.add_argument("before", metavar="RUN_A", help="folder of a run, or `published`")
    parser.add_argument("after", metavar="RUN_B", help="folder of a run, or `published`")
    parser.add_argument(
        "--rtol", type=float, default=0.0, metavar="R", help="allow this relative change as well"
    )


def run(args: argparse.Namespace) -> int:
    """Print the parameters and the numbers that differ."""
    project_root()  # a chapter lies in the repository
    from cpl.publish.numbers import compare

    if args.before == args.after == "published":
        msg = "one of the two must be the folder of a run"
        raise UsageError(msg)
    try:
        known = _run(Path(args.after if args.before == "published" else args.before))
        first, second = (
            _published(known.chapter) if word == "published" else _run(Path(word))
            for word in (args.before, args.after)
        )
    except (OSError, ValueError, KeyError) as error:
        raise UsageError(error) from error
    if first.chapter != second.chapter:
        msg = f"the runs must be of one chapter, got {first.chapter} and {second.chapter}"
        raise UsageError(msg)
    try:
        moved = compare(first.numbers, second.numbers, rtol=args.rtol)
    except ValueError as error:
        raise UsageError(error) from error
    for name in sorted(first.parameters.keys() | second.parameters.keys()):
        old, new = first.parameters.get(name), second.parameters.get(name)
        if old != new:
            print(f"parameter {name}: {old} -> {new}")
    for entry in moved:
        change = "" if entry.change is None else f"  ({entry.change:.2%})"
        mark = "MOVED " if entry.beyond else "within"
        print(
            f"{mark} {entry.name}: {entry.before or 'absent'} -> {entry.after or 'absent'}{change}"
        )
    beyond = sum(entry.beyond for entry in moved)
    count = len(first.numbers.keys() | second.numbers.keys())
    print(
        f"{first.chapter}: {beyond} of {count} numbers moved beyond their tolerance",
        file=sys.stderr,
    )
    return 1 if beyond else 0


def _run(folder: Path) -> _Run:
    """Read a run from its folder, checked against its own digest."""
    from cpl.publish import cache
    from cpl.publish.numbers import quoted

    records = sorted(folder.glob("*.json")) if folder.is_dir() else []
    records = [path for path in records if path.with_suffix(".ipynb").is_file()]
    if len(records) != 1:
        msg = (
            f"{folder} must be the folder of one run of a chapter, found {len(records)} runs in it"
        )
        raise ValueError(msg)
    found = cache.load(folder, records[0].stem, _key(records[0]))
    if found is None:
        msg = f"the run in {folder} was damaged: its files do not agree with their digests"
        raise ValueError(msg)
    notebook, record = found
    return _Run(record["chapter"], record["parameters"], quoted(notebook), str(folder))


def _key(record: Path) -> str:
    import json

    return str(json.loads(record.read_text(encoding="utf-8"))["key"])


def _published(chapter: str) -> _Run:
    """Read the chapter as it stands in the book that was built here last."""
    import shutil
    import tempfile

    kept = project_root() / "_build" / "executed"
    if not (kept / f"{chapter}.ipynb").is_file():
        msg = f"the book has no executed chapter {chapter!r} yet; make it with: cpl build"
        raise ValueError(msg)
    with tempfile.TemporaryDirectory(prefix="cpl-diff-") as folder:
        for ending in ("ipynb", "json"):
            shutil.copy(kept / f"{chapter}.{ending}", folder)
        return _run(Path(folder))
