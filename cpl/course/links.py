"""Write MyST as the plain Markdown that every notebook program shows.

In a laboratory's notebook references become links to the pages of the site that lies beside it,
exercises become headings, and hints fold.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass

__all__ = ["Target", "plain", "targets_of"]


@dataclass(frozen=True, kw_only=True)
class Target:
    """Something that a reference may point to.

    Attributes:
        title: What a link to it is called.
        address: Where it is, from the root of the site.
    """

    title: str
    address: str


def targets_of(pages: Mapping[str, str]) -> dict[str, Target]:
    r"""Return the targets of all references, by label.

    Args:
        pages: The text of each page, by its place without ending (`book/theory`).

    Examples:
        >>> lemma = "```{prf:lemma} Walls\n:label: lem-walls\nHigh.\n```\n"
        >>> found = targets_of({"book/one": "(one)=\n# The first\n\n" + lemma})
        >>> found["one"].title, found["lem-walls"].address
        ('The first', 'book/one.html#lem-walls')
    """
    found: dict[str, Target] = {}
    for place, text in pages.items():
        for match in _HEADING.finditer(text):
            first = match["marks"] == "#"
            address = f"{place}.html" + ("" if first else f"#{match['label']}")
            found[match["label"]] = Target(title=match["title"].strip(), address=address)
        for match in _LABELLED.finditer(text):
            title = match["title"].strip() or match["kind"].rpartition(":")[2]
            found[match["label"]] = Target(title=title, address=f"{place}.html#{match['label']}")
        for match in _EQUATION.finditer(text):
            address = f"{place}.html#equation-{match['label']}"
            found[match["label"]] = Target(title="this equation", address=address)
        for match in _FIGURE.finditer(text):
            found[match["label"]] = Target(
                title="this figure", address=f"{place}.html#{match['label']}"
            )
    return found


def plain(text: str, targets: Mapping[str, Target], site: str) -> str:
    r"""Return MyST text as plain Markdown.

    Args:
        text: The text of a cell.
        targets: What references point to, by label.
        site: The site's folder, from where the notebook lies.

    Raises:
        ValueError: If a reference has no target.

    Examples:
        >>> where = {"theory": Target(title="Theorem 1", address="book/theory.html")}
        >>> plain("See {ref}`here <theory>`.", where, "../site")
        'See [here](../site/book/theory.html).\n'
    """

    def linked(match: re.Match[str]) -> str:
        named = re.fullmatch(r"(.*?)\s*<([\w-]+)>", match["target"])
        label = named[2] if named else match["target"]
        if label not in targets:
            msg = f"text refers to {label!r}, which is no label of the book"
            raise ValueError(msg)
        title = named[1] if named else match["word"] or targets[label].title
        return f"[{title}]({site}/{targets[label].address})"

    text = _ANCHOR.sub("", text)
    text = _DROPDOWN.sub(r"<details><summary>\g<title></summary>\n\n\g<body>\n</details>", text)
    text = _EXERCISE.sub(r"### Exercise: \g<title>\n\n\g<body>", text)
    text = _REFERENCE.sub(linked, text)
    return text.strip() + "\n"


_HEADING = re.compile(r"^\((?P<label>[\w-]+)\)=\n+(?P<marks>#+) (?P<title>[^\n]+)$", re.MULTILINE)
_LABELLED = re.compile(
    r"^`{3,}\{(?P<kind>exercise|prf:\w+)\}(?P<title>[^\n]*)\n(?::[\w-]+:[^\n]*\n)*?"
    r":label: *(?P<label>[\w-]+)$",
    re.MULTILINE,
)
_EQUATION = re.compile(r"^\$\$ \((?P<label>[\w-]+)\)$", re.MULTILINE)
_FIGURE = re.compile(r"^ *:?name: (?P<label>fig-[\w-]+)$", re.MULTILINE)
_ANCHOR = re.compile(r"^\([\w-]+\)=\n", re.MULTILINE)
_REFERENCE = re.compile(
    r"(?:(?P<word>[Ee]quation) )?\{(?:ref|eq|prf:ref|numref|doc)\}`(?P<target>[^`]+)`"
)
_DROPDOWN = re.compile(
    r"^(?P<fence>`{3,})\{dropdown\} *(?P<title>[^\n]*)\n(?P<body>.*?)^(?P=fence)[ \t]*$",
    re.DOTALL | re.MULTILINE,
)
_EXERCISE = re.compile(
    r"^(?P<fence>`{3,})\{exercise\} *(?P<title>[^\n]*)\n(?::[\w-]+:[^\n]*\n)*\n*"
    r"(?P<body>.*?)^(?P=fence)[ \t]*$",
    re.DOTALL | re.MULTILINE,
)
