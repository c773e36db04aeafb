"""`cpl course`: the editions of the course, its laboratories and slides (this is `make course`)."""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

from cpl.cli import UsageError, project_root
from cpl.publish.chapters import ChapterError

__all__ = ["register", "run"]

_PARTS = ("student", "instructor", "labs", "slides")


def register(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    parser = subparsers.add_parser(
        "course",
        help="build the student and the instructor edition, or grade a laboratory",
        description="Teach with the book: build its editions, list its exercises, grade answers.",
    )
    what = parser.add_subparsers(dest="what", metavar="WHAT", required=True)
    builds = what.add_parser("build", help="build the editions into _build/course")
    builds.add_argument("--only", choices=_PARTS, action="append", help="one part; may be repeated")
    builds.add_argument("--out", type=Path, metavar="DIR", help="where to write (_build/course)")
    builds.add_argument(
        "--jobs", type=int, default=2, metavar="N", help="chapters executed at a time (2)"
    )
    what.add_parser("list", help="list the exercises of the book")
    grades = what.add_parser(
        "grade",
        help="grade notebooks that were handed in, on this machine",
        description="Grade notebooks. They are programs and run with your rights.",
    )
    grades.add_argument("grader", type=Path, help="instructor/labs/LAB-grader.zip")
    grades.add_argument("notebook", type=Path, nargs="+", help="notebooks of that laboratory")


def run(args: argparse.Namespace) -> int:
    """Do what was asked."""
    if args.what == "list":
        return _list()
    return _build(args) if args.what == "build" else _grade(args)


def _build(args: argparse.Namespace) -> int:
    from cpl.course.editions import LeakError, build_course
    from cpl.course.labs import GraderError
    from cpl.publish.execute import ExecutionError
    from cpl.publish.render import SiteError

    root = project_root()
    begin = time.perf_counter()
    known = (ChapterError, ExecutionError, SiteError, GraderError, LeakError)
    try:
        made = build_course(
            root,
            args.out or root / "_build" / "course",
            parts=tuple(args.only or _PARTS),
            jobs=max(1, args.jobs),
            report=_say,
        )
    except known as error:
        print(f"cpl course: {error}", file=sys.stderr)
        return 1
    for path in made:
        print(path)
    _say(f"{time.perf_counter() - begin:.0f} s")
    return 0


def _list() -> int:
    from cpl.course.editions import pages_of
    from cpl.course.exercises import exercises_of

    for place, text in pages_of(project_root()).items():
        for one in exercises_of(text, Path(place).name):
            print(f"{one.label:24} {one.minutes:3} min  {one.kind:16}  {one.title}")
    return 0


def _grade(args: argparse.Namespace) -> int:
    missing = [path for path in (args.grader, *args.notebook) if not path.is_file()]
    if missing:
        msg = f"there is no file {missing[0]}"
        raise UsageError(msg)
    from cpl.course.labs import GraderError, grade

    failed = 0
    for notebook in args.notebook:
        try:
            scores = grade(args.grader, notebook)
        except GraderError as error:
            print(f"{notebook}: {error}", file=sys.stderr)
            failed = 1
            continue
        points = ", ".join(f"{name} {value:g}" for name, value in scores.points.items())
        print(f"{notebook}: {scores.total:g} of {sum(scores.possible.values()):g} ({points})")
    return failed


def _say(text: str) -> None:
    print(text, file=sys.stderr, flush=True)
