"""Build the course: an edition to hand out, an edition to teach from, laboratories and slides.

    _build/course/
        student/     site, labs and slides without any solution, and cpl to install
        instructor/  site with solutions, labs with answers and graders, slides with notes

The student edition is rendered from pages that have been stripped before; `leaks` looks through
everything that came out of it.
"""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

from cpl.course.grading import laboratories
from cpl.course.labs import assign
from cpl.course.leaks import leaks
from cpl.course.links import targets_of
from cpl.course.slides import Harvest, build_slides, harvest
from cpl.course.student import student_notebook, student_text
from cpl.publish.chapters import Chapter, find_chapters, find_pages
from cpl.publish.render import SiteError, render
from cpl.publish.run import Report, execute_all
from cpl.publish.site import build, write_entrance
from cpl.publish.stage import remove, write_stage
from cpl.store import atomic_write

__all__ = ["PARTS", "LeakError", "build_course", "pages_of", "student_site", "write_labs"]

PARTS = ("student", "instructor", "labs", "slides")

Executed = Mapping[str, tuple[str, Mapping[str, Any]]]


class LeakError(RuntimeError):
    """A solution was found in the student edition; the message says where."""


def build_course(
    root: Path,
    output: Path,
    *,
    parts: tuple[str, ...] = PARTS,
    jobs: int = 2,
    report: Report = print,
) -> list[Path]:
    """Build the parts of the course that are asked for.

    Args:
        root: The project's folder.
        output: Where the editions go; what is built there is replaced.
        parts: Some of `PARTS`. The two sites are `student` and `instructor`; `labs` and `slides`
            go into both editions.
        jobs: How many chapters run at a time.
        report: Told what is going on.

    Returns:
        The pages and folders to begin with.

    Raises:
        ExecutionError: If a chapter fails.
        SiteError: If a renderer fails or warns.
        GraderError: If otter-grader fails.
        LeakError: If a solution is found in the student edition.
        ValueError: If a part is unknown.
    """
    if unknown := set(parts) - set(PARTS):
        msg = f"parts must be some of {', '.join(PARTS)}, got {', '.join(sorted(unknown))}"
        raise ValueError(msg)
    student, instructor = output / "student", output / "instructor"
    made: list[Path] = []
    chapters = _chapters(root)
    if "instructor" in parts:
        site = build(root, jobs=jobs, report=report).parent
        _replace(instructor / "site", lambda to: shutil.copytree(site, to))
        made.append(instructor / "site" / "index.html")
    executed: Executed = {}
    if {"student", "slides"} & set(parts):
        executed = execute_all(list(chapters.values()), root, jobs=jobs, report=report)
    if "student" in parts:
        report("rendering the student edition")
        made.append(student_site(root, chapters, executed, student / "site"))
        _hand_out(root, student)
    if "labs" in parts:
        report("making notebooks and graders of the laboratories")
        made += write_labs(root, chapters, student / "labs", instructor / "labs")
    if "slides" in parts:
        report("making the slides")
        shown = {name: harvest(executed[name][0], c.title) for name, c in chapters.items()}
        made += list(_slides(root, shown, student, instructor))
    if student.exists():
        report("looking for solutions in the student edition")
        if found := leaks(student, pages_of(root)):
            raise LeakError("the student edition has solutions\n\n" + "\n".join(found))
    return made


def student_site(
    root: Path, chapters: Mapping[str, Chapter], executed: Executed, output: Path
) -> Path:
    """Render the site without solutions.

    Args:
        root: The project's folder.
        chapters: The chapters of the site by name.
        executed: Notebook and provenance of each.
        output: The folder for the site; what is there is replaced once the new one is whole.

    Returns:
        Its front page.

    Raises:
        SiteError: If the renderer fails or warns.
    """
    stage = root / "_build" / "stage-student"
    remove(stage)
    write_stage(stage, root, chapters, executed)
    for path in sorted((stage / "book").rglob("*")):
        if path.suffix == ".ipynb":
            kept = student_notebook(json.loads(path.read_text(encoding="utf-8")))
            atomic_write(path, json.dumps(kept, indent=1, ensure_ascii=False) + "\n")
        elif path.suffix == ".md":
            atomic_write(path, student_text(path.read_text(encoding="utf-8")))
    fresh = render(stage, root / "_build" / "render-student")
    write_entrance(fresh, root)
    _replace(output, lambda to: shutil.move(fresh, to))
    return output / "index.html"


