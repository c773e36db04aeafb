"""`cpl run`: execute a chapter with parameters of one's own."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping
from pathlib import Path

from cpl.cli import UsageError, project_root
from cpl.publish.chapters import Chapter, ChapterError, find_chapter
from cpl.settings.words import ParameterError, Value, settings

__all__ = ["register", "run"]

Chosen = dict[str, Value]


def register(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    parser = subparsers.add_parser(
        "run",
        help="execute a chapter, with parameters of your own if you like",
        description="Execute a chapter and write its notebook, its page and its provenance.",
        epilog="`cpl params CHAPTER` says what can be set.",
    )
    parser.add_argument("chapter", help="its name, as `cpl params` lists it")
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="NAME=VALUE",
        help="set a parameter; may be given for several",
    )
    parser.add_argument(
        "--sweep",
        action="append",
        default=[],
        metavar="NAME=V1,V2,...",
        help="run for each value; several sweeps make a grid, compared on one page",
    )
    parser.add_argument(
        "--out", type=Path, metavar="DIR", help="where to write (a new folder in _build/runs)"
    )


def run(args: argparse.Namespace) -> int:
    """Check what was typed; then, and only then, execute."""
    root = project_root()
    try:
        chapter = find_chapter(root, args.chapter)
        chosen = settings(chapter.parameters, args.set, chapter.name)
        grid = _grid(chapter, args.sweep, chosen)
    except ParameterError as error:
        raise UsageError(error) from error
    except ChapterError as error:
        print(f"cpl run: {error}", file=sys.stderr)
        return 1
    if args.out is not None and args.out.exists() and not args.out.is_dir():
        msg = f"--out must be a folder, got the file {args.out}"
        raise UsageError(msg)

    from cpl.publish.execute import ExecutionError
    from cpl.publish.render import SiteError
    from cpl.publish.run import new_folder, run_chapter

    folder = args.out or new_folder(root, chapter, chosen)
    if grid:
        return _sweep(chapter, grid, folder, root)
    print(f"executing {chapter.name} with {dict(chosen) or 'its own parameters'}", file=sys.stderr)
    try:
        run_chapter(chapter, chosen, folder, root)
    except (ChapterError, ExecutionError, SiteError) as error:
        print(f"cpl run: {error}", file=sys.stderr)
        if args.out is None:
            folder.rmdir()  # made for this run alone, and empty
        return 1
    for ending in ("html", "ipynb", "json"):
        print(folder / f"{chapter.name}.{ending}")
    return 0


def _grid(chapter: Chapter, sweeps: list[str], chosen: Mapping[str, Value]) -> list[Chosen]:
    """Return the points of the grid that was typed; none if there was no sweep."""
    if not sweeps:
        return []
    from cpl.publish.grid import axes, points

    return list(points(axes(chapter.parameters, sweeps, chapter.name), chosen))


def _sweep(chapter: Chapter, grid: list[Chosen], folder: Path, root: Path) -> int:
    from cpl.publish.execute import ExecutionError
    from cpl.publish.grid import run_grid

    def report(line: str) -> None:
        print(line, file=sys.stderr, flush=True)

    try:
        print(run_grid(chapter, grid, folder, root, report=report))
    except KeyboardInterrupt:
        print(f"stopped; add --out {folder} to go on from here", file=sys.stderr)
        return 130
    except ExecutionError as error:
        print(f"cpl run: every run failed\n{error}", file=sys.stderr)
        return 1
    return 0
