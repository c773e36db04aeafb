"""Mark answers to the code exercises without leaving the process.

A laboratory is a chapter whose exercises are code. An exercise has one cell tagged `exercise`, the
answer, and after it cells tagged `check`, each worth a point. A check sees the parameters and the
answers, and nothing that another check has defined.

otter-grader does the same for a whole class, in notebooks (`cpl.course.labs`). This module
is what the tests use, because it takes milliseconds.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from cpl.course.exercises import exercises_of
from cpl.course.student import stub
from cpl.publish.chapters import Cell, Chapter

__all__ = ["Check", "Mark", "Question", "laboratories", "mark", "questions_of"]


@dataclass(frozen=True, kw_only=True)
class Check:
    """A check of an answer, worth one point.

    Attributes:
        source: Its code; it raises if the answer is wrong.
        hidden: Whether only the grader has it.
    """

    source: str
    hidden: bool


@dataclass(frozen=True, kw_only=True)
class Question:
    """A code exercise with what decides about its answers.

    Attributes:
        label: The exercise's label.
        answer: The reference solution, with the marks between which it stands.
        checks: What an answer has to pass, a point each.
    """

    label: str
    answer: str
    checks: tuple[Check, ...]

    @property
    def name(self) -> str:
        """A name for it that is an identifier, as graders want it."""
        return self.label.removeprefix("ex-lab-").replace("-", "_")

    @property
    def stub(self) -> str:
        """What a student starts from."""
        return stub(self.answer)


@dataclass(frozen=True, kw_only=True)
class Mark:
    """How an answer did.

    Attributes:
        points: Checks that it passed.
        possible: Checks that there are.
        said: What the failed checks said.
    """

    points: int
    possible: int
    said: tuple[str, ...]


def laboratories(chapters: Mapping[str, Chapter]) -> dict[str, Chapter]:
    """Return the chapters that have code exercises, by name."""
    return {name: chapter for name, chapter in chapters.items() if questions_of(chapter)}


def questions_of(chapter: Chapter) -> tuple[Question, ...]:
    """Return the code exercises of a chapter, in order.

    Raises:
        ValueError: If an answer has no checks, or belongs to no exercise.
    """
    found: list[Question] = []
    for label, cells in _by_exercise(chapter):
        answers = [cell.source for cell in cells if "exercise" in cell.tags]
        if not answers:
            continue
        checks = tuple(
            Check(source=cell.source, hidden="hidden" in cell.tags)
            for cell in cells
            if "check" in cell.tags
        )
        if len(answers) != 1 or not checks or not label:
            msg = f"{chapter.name}: {label or 'a cell before all exercises'} has {len(answers)}"
            raise ValueError(f"{msg} answers and {len(checks)} checks, not one and some")
        found.append(Question(label=label, answer=answers[0], checks=checks))
    return tuple(found)


def mark(chapter: Chapter, answers: Mapping[str, str]) -> dict[str, Mark]:
    """Run answers and their checks.

    Args:
        chapter: A laboratory.
        answers: The source of the answers by label; the stub stands for one that is missing.

    Returns:
        The mark of every question of the laboratory.
    """
    space: dict[str, object] = {}
    exec(next(cell.source for cell in chapter.cells if cell.code), space)
    marks: dict[str, Mark] = {}
    for question in questions_of(chapter):
        checks = [check.source for check in question.checks]
        broken = _failures(answers.get(question.label, question.stub), space)
        failed = broken or [text for check in checks for text in _failures(check, dict(space))]
        points = 0 if broken else len(checks) - len(failed)
        marks[question.label] = Mark(points=points, possible=len(checks), said=tuple(failed))
    return marks


def _failures(source: str, space: dict[str, object]) -> list[str]:
    """Run a source; return what it says if it fails, for somebody's answer may fail in any way."""
    try:
        exec(source, space)
    except Exception as error:
        return [f"{type(error).__name__}: {error}"]
    return []


def _by_exercise(chapter: Chapter) -> Iterator[tuple[str, list[Cell]]]:
    """Yield each exercise's label with the code cells that follow it up to the next exercise."""
    label, cells = "", list[Cell]()
    for cell in chapter.cells:
        if cell.code:
            cells.append(cell)
            continue
        labels = [one.label for one in exercises_of(cell.source, chapter.name)]
        if labels:
            yield label, cells
            label, cells = labels[-1], []
    yield label, cells
