"""Take the solutions out of a page, before anything is rendered from it.

What a reader of the student edition must not find is not hidden but absent: from the pages, from
the notebooks behind them, and so from the search index and everything else that is made of them.

- the solutions of exercises, fenced or between `solution-start` and `solution-end`;
- in a cell tagged `exercise`, what stands between BEGIN SOLUTION and END SOLUTION;
- cells tagged `solution`, which compute the numbers that a solution quotes;
- cells tagged `hidden`, the checks that an answer meets only when it is graded;
- in a notebook with such cells, all outputs: they are the outputs of the solutions.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from cpl.course.exercises import GATED, SOLUTION

__all__ = ["stub", "student_notebook", "student_text"]

_ABSENT = {"solution", "hidden"}


def student_text(text: str) -> str:
    r"""Return a page without its solutions.

    Args:
        text: The page as it is written (MyST).

    Examples:
        >>> student_text("What is twice two?\n\n```{solution} ex-double\nFour.\n```\n")
        'What is twice two?\n\n'
    """
    return _strip(text, inside=False)[0]


def student_notebook(notebook: Mapping[str, Any]) -> dict[str, Any]:
    """Return a notebook without solutions, checks that are kept secret, and what they printed.

    Args:
        notebook: A notebook of format 4 as nested mappings; it is not changed.
    """
    cells: list[dict[str, Any]] = []
    laboratory = any("exercise" in _tags(cell) for cell in notebook["cells"])
    inside = False
    for old in notebook["cells"]:
        cell = {**old}
        tags = _tags(old)
        if cell["cell_type"] == "markdown":
            cell["source"], inside = _strip("".join(cell["source"]), inside=inside)
            if not cell["source"].strip():
                continue
        elif "exercise" in tags:
            cell["source"] = stub("".join(cell["source"]))
        elif inside or tags & _ABSENT:
            continue
        if laboratory and cell["cell_type"] == "code":
            cell |= {"outputs": [], "execution_count": None}
        cells.append(cell)
    return {**notebook, "cells": cells}


def stub(source: str) -> str:
    r"""Return the source of an answer with an ellipsis in place of the solution.

    Examples:
        >>> print(stub("def one():\n    # BEGIN SOLUTION\n    return 1\n    # END SOLUTION"))
        def one():
            ...
    """
    return _MARKED.sub(lambda match: f"{match['indent']}...", source)


def _strip(text: str, *, inside: bool) -> tuple[str, bool]:
    """Return the text without solutions, and whether it ends within one."""
    if inside:
        end = _END.search(text)
        if end is None:
            return "", True
        text = text[end.end() :]
    text = SOLUTION.sub("", GATED.sub("", text))
    begin = _BEGIN.search(text)
    if begin is None:
        return text, False
    return text[: begin.start()], True


def _tags(cell: Mapping[str, Any]) -> set[str]:
    return set(cell.get("metadata", {}).get("tags", ()))


_BEGIN = re.compile(r"^(`{3,}|:{3,})\{solution-start\}", re.MULTILINE)
_END = re.compile(r"^(`{3,}|:{3,})\{solution-end\}[^\n]*\n\1[ \t]*$\n?", re.MULTILINE)
_MARKED = re.compile(
    r"^(?P<indent>[ \t]*)# BEGIN SOLUTION[^\n]*\n.*?^[ \t]*# END SOLUTION[^\n]*$",
    re.DOTALL | re.MULTILINE,
)
