"""Find the exercises of the book: what each one asks, for how long, and where its answer stands.

An exercise is written in its chapter, in the directives of sphinx-exercise. Its text begins with a
line that says what it is good for, how long it takes, and of which kind it is:

    *Goal: feel what delay costs. 10 minutes, experiment.* Re-run the chapter with ...

A hint and a full solution follow. Those of a laboratory (`book/lab_*.md`) are code: the solution is
a cell tagged `exercise`, and the cells tagged `check` decide whether an answer is right.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

__all__ = ["KINDS", "Exercise", "exercises_of", "faults", "solution_texts"]

KINDS = ("pencil and paper", "experiment", "code")
MINUTES = (3, 90)  # a lecture has 90


@dataclass(frozen=True, kw_only=True)
class Exercise:
    """An exercise as its chapter has it.

    Attributes:
        label: What references call it.
        title: Its title.
        place: The name of the page on which it stands.
        goal: What is learnt by it; empty if it does not say.
        minutes: How long it takes [min]; 0 if it does not say.
        kind: One of `KINDS`.
        text: What it asks.
        hint: A help that is not the answer; empty if there is none.
        solution: The full solution, code included; empty if there is none.
    """

    label: str
    title: str
    place: str
    goal: str
    minutes: int
    kind: str
    text: str
    hint: str
    solution: str


def exercises_of(text: str, place: str) -> tuple[Exercise, ...]:
    """Return the exercises in the text of a page, in order.

    Args:
        text: The page as it is written (MyST).
        place: The page's name.

    Examples:
        >>> page = '''```{exercise} Doubling
        ... :label: ex-double
        ...
        ... *Goal: double a number. 5 minutes, pencil and paper.* What is twice two?
        ... ```
        ...
        ... ```{dropdown} Hint
        ... Add.
        ... ```
        ...
        ... ```{solution} ex-double
        ... Four.
        ... ```
        ... '''
        >>> (one,) = exercises_of(page, "sums")
        >>> one.label, one.minutes, one.kind, one.hint, one.solution
        ('ex-double', 5, 'pencil and paper', 'Add.', 'Four.')
    """
    solutions = dict(solution_texts(text))
    begun = list(_EXERCISE.finditer(text))
    ends = [*(match.start() for match in begun), len(text)][1:]
    found: list[Exercise] = []
    for match, end in zip(begun, ends, strict=True):
        label = match["label"]
        said = _GOAL.search(match["body"])
        hint = _HINT.search(match["body"]) or _HINT.search(text, match.end(), end)
        found.append(
            Exercise(
                label=label,
                title=match["title"].strip(),
                place=place,
                goal=said["goal"] if said else "",
                minutes=int(said["minutes"]) if said else 0,
                kind=(said["kind"] or "experiment") if said else "",
                text=match["body"].strip(),
                hint=hint["body"].strip() if hint else "",
                solution=solutions.get(label, "").strip(),
            )
        )
    return tuple(found)


def solution_texts(text: str) -> Iterator[tuple[str, str]]:
    """Yield the label and the text of every solution on a page."""
    for match in sorted([*SOLUTION.finditer(text), *GATED.finditer(text)], key=lambda m: m.start()):
        yield match["label"], match["body"]


def faults(pages: Mapping[str, str]) -> list[str]:
    """List what the exercises of the book lack, one line each; empty if nothing.

    Args:
        pages: The text of each page by name.
    """
    said: list[str] = []
    labels: list[str] = []
    for name, text in pages.items():
        known = {one.label for one in exercises_of(text, name)}
        for label, _ in solution_texts(text):
            if label not in known:
                said.append(f"{name}: a solution of {label}, which is no exercise of this page")
        for one in exercises_of(text, name):
            labels.append(one.label)
            said += [f"{name}: {one.label} {problem}" for problem in _lacks(one)]
    said += [
        f"{label} is the label of two exercises" for label in set(labels) if _twice(label, labels)
    ]
    return said


def _lacks(one: Exercise) -> Iterator[str]:
    if not one.goal:
        yield "says no goal and no time (*Goal: ... . 10 minutes, experiment.*)"
    elif one.kind not in KINDS:
        yield f"is of the kind {one.kind!r}, not one of {', '.join(KINDS)}"
    elif not MINUTES[0] <= one.minutes <= MINUTES[1]:
        yield f"takes {one.minutes} minutes, allowed are {MINUTES[0]} to {MINUTES[1]}"
    if not one.hint:
        yield "has no hint"
    if not one.solution:
        yield "has no solution"


def _twice(label: str, labels: list[str]) -> bool:
    return labels.count(label) > 1


def _fenced(head: str) -> re.Pattern[str]:
    return re.compile(
        rf"^(?P<fence>`{{3,}}|:{{3,}})\{{{head}\n(?P<options>(?::[\w-]+:[^\n]*\n)*)"
        r"(?P<body>.*?)^(?P=fence)[ \t]*$\n?",
        re.DOTALL | re.MULTILINE,
    )


_EXERCISE = re.compile(
    r"^(?P<fence>`{3,}|:{3,})\{exercise\}(?P<title>[^\n]*)\n(?:(?!:label:):[\w-]+:[^\n]*\n)*"
    r":label: *(?P<label>[\w-]+)\n(?::[\w-]+:[^\n]*\n)*(?P<body>.*?)^(?P=fence)[ \t]*$",
    re.DOTALL | re.MULTILINE,
)
_GOAL = re.compile(
    r"\*Goal: (?P<goal>[^*]+?)\. (?P<minutes>\d+) minutes(?:, (?P<kind>[^*.]+))?\.\*"
)
_HINT = _fenced(r"(?:dropdown\}} *Hint|hint\}})[^\n]*".replace("}}", "}"))
SOLUTION = _fenced(r"solution\} *(?P<label>[\w-]+)[^\n]*")
GATED = re.compile(
    r"^(?P<fence>`{3,}|:{3,})\{solution-start\} *(?P<label>[\w-]+)[^\n]*\n"
    r"(?::[\w-]+:[^\n]*\n)*(?P=fence)[ \t]*\n(?P<body>.*?)"
    r"^(?P<last>`{3,}|:{3,})\{solution-end\}[^\n]*\n(?P=last)[ \t]*$\n?",
    re.DOTALL | re.MULTILINE,
)
