"""Make the notebooks of a laboratory: one to work in, one with answers, one grader.

chapter -> otter's master notebook -> `otter assign` -> student notebook, reference, autograder

The student's notebook is plain Markdown and needs only `cpl` and otter-grader. The grader is a zip
that `otter run` (here, `cpl course grade`), `otter grade` (in containers) and Gradescope take.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cpl.course.exercises import exercises_of
from cpl.course.grading import Question, questions_of
from cpl.course.links import Target, plain
from cpl.course.student import student_text
from cpl.publish.chapters import Cell, Chapter
from cpl.store import atomic_write

__all__ = ["Assignment", "GraderError", "Scores", "assign", "grade", "master"]


class GraderError(RuntimeError):
    """otter-grader failed; the message is what it said."""


@dataclass(frozen=True, kw_only=True)
class Assignment:
    """Where the files of a laboratory are.

    Attributes:
        student: The notebook to work in.
        reference: The notebook with answers and all checks.
        grader: The zip that grades.
    """

    student: Path
    reference: Path
    grader: Path


@dataclass(frozen=True, kw_only=True)
class Scores:
    """What a submission reached.

    Attributes:
        points: Points by question.
        possible: Points that there were, by question.
    """

    points: dict[str, float]
    possible: dict[str, float]

    @property
    def total(self) -> float:
        """Points of all questions together."""
        return sum(self.points.values())


def master(chapter: Chapter, targets: Mapping[str, Target], site: str = "../site") -> str:
    """Return otter's master notebook of a laboratory.

    Args:
        chapter: The laboratory.
        targets: What references point to.
        site: The site's folder, from where the student's notebook will lie.

    Raises:
        ValueError: If the chapter has no code exercises, or a reference no target.
    """
    import nbformat

    questions = {question.label: question for question in questions_of(chapter)}
    if not questions:
        msg = f"chapter must have code exercises, {chapter.name!r} has none"
        raise ValueError(msg)
    notebook = nbformat.v4.new_notebook()
    notebook.metadata["kernelspec"] = {
        "display_name": "Python 3", "language": "python", "name": "python3",
    }  # fmt: skip
    notebook.cells = list(_cells(chapter, questions, targets, site))
    for number, cell in enumerate(notebook.cells):
        cell["id"] = f"{chapter.name}-{number}"
    return nbformat.writes(notebook)


def assign(
    chapter: Chapter, targets: Mapping[str, Target], folder: Path, *, check: bool = False
) -> Assignment:
    """Write the three files of a laboratory into a folder.

    Args:
        chapter: The laboratory.
        targets: What references point to.
        folder: Where they go; made if it does not exist.
        check: Whether otter runs all checks against the reference while it is at it.

    Raises:
        GraderError: If otter-grader fails.
    """
    with tempfile.TemporaryDirectory(prefix="cpl-otter-") as scratch:
        source = Path(scratch) / f"{chapter.name}.ipynb"
        source.write_text(master(chapter, targets), encoding="utf-8")
        made = Path(scratch) / "made"
        flags = [] if check else ["--no-run-tests"]
        _otter(["assign", "--no-pdfs", *flags, str(source), str(made)], Path(scratch))
        (zipped,) = (made / "autograder").glob("*.zip")
        found = Assignment(
            student=folder / f"{chapter.name}.ipynb",
            reference=folder / f"{chapter.name}-reference.ipynb",
            grader=folder / f"{chapter.name}-grader.zip",
        )
        atomic_write(found.student, (made / "student" / source.name).read_bytes())
        atomic_write(found.reference, (made / "autograder" / source.name).read_bytes())
        atomic_write(found.grader, zipped.read_bytes())
    return found


def grade(grader: Path, submission: Path) -> Scores:
    """Grade a notebook on this machine, in a folder of its own.

    A submission is somebody's program and runs with your rights: grade strangers' work in a
    container (`otter grade`).

    Args:
        grader: The zip of the laboratory.
        submission: The notebook that was handed in.

    Raises:
        GraderError: If otter-grader fails.
    """
    with tempfile.TemporaryDirectory(prefix="cpl-otter-") as scratch:
        shutil.copy(submission, scratch)
        copy = Path(scratch) / submission.name
        words = ["run", "--no-logo", "-a", str(grader.resolve()), "-o", scratch, str(copy)]
        _otter(words, Path(scratch))
        said = json.loads((Path(scratch) / "results.json").read_text(encoding="utf-8"))
    points: dict[str, float] = {}
    possible: dict[str, float] = {}
    for test in said["tests"]:
        name = re.sub(r" - .*", "", test["name"])
        if "score" in test and name != "Public Tests":
            points[name] = points.get(name, 0.0) + float(test["score"])
            possible[name] = possible.get(name, 0.0) + float(test["max_score"])
    return Scores(points=points, possible=possible)


def _otter(words: list[str], folder: Path) -> None:
    quiet = {**os.environ, "PYTHONWARNINGS": "ignore", "MPLBACKEND": "Agg"}
    done = subprocess.run(
        [sys.executable, "-m", "otter", *words],
        cwd=folder,
        env=quiet,
        capture_output=True,
        encoding="utf-8",
        check=False,
    )
    if done.returncode != 0:
        msg = f"otter {words[0]} failed\n{(done.stdout + done.stderr).strip()[-3000:]}"
        raise GraderError(msg)


def _cells(
    chapter: Chapter, questions: Mapping[str, Question], targets: Mapping[str, Target], site: str
) -> Iterator[Any]:
    """Yield the cells of the master notebook: those of the chapter, in otter's brackets."""
    from nbformat.v4 import new_code_cell, new_markdown_cell

    yield _raw(_CONFIG.format(title=chapter.title))
    inside = False
    for cell in chapter.cells:
        if not cell.code:
            text, inside = _visible(cell, inside=inside)
            asked = [o.label for o in exercises_of(cell.source, chapter.name)]
            before, _, after = text.partition("```{exercise}")
            if before.strip():
                yield new_markdown_cell(plain(before, targets, site))
            if asked:
                question = questions[asked[-1]]
                yield _raw(f"# BEGIN QUESTION\nname: {question.name}\npoints: {_points(question)}")
                yield new_markdown_cell(plain("```{exercise}" + after, targets, site))
                yield from _question(question)
        elif not {"exercise", "check", "solution"} & set(cell.tags):
            yield new_code_cell(cell.source)


