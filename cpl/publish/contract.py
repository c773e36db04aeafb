"""What every chapter keeps to, so that each one reads like the others.

A chapter is prose with equations and calls: what is looped, plotted, trained or reused lives in
`cpl`. `violations` reads the text only; `unexplained_figures` looks at what an execution drew.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator, Mapping
from typing import Any

from cpl.publish.chapters import Cell, Chapter, ChapterError

__all__ = ["unexplained_figures", "violations"]

CELLS = 12  # code cells in a chapter
LINES = 15  # non-blank lines in a cell
ALT = (40, 300)  # characters of a figure's alternative text

_IN_CPL = (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef, ast.While, ast.Try, ast.TryStar)
_FILE_ENDINGS = (".png", ".svg", ".jpg", ".gif", ".webp")


def violations(chapter: Chapter) -> list[str]:
    """List where the text of a chapter breaks the contract.

    Args:
        chapter: The chapter.

    Returns:
        One line a violation, with the place; empty if there is none.
    """
    code = [cell for cell in chapter.cells if cell.code]
    prose = "\n".join(cell.source for cell in chapter.cells if not cell.code)
    found = list(_parameters(chapter))
    if chapter.title == chapter.name:
        found.append("the chapter has no title (a line that begins with one #)")
    if len(code) > CELLS:
        found.append(f"{len(code)} code cells are more than {CELLS}")
    for cell in code:
        found += [f"line {cell.line}: {problem}" for problem in _of_cell(cell)]
    if len(prose) <= len(chapter.code):
        found.append(f"code ({len(chapter.code)} characters) outweighs prose ({len(prose)})")
    alts = [alt for alt in map(_alt, code) if alt]
    found += [f"the alt text {alt!r:.60} is used twice" for alt in set(alts) if alts.count(alt) > 1]
    return [f"{chapter.path.name}: {problem}" for problem in found]


def unexplained_figures(chapter: Chapter, notebook: Any) -> list[str]:  # noqa: ANN401 (NotebookNode)
    """List the figures that an execution drew without alternative text, or two in one cell.

    Args:
        chapter: The chapter.
        notebook: Its executed notebook.

    Returns:
        One line a violation; empty if there is none.
    """
    found: list[str] = []
    for cell in notebook.cells:
        images = [out for out in cell.get("outputs", ()) if _is_image(out.get("data", {}))]
        head = next(iter(cell.source.strip().splitlines()), "")
        if len(images) > 1:
            found.append(f"{chapter.path.name}: {head!r} draws {len(images)} figures in one cell")
        alt = cell.metadata.get("mystnb", {}).get("image", {}).get("alt")
        if images and not alt:
            found.append(f"{chapter.path.name}: the figure of {head!r} has no alt text")
    return found


def _parameters(chapter: Chapter) -> Iterator[str]:
    try:
        names = [parameter.name for parameter in chapter.parameters]
    except ChapterError as error:
        yield str(error)
        return
    nodes = [node for node in ast.walk(_tree(chapter.code)) if isinstance(node, ast.Name)]
    stored = [node.id for node in nodes if isinstance(node.ctx, ast.Store)]
    yield from (f"parameter {name} is assigned again" for name in names if stored.count(name) > 1)


def _of_cell(cell: Cell) -> Iterator[str]:
    lines = sum(bool(line.strip()) for line in cell.source.splitlines())
    if lines > LINES:
        yield f"{lines} lines in a cell are more than {LINES}"
    tree = _tree(cell.source)
    if "exercise" not in cell.tags:
        for node in ast.walk(tree):
            if isinstance(node, _IN_CPL):
                yield f"{type(node).__name__} belongs into cpl, not into a chapter"
    alt = _alt(cell)
    shows = "figure" in cell.options.get("mystnb", {}) or _draws(tree)
    if shows and not alt:
        yield "a figure without alt text (mystnb: {image: {alt: ...}})"
    if alt and not ALT[0] <= len(alt) <= ALT[1]:
        yield f"the alt text has {len(alt)} characters, allowed are {ALT[0]} to {ALT[1]}"
    if alt and alt.lower().endswith(_FILE_ENDINGS):
        yield "the alt text is a file name"


def _alt(cell: Cell) -> str:
    options: Mapping[str, Any] = cell.options.get("mystnb", {}) or {}
    return " ".join(str((options.get("image") or {}).get("alt") or "").split())


def _draws(tree: ast.Module) -> bool:
    """Whether a cell ends with a call of something imported from a module of figures."""
    figures = {
        alias.asname or alias.name
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("cpl.figures")
        for alias in node.names
        if not f"{node.module}.{alias.name}".startswith("cpl.figures.table")
    }
    last = tree.body[-1] if tree.body else None
    if not isinstance(last, ast.Expr) or not isinstance(last.value, ast.Call):
        return False
    called = last.value.func
    while isinstance(called, ast.Attribute):
        called = called.value
    return isinstance(called, ast.Name) and called.id in figures


def _is_image(data: Mapping[str, Any]) -> bool:
    return any(kind.startswith("image/") for kind in data)


def _tree(code: str) -> ast.Module:
    try:
        return ast.parse(code)
    except SyntaxError:
        return ast.Module(body=[], type_ignores=[])  # ruff says so, with the place
