"""A Sphinx extension: a table of all exercises of the book, so that nobody keeps one by hand.

    ```{exercise-table}
    ```

It reads the pages that are about to be rendered, in the order of the table of contents.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from docutils import nodes
from docutils.statemachine import StringList
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

from cpl.course.exercises import exercises_of


def setup(app: Sphinx) -> dict[str, Any]:
    """Connect the extension."""
    app.add_directive("exercise-table", ExerciseTable)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}


class ExerciseTable(SphinxDirective):
    """A row for each exercise: where it stands, of which kind it is, how long it takes."""

    def run(self) -> list[nodes.Node]:
        """Write the table as MyST and have it parsed, so that its links are checked like others."""
        lines = ["| exercise | chapter | kind | minutes | what it is good for |"]
        lines.append("|---|---|---|---:|---|")
        for name, text in _pages(Path(self.env.srcdir)):
            for one in exercises_of(text, name):
                cells = (
                    f"{{ref}}`{one.label}` {one.title}",
                    f"{{doc}}`{name}`",
                    one.kind,
                    str(one.minutes),
                    one.goal,
                )
                lines.append("| " + " | ".join(cells) + " |")
        box = nodes.container(classes=["exercise-table"])
        self.state.nested_parse(StringList(lines, source=self.env.docname), 0, box)
        return [box]


def _pages(source: Path) -> Iterator[tuple[str, str]]:
    """Yield the name and the text of each page, notebooks as the text of their text cells."""
    toc = (source / "_toc.yml").read_text(encoding="utf-8")
    for place in re.findall(r"^\s*(?:- file|root): *(\S+)", toc, re.MULTILINE):
        notebook, page = (source / f"{place}{ending}" for ending in (".ipynb", ".md"))
        if notebook.exists():
            cells = json.loads(notebook.read_text(encoding="utf-8"))["cells"]
            texts = ["".join(c["source"]) for c in cells if c["cell_type"] == "markdown"]
            yield Path(place).name, "\n\n".join(texts)
        elif page.exists():
            yield Path(place).name, page.read_text(encoding="utf-8")
