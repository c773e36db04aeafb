"""Find the chapters, and split them into cells without importing a notebook library.

A chapter is `book/<name>.md`, a MyST text notebook: it has a kernelspec in its header. Other pages
of the book (front page, notation) are plain text without one. Names are unique in the book.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import yaml

from cpl.publish.declaration import DeclarationError, read_parameters
from cpl.settings.words import Parameter, ParameterError, suggestion

__all__ = ["Cell", "Chapter", "ChapterError", "find_chapter", "find_chapters", "find_pages"]


class ChapterError(ValueError):
    """A chapter that is not what a chapter should be."""


@dataclass(frozen=True, kw_only=True)
class Cell:
    """A code cell, or the text between two of them.

    Attributes:
        code: Whether it is a code cell.
        source: What stands in it.
        line: The line of the chapter on which it begins, from 1.
        options: Its metadata, such as `tags` and `mystnb`.
    """

    code: bool
    source: str
    line: int
    options: Mapping[str, Any]

    @property
    def tags(self) -> tuple[str, ...]:
        """The cell's tags."""
        return tuple(self.options.get("tags", ()))


@dataclass(frozen=True, kw_only=True)
class Chapter:
    """A chapter: a name, by which it is run, and a file.

    Attributes:
        name: Its name for `cpl run`, the file's name without ending.
        path: The file.
        text: What stands in it.
    """

    name: str
    path: Path
    text: str

    @cached_property
    def cells(self) -> tuple[Cell, ...]:
        """The code cells and the texts between them, in order."""
        return tuple(_split(self.text, self.path.name))

    @cached_property
    def code(self) -> str:
        """All code of the chapter, as one Python source."""
        return "\n".join(cell.source for cell in self.cells if cell.code) + "\n"

    @cached_property
    def parameters(self) -> tuple[Parameter, ...]:
        """The declared parameters.

        Raises:
            ChapterError: If the first code cell is not tagged `parameters`, another one is, or a
                declaration is not complete.
        """
        tagged = [("parameters" in cell.tags) for cell in self.cells if cell.code]
        if not tagged or not tagged[0] or sum(tagged) != 1:
            msg = f"{self.path.name}: the first code cell, and no other, must be tagged parameters"
            raise ChapterError(msg)
        cell = next(cell for cell in self.cells if cell.code)
        try:
            return read_parameters(cell.source, self.path.name)
        except DeclarationError as error:
            raise ChapterError(str(error)) from error

    @cached_property
    def title(self) -> str:
        """The chapter's first heading."""
        texts = (cell.source for cell in self.cells if not cell.code)
        found = (re.search(r"^# (.+)$", text, re.MULTILINE) for text in texts)
        return next((match[1].strip() for match in found if match), self.name)


def find_chapters(root: Path) -> dict[str, Chapter]:
    """Return the project's chapters by name, in the order of the table of contents.

    Chapters that are not (yet) in the table of contents come last, by name.

    Args:
        root: The folder that holds `book/` and `_toc.yml`.

    Raises:
        ChapterError: If two chapters have one name.
    """
    order = {path: place for place, path in enumerate(find_pages(root))}
    paths = [path for path in (root / "book").rglob("*.md") if _is_notebook(path)]
    paths.sort(key=lambda path: (order.get(path, len(order)), path))
    found: dict[str, Chapter] = {}
    for path in paths:
        if path.stem in found:
            msg = f"two chapters are called {path.stem!r}: {found[path.stem].path} and {path}"
            raise ChapterError(msg)
        text = path.read_text(encoding="utf-8")
        found[path.stem] = Chapter(name=path.stem, path=path, text=text)
    return found


def find_chapter(root: Path, name: str) -> Chapter:
    """Return the chapter with a name.

    Raises:
        ParameterError: If there is none; the message says which there are.
    """
    found = find_chapters(root)
    if name not in found:
        msg = f"there is no chapter {name!r:.60}{suggestion(name, found)} Chapters: "
        raise ParameterError(msg + ", ".join(found))
    return found[name]


def find_pages(root: Path) -> list[Path]:
    """Return the files that the table of contents names, in its order.

    Raises:
        ChapterError: If it names a file that does not exist.
    """
    toc = root / "_toc.yml"
    if not toc.exists():
        return []
    listed = yaml.safe_load(toc.read_text(encoding="utf-8"))
    pages = [root / f"{name}.md" for name in _files(listed)]
    missing = [page.relative_to(root).as_posix() for page in pages if not page.exists()]
    if missing:
        msg = f"_toc.yml names files that do not exist: {', '.join(missing)}"
        raise ChapterError(msg)
    return pages


def _files(entry: Any) -> Iterator[str]:  # noqa: ANN401 (a tree of lists and mappings)
    if isinstance(entry, list):
        for member in entry:
            yield from _files(member)
    elif isinstance(entry, dict):
        yield from (entry[key] for key in ("root", "file") if key in entry)
        for key in ("parts", "chapters", "sections"):
            yield from _files(entry.get(key, []))


def _is_notebook(path: Path) -> bool:
    header = _HEADER.match(path.read_text(encoding="utf-8"))
    return header is not None and "kernelspec" in (yaml.safe_load(header[1]) or {})


def _split(text: str, where: str) -> Iterator[Cell]:
    header = _HEADER.match(text)
    start = header.end() if header else 0
    for fence in _FENCE.finditer(text, start):
        yield _cell(text, start, fence.start(), {})
        source, options = _options(fence["body"], where)
        line = text.count("\n", 0, fence.start()) + 1
        yield Cell(code=True, source=source, line=line, options=options)
        start = fence.end()
    yield _cell(text, start, len(text), {})


def _cell(text: str, start: int, end: int, options: Mapping[str, Any]) -> Cell:
    line = text.count("\n", 0, start) + 1
    return Cell(code=False, source=text[start:end].strip(), line=line, options=options)


def _options(body: str, where: str) -> tuple[str, Mapping[str, Any]]:
    """Split what stands in a fence into its code and its options, written in either way of MyST."""
    block = _YAML.match(body)
    short = _SHORT.match(body)
    text = block[1] if block else re.sub(r"^:", "", short[0], flags=re.M) if short else ""
    try:
        options = yaml.safe_load(text) or {}
    except yaml.YAMLError as error:
        msg = f"{where}: the options of a code cell are not YAML: {error}"
        raise ChapterError(msg) from error
    end = block.end() if block else short.end() if short else 0
    return body[end:].strip("\n"), options


_HEADER = re.compile(r"\A---\n(.*?)\n---\n", re.DOTALL)
_FENCE = re.compile(
    r"^(?P<ticks>`{3,})\{code-cell\}[^\n]*\n(?P<body>.*?)^(?P=ticks)[ \t]*$",
    re.DOTALL | re.MULTILINE,
)
_YAML = re.compile(r"\A---\n(.*?)^---\n", re.DOTALL | re.MULTILINE)
_SHORT = re.compile(r"\A(?::[\w-]+:[^\n]*\n)+")
