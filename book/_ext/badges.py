"""A Sphinx extension: the verdict beside each claim, drawn from the ledger and never typed.

- `` {claim}`29` `` is a badge: what the ledger says of row 29 today, with a link to the row.
- Where a chapter shows rows of the ledger, each verdict becomes such a badge. A table that was
  executed with another ledger than the book is built with is a warning, which fails the build.
- Under the title of a chapter stand the badges of the claims that it discusses.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from docutils import nodes
from reading import LEDGER, LEDGER_HEADS, MARKS
from sphinx.application import Sphinx
from sphinx.util import logging
from sphinx.util.docutils import SphinxRole

_log = logging.getLogger(__name__)
_FILE = "book/_static/live/data/ledger.json"  # written when the book is laid out


class ClaimMark(nodes.inline):
    """Where a badge goes; filled when all pages have been read."""


class Claim(SphinxRole):
    """The role."""

    def run(self) -> tuple[list[nodes.Node], list[nodes.system_message]]:
        """Leave a mark with the row's number."""
        mark = ClaimMark("", f"claim {self.text}", row=self.text)
        self.set_source_info(mark)
        return [mark], []


def setup(app: Sphinx) -> dict[str, Any]:
    """Connect the extension."""
    app.add_node(ClaimMark, html=(_open, _close))
    app.add_role("claim", Claim())
    app.connect("doctree-resolved", _fill)
    app.connect("html-page-context", _fold_into_opening, priority=900)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}


def _fill(app: Sphinx, doctree: nodes.document, page: str) -> None:
    rows = _rows(app)
    for mark in list(doctree.findall(ClaimMark)):
        if not rows:  # a site without live figures: there is no ledger beside it
            mark.replace_self(nodes.inline("", f"claim {mark['row']}"))
        elif mark["row"] not in rows:
            _log.warning("there is no claim %r in the ledger", mark["row"], location=mark)
        else:
            mark.replace_self(_badge(app, page, rows[mark["row"]], linked=True))
    for table in doctree.findall(nodes.table):
        heads = [entry.astext() for head in table.findall(nodes.thead) for entry in head[0]]
        if heads == LEDGER_HEADS:
            for line in (line for body in table.findall(nodes.tbody) for line in body):
                _mark_line(app, page, line, rows)


def _mark_line(app: Sphinx, page: str, line: nodes.Element, rows: dict[str, Any]) -> None:
    """Put a badge in the place of the verdict, and keep what stands behind it."""
    number, said = line[0].astext(), line[-1].astext()
    row = rows.get(number)
    if row is None:
        return
    if not said.startswith(row["verdict"]):
        _log.warning("claim %s is shown as %r, the ledger says %r", number, said, row["verdict"],
                     location=line)  # fmt: skip
        return
    cell = line[-1].children[0] if line[-1].children else line[-1]
    cell.children = []
    cell += _badge(app, page, row, linked=False)
    rest = said.removeprefix(row["verdict"])
    if rest:
        cell += nodes.Text(rest)


def _badge(app: Sphinx, page: str, row: dict[str, Any], *, linked: bool) -> nodes.Node:
    """Draw a verdict: a sign for the eye, and words for everybody."""
    kind = f"verdict-{list(MARKS).index(row['verdict'])}"
    badge = nodes.inline(classes=["verdict", kind])
    sign = f'<span aria-hidden="true">{MARKS[row["verdict"]]}</span> '
    badge += nodes.raw("", sign, format="html")
    badge += nodes.Text(f"claim {row['row']} {row['verdict']}" if linked else row["verdict"])
    if not linked or LEDGER not in app.env.all_docs:
        return badge
    address = f"{app.builder.get_relative_uri(page, LEDGER)}#claim-{row['row']}"
    link = nodes.reference("", "", refuri=address, internal=True, reftitle=row["claim"])
    link += badge
    return link


def _fold_into_opening(
    app: Sphinx,
    page: str,
    _template: str,
    context: dict[str, Any],
    doctree: nodes.document | None,
) -> None:
    """Show the claims of a chapter in the line under its title."""
    if doctree is None or page == LEDGER:
        return
    slug = page.rpartition("/")[2]
    mine = [row for row in _rows(app).values() if row["chapter"] == slug]
    opening = '<p class="book-opening">'
    if not mine or opening not in context.get("body", ""):
        return
    alone = LEDGER not in app.env.all_docs
    up = "" if alone else app.builder.get_relative_uri(page, LEDGER)
    badges = " ".join(_small(row, up) for row in mine)
    line = f'<p class="book-claims"><span>Claims of this chapter</span> {badges}</p>\n{opening}'
    context["body"] = context["body"].replace(opening, line, 1)


def _small(row: dict[str, Any], ledger: str) -> str:
    kind = f"verdict-{list(MARKS).index(row['verdict'])}"
    open_, close = (
        ("span", "span") if not ledger else (f'a href="{ledger}#claim-{row["row"]}"', "a")
    )
    return (
        f'<{open_} class="verdict {kind}">'
        f'<span aria-hidden="true">{MARKS[row["verdict"]]}</span> '
        f"no. {row['row']}: {row['verdict']}"
        f"</{close}>"
    )


def _rows(app: Sphinx) -> dict[str, dict[str, Any]]:
    path = Path(app.srcdir) / _FILE
    if not path.exists():
        return {}
    rows = json.loads(path.read_text(encoding="utf-8"))["rows"]
    return {str(row["row"]): row for row in rows}


def _open(self: Any, node: ClaimMark) -> None:
    """Show a mark that could not be filled as its text."""
    self.visit_inline(node)


def _close(self: Any, node: ClaimMark) -> None:
    self.depart_inline(node)
