"""Look for solutions in everything that is handed out.

A solution is found by its words: runs of some consecutive words that stand in the solution and
nowhere in what students may read. Pages are compared as text, without markup; notebooks, scripts,
the search index and archives by what is in them. Images and fonts are skipped by their type. What
stands in the package itself is no secret: students install it, and its reference is a page.
"""

from __future__ import annotations

import html
import io
import re
import zipfile
from collections.abc import Iterator, Mapping
from pathlib import Path

import cpl
from cpl.course.exercises import solution_texts
from cpl.course.student import stub, student_text

__all__ = ["leaks", "words_of"]

RUN = 6  # consecutive words that nobody writes twice by chance
MARKS = ("BEGIN SOLUTION", "END SOLUTION", 'class="solution', "{solution")

_PICTURES = {".png", ".svg", ".jpg", ".woff", ".woff2", ".ttf", ".eot", ".ico", ".gif", ".inv"}
# Code of other packages, and of ours that names the marks.
_NOT_OURS = ("_static/mathjax/", "_sphinx_design_static/", "_static/styles/", "_static/vendor/")


def leaks(folder: Path, pages: Mapping[str, str]) -> list[str]:
    """List where solutions are found, one line each; empty if nowhere.

    Args:
        folder: What is handed out.
        pages: The text of each page of the book, solutions included.
    """
    secret = _secrets(pages)
    found: list[str] = []
    for name, text in _texts(folder):
        if any(part in name for part in _NOT_OURS):
            continue
        found += [f"{name}: {mark}" for mark in MARKS if mark in text and not _is_code(name)]
        said = sorted(_runs(text) & secret.keys())
        found += [f"{name}: {secret[run]}: {' '.join(run)}" for run in said]
    return found


def words_of(text: str) -> list[str]:
    r"""Return the words of a text, whatever it is marked up with.

    Examples:
        >>> words_of('<p>A <em>tie</em> is $q_t = s_t$, \\nand &amp; covered.</p>')
        ['a', 'tie', 'is', 'q', 't', 's', 't', 'and', 'covered']
    """
    text = re.sub(r"<[^<>]*>", " ", text)
    text = html.unescape(text).replace("\\n", " ").replace("\\u00e9", "é")
    return [word.lower() for word in re.findall(r"[^\W_]+", text)]


def _secrets(pages: Mapping[str, str]) -> dict[tuple[str, ...], str]:
    """Return the runs of words that stand in solutions only, with the label of each solution."""
    solutions = [found for text in pages.values() for found in solution_texts(text)]
    public: set[tuple[str, ...]] = set()
    for text in pages.values():
        public |= _runs(student_text(text))
    for module in Path(cpl.__file__).parent.rglob("*.py"):
        public |= _runs(module.read_text(encoding="utf-8"))
    for _, body in solutions:  # students have the code of an answer but for what is marked in it
        for cell in _CELL.finditer(body):
            public |= _runs(stub(cell["code"]))
    return {run: label for label, body in solutions for run in _runs(body) - public}


def _runs(text: str) -> set[tuple[str, ...]]:
    words = words_of(text)
    return {tuple(words[i : i + RUN]) for i in range(len(words) - RUN + 1)}


def _texts(folder: Path) -> Iterator[tuple[str, str]]:
    """Yield every text in a folder, archives opened, with its name."""
    for path in sorted(folder.rglob("*")):
        if not path.is_file() or path.suffix in _PICTURES:
            continue
        name = path.relative_to(folder).as_posix()
        if path.suffix in {".whl", ".zip"}:
            yield from _archived(name, path.read_bytes())
        else:
            yield name, path.read_bytes().decode("utf-8", errors="replace")


def _archived(name: str, content: bytes) -> Iterator[tuple[str, str]]:
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        for member in archive.namelist():
            yield f"{name}:{member}", archive.read(member).decode("utf-8", errors="replace")


def _is_code(name: str) -> bool:
    return name.endswith((".py", ".css", ".js")) or ".whl:" in name


_CELL = re.compile(
    r"^(?P<fence>`{3,})\{code-cell\}[^\n]*\n(?P<code>.*?)^(?P=fence)[ \t]*$", re.S | re.M
)
