"""The exercises of the book: each has all of its parts, and what it tells people to type works."""

import ast
import re
import shlex
from pathlib import Path

import pytest

from cpl.course.editions import pages_of
from cpl.course.exercises import exercises_of, faults, solution_texts
from cpl.course.slides import lectures, minutes_of
from cpl.course.student import student_text
from cpl.publish.chapters import find_chapters
from cpl.settings.words import settings
from cpl.store import project_root

ROOT = project_root()
CHAPTERS = find_chapters(ROOT)
PAGES = {Path(place).name: text for place, text in pages_of(ROOT).items()}
EXERCISES = [one for name, text in PAGES.items() for one in exercises_of(text, name)]


def test_there_are_enough_of_each_kind_and_every_chapter_has_some():
    kinds = [one.kind for one in EXERCISES]
    assert len(EXERCISES) >= 24
    assert kinds.count("pencil and paper") >= 8
    assert kinds.count("experiment") >= 8
    assert kinds.count("code") >= 8
    without = CHAPTERS.keys() & PAGES.keys() - {one.place for one in EXERCISES}
    assert not without, f"chapters without an exercise: {sorted(without)}"


def test_each_has_goal_time_hint_and_solution():
    assert faults(PAGES) == []


def test_what_an_exercise_lacks_is_said():
    text = "```{exercise} One\n:label: ex-one\n\nWhat?\n```\n\n```{solution} ex-two\nThat.\n```\n"
    said = faults({"small": text, "again": text})
    assert "small: ex-one says no goal and no time (*Goal: ... . 10 minutes, experiment.*)" in said
    assert "small: ex-one has no hint" in said
    assert "small: ex-one has no solution" in said
    assert "small: a solution of ex-two, which is no exercise of this page" in said
    assert "ex-one is the label of two exercises" in said


@pytest.mark.parametrize("one", EXERCISES, ids=lambda one: one.label)
def test_the_commands_of_an_exercise_are_accepted(one):
    for command in re.findall(r"`(cpl run [^`]+)`", one.text + one.hint + one.solution):
        words = shlex.split(command)
        chapter = CHAPTERS[words[2]]
        chosen = [word for flag, word in zip(words[3::2], words[4::2], strict=True) if flag]
        assert set(words[3::2]) <= {"--set"}, command
        assert len(settings(chapter.parameters, chosen, chapter.name)) == len(chosen)


@pytest.mark.parametrize("name", CHAPTERS)
def test_numbers_that_only_a_solution_quotes_are_computed_in_a_cell_that_students_do_not_get(name):
    chapter = CHAPTERS[name]
    quoted = re.compile(r"\{glue:text\}`(\w+)`")
    kept = set(quoted.findall(student_text(chapter.text)))
    secret = {n for _, body in solution_texts(chapter.text) for n in quoted.findall(body)} - kept
    public = "\n".join(c.source for c in chapter.cells if c.code and "solution" not in c.tags)
    glued = {
        node.args[0].value
        for node in ast.walk(ast.parse(public))
        if isinstance(node, ast.Call)
        and getattr(node.func, "id", "") == "glue"
        and isinstance(node.args[0], ast.Constant)
    }
    assert not secret & glued


def test_the_plan_of_the_lectures_names_exercises_that_exist():
    labels = {one.label for one in EXERCISES}
    pages = [ROOT / "book" / f"{name}.md" for name in ("exercises", "teach", "projects")]
    for page in [*pages, *lectures(ROOT)]:
        named = set(re.findall(r"\bex-[a-z]+-[a-z-]+\b", page.read_text(encoding="utf-8")))
        assert named <= labels, f"{page.name} names {sorted(named - labels)}"


def test_there_are_four_lectures_of_ninety_minutes_with_goals_and_notes():
    assert len(lectures(ROOT)) == 4
    for path in lectures(ROOT):
        text = path.read_text(encoding="utf-8")
        assert minutes_of(text) == 90, path.name
        assert "## After this lecture you can\n\n- " in text
        slides = re.split(r"^##? ", text, flags=re.MULTILINE)[2:]  # but the title
        silent = [
            s.splitlines()[0] for s in slides if "revealjs-notes" not in s and s.count("\n") > 3
        ]
        assert silent == [], f"{path.name}: slides without notes"


def test_no_lecture_types_a_number_that_a_chapter_computes():
    """A share or a count with decimals on a slide is a value of a chapter, or is a parameter."""
    given = {"0.1", "0.2", "0.3", "0.5", "0.8", "0.85", "0.9", "1.1", "0.05", "22.5"}
    for path in lectures(ROOT):
        text = re.sub(r"\{value\}`[^`]*`", "", path.read_text(encoding="utf-8"))
        found = set(re.findall(r"(?<![\w.])\d+\.\d+", text)) - given
        assert not found, f"{path.name} types {sorted(found)}"
        assert not re.findall(r"\d+ ?(?:%|\\%|percent)", text.replace("95 percent", ""))