def _question(question: Question) -> Iterator[Any]:
    from nbformat.v4 import new_code_cell

    yield _raw("# BEGIN SOLUTION")
    yield new_code_cell(question.answer)
    yield _raw("# END SOLUTION")
    yield _raw("# BEGIN TESTS")
    for check in question.checks:
        hidden = str(check.hidden).lower()
        head = f'""" # BEGIN TEST CONFIG\nhidden: {hidden}\npoints: 1\n""" # END TEST CONFIG\n'
        yield new_code_cell(head + check.source)
    yield _raw("# END TESTS")
    yield _raw("# END QUESTION")


def _visible(cell: Cell, *, inside: bool) -> tuple[str, bool]:
    """Return a text without what belongs to a solution, and whether one is still open."""
    text = cell.source + "\n"
    if inside:
        closed = re.search(r"^```\{solution-end\}\n```[ \t]*\n", text, re.MULTILINE)
        if closed is None:
            return "", True
        text = text[closed.end() :]
    return student_text(text), "{solution-start}" in text


def _points(question: Question) -> int:
    return len(question.checks)


def _raw(text: str) -> Any:  # noqa: ANN401 (NotebookNode)
    from nbformat.v4 import new_raw_cell

    return new_raw_cell(text)


_CONFIG = """# ASSIGNMENT CONFIG
name: "{title}"
init_cell: true
check_all_cell: true
export_cell: false
solutions_pdf: false
template_pdf: false
requirements: []
generate:
  show_stdout: false
"""