def write_labs(
    root: Path, chapters: Mapping[str, Chapter], student: Path, instructor: Path
) -> list[Path]:
    """Write the notebooks of all laboratories, and the graders.

    Args:
        root: The project's folder.
        chapters: The chapters by name.
        student: The folder for the notebooks to work in.
        instructor: The folder for all three files of each.

    Returns:
        The two folders.

    Raises:
        GraderError: If otter-grader fails.
    """
    targets = targets_of(pages_of(root))
    for folder in (student, instructor):
        remove(folder)
        folder.mkdir(parents=True)
    for chapter in laboratories(chapters).values():
        made = assign(chapter, targets, instructor)
        shutil.copyfile(made.student, student / made.student.name)
    return [student, instructor]


def pages_of(root: Path) -> dict[str, str]:
    """Return the text of every page of the book, by its place without ending."""
    return {
        path.relative_to(root).with_suffix("").as_posix(): path.read_text(encoding="utf-8")
        for path in find_pages(root)
    }


def _chapters(root: Path) -> dict[str, Chapter]:
    pages = set(find_pages(root))
    return {name: one for name, one in find_chapters(root).items() if one.path in pages}


def _slides(
    root: Path, shown: Mapping[str, Harvest], student: Path, instructor: Path
) -> Iterator[Path]:
    for edition, notes in ((student, False), (instructor, True)):
        work = root / "_build" / "slides"
        fresh = root / "_build" / "render-slides"
        build_slides(root, shown, work, fresh, notes=notes)
        _replace(edition / "slides", lambda to, fresh=fresh: shutil.move(fresh, to))
        yield edition / "slides" / "index.html"


def _hand_out(root: Path, student: Path) -> None:
    """Lay what has to be installed beside the site: cpl as a wheel, and the pinned versions."""
    for old in student.glob("cpl-*.whl"):
        old.unlink()
    with tempfile.TemporaryDirectory(prefix="cpl-wheel-") as scratch:  # setuptools litters
        shutil.copytree(root / "cpl", Path(scratch) / "cpl", ignore=_IGNORED)
        for name in ("pyproject.toml", "README.md", "LICENSE"):
            shutil.copyfile(root / name, Path(scratch) / name)
        words = ["wheel", "--no-deps", "--no-build-isolation", "-q", "-w", str(student), scratch]
        done = subprocess.run(
            [sys.executable, "-m", "pip", "--disable-pip-version-check", *words],
            capture_output=True,
            encoding="utf-8",
            check=False,
        )
    if done.returncode != 0:
        msg = "cpl could not be made into a wheel\n\n" + done.stderr.strip()
        raise SiteError(msg)
    shutil.copyfile(root / "constraints.txt", student / "constraints.txt")
    (wheel,) = student.glob("cpl-*.whl")
    atomic_write(student / "README.md", _README.format(wheel=wheel.name))


def _replace(target: Path, make: Callable[[Path], object]) -> None:
    remove(target)
    target.parent.mkdir(parents=True, exist_ok=True)
    make(target)


_IGNORED = shutil.ignore_patterns("__pycache__")
_README = """# The course on conformal policy learning: student edition

Open `site/index.html` to read; nothing has to be installed for that, and no network is needed.

To work on the laboratories, with Python 3.11 or later:

    python3 -m venv .venv
    .venv/bin/pip install -c constraints.txt {wheel} otter-grader jupyterlab
    .venv/bin/jupyter lab labs

(On Windows it is `.venv\\Scripts\\pip`, and so on.) Each notebook in `labs/` has
stubs to fill and checks to run; hand in the notebook.
"""
