"""A Sphinx extension: how long a page takes, what the parts ask, what the ledger says, and links.

- Under the title of a chapter: minutes to read, exercises, the command that runs it.
- `{map}` lists the parts and chapters with their questions and minutes; `{verdicts}` draws the
  ledger's counts.
- A row of the ledger links to the chapter that shows it, and a row that a chapter quotes links back
  to the ledger.
"""

from __future__ import annotations

import html
import json
import math
from pathlib import Path
from typing import Any, ClassVar

import yaml
from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

from cpl.claims.verdict import SIGNS

_MOST_MINUTES = 60
_WORDS_A_MINUTE = 200  # of a text with equations, slower than a novel
_SECONDS_AN_EQUATION, _SECONDS_A_FIGURE, _SECONDS_A_LINE = 12, 15, 2
LEDGER = "book/holds"
LEDGER_HEADS = ["#", "claim", "paper", "ours", "95 % interval", "verdict"]
MARKS = {str(verdict): sign for verdict, sign in SIGNS.items()}
_QUESTIONS = {
    "I": "What can be promised about a forecaster when the world may change, and what not?",
    "II": "Does the promise make a simulated car safer?",
    "III": "Can a policy learn to use the quantile?",
    "IV": "Does it help a walking robot whose camera loses its way?",
    "V": "Which of the paper's claims stand?",
    "VI": "Where is what, and how is it taught?",
}


class Map(SphinxDirective):
    """Parts and chapters; filled when all pages have been read."""

    def run(self) -> list[nodes.Node]:
        """Leave a mark that is replaced later."""
        return [nodes.raw("", "", format="html", classes=["book-map"])]


class Verdicts(SphinxDirective):
    """The ledger's verdicts and how often each was reached."""

    option_spec: ClassVar[dict[str, Any]] = {}

    def run(self) -> list[nodes.Node]:
        """Draw them."""
        path = Path(self.env.srcdir) / "book/_static/live/data/ledger.json"
        counts = json.loads(path.read_text(encoding="utf-8"))["counts"]
        self.env.note_dependency(str(path))
        known = [name for name in MARKS if name in counts]
        items = [
            f'<li class="verdict-{number}" style="flex-grow: {counts[name]}">'
            f'<span aria-hidden="true">{MARKS[name]}</span> <strong>{counts[name]}</strong> '
            f"{html.escape(name)}</li>"
            for number, name in enumerate(MARKS)
            if name in known
        ]
        return [nodes.raw("", f'<ul class="verdicts">{"".join(items)}</ul>', format="html")]


def setup(app: Sphinx) -> dict[str, Any]:
    """Connect the extension."""
    app.add_directive("map", Map)
    app.add_directive("verdicts", Verdicts)
    app.connect("doctree-resolved", _link_ledger)
    app.connect("doctree-resolved", _fill_map)
    app.connect("html-page-context", _say_how_long)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}


# ---------------------------------------------------------------- how long a page takes


def minutes(doctree: nodes.document) -> int:
    """Return how long a page takes to read, without its exercises' solutions and its code's run."""
    prose = [p for p in doctree.findall(nodes.paragraph) if not _is_aside(p)]
    words = sum(len(p.astext().split()) for p in prose)
    lines = sum(c.astext().count("\n") + 1 for c in doctree.findall(nodes.literal_block))
    seconds = (
        60 * words / _WORDS_A_MINUTE
        + _SECONDS_AN_EQUATION * len(list(doctree.findall(nodes.math_block)))
        + _SECONDS_A_FIGURE * len(list(doctree.findall(nodes.image)))
        + _SECONDS_A_LINE * lines
    )
    return max(1, math.ceil(seconds / 60))


def _how_long(doctree: nodes.document) -> str:
    """Say how long a page takes, or that nobody reads it from end to end."""
    taken = minutes(doctree)
    return f"{taken} min" if taken <= _MOST_MINUTES else "to look up"


def _is_aside(node: nodes.Node) -> bool:
    """Say whether a node stands in a solution, or in how the page was made."""
    while node.parent is not None:
        node = node.parent
        classes = node.get("classes", []) if isinstance(node, nodes.Element) else []
        ids = node.get("ids", []) if isinstance(node, nodes.Element) else []
        if "solution" in classes or "how-this-page-was-made" in ids:
            return True
    return False


def _say_how_long(
    _app: Sphinx,
    page: str,
    _template: str,
    context: dict[str, Any],
    doctree: nodes.document | None,
) -> None:
    if doctree is None or "</h1>" not in context.get("body", ""):
        return
    taken = _how_long(doctree)
    facts = [f"{taken} to read" if taken.endswith("min") else taken]
    exercises = context["body"].count('class="exercise ')
    if exercises:
        facts.append(f"{exercises} exercise{'s' if exercises > 1 else ''}")
    if _is_chapter(doctree):
        facts.append(f"<code>cpl run {page.rpartition('/')[2]}</code>")
    line = f'</h1>\n<p class="book-opening">{" · ".join(facts)}</p>'
    if page != _app.config.root_doc and "book/intro" not in page:
        context["body"] = context["body"].replace("</h1>", line, 1)


def _is_chapter(doctree: nodes.document) -> bool:
    return any("how-this-page-was-made" in s.get("ids", []) for s in doctree.findall(nodes.section))


# ---------------------------------------------------------------- the map


def _fill_map(app: Sphinx, doctree: nodes.document, page: str) -> None:
    for mark in list(doctree.findall(nodes.raw)):
        if "book-map" in mark.get("classes", []):
            mark.replace_self(nodes.raw("", _map(app, page), format="html"))


def _map(app: Sphinx, page: str) -> str:
    toc = yaml.safe_load((Path(app.srcdir) / "_toc.yml").read_text(encoding="utf-8"))
    parts = [_part(app, page, part) for part in toc.get("parts", [])]
    return f'<div class="book-parts">{"".join(parts)}</div>'


def _part(app: Sphinx, page: str, part: dict[str, Any]) -> str:
    caption = part["caption"]
    question = _QUESTIONS.get(caption.split(" ")[0], "")
    rows = [_entry(app, page, entry["file"]) for entry in part["chapters"]]
    return (
        f'<section class="book-part"><h3>{html.escape(caption)}</h3>'
        f"<p>{html.escape(question)}</p><ul>{''.join(rows)}</ul></section>"
    )


def _entry(app: Sphinx, page: str, document: str) -> str:
    tree = app.env.get_doctree(document)
    title = html.escape(app.env.titles[document].astext())
    address = app.builder.get_relative_uri(page, document)
    return f'<li><a href="{address}">{title}</a> <span>{_how_long(tree)}</span></li>'


# ---------------------------------------------------------------- the ledger's links


def _link_ledger(app: Sphinx, doctree: nodes.document, page: str) -> None:
    for table in doctree.findall(nodes.table):
        heads = [entry.astext() for head in table.findall(nodes.thead) for entry in head[0]]
        if heads == LEDGER_HEADS:
            for body in table.findall(nodes.tbody):
                for row in body:
                    _link_row(app, page, row)


def _link_row(app: Sphinx, page: str, row: nodes.Element) -> None:
    number = row[0].astext()
    target = LEDGER
    if page == LEDGER:
        row["ids"].append(f"claim-{number}")
        target = f"book/{_chapters(app).get(number, '')}"
    if target not in app.env.all_docs:
        return  # the chapter of a row that is still pending
    address = app.builder.get_relative_uri(page, target)
    anchor = "" if page == LEDGER else f"#claim-{number}"
    title = "the chapter on this claim" if page == LEDGER else "this claim in the ledger"
    link = nodes.reference("", number, refuri=address + anchor, internal=True, reftitle=title)
    row[0].children[0].children = []
    row[0].children[0] += link


def _chapters(app: Sphinx) -> dict[str, str]:
    path = Path(app.srcdir) / "book/_static/live/data/ledger.json"
    rows = json.loads(path.read_text(encoding="utf-8"))["rows"] if path.exists() else []
    return {str(row["row"]): row["chapter"] for row in rows}
