"""Lay the book out for the renderer: executed chapters, plain pages, settings.

The stage is a folder of its own, `_build/stage`, so that the renderer sees notebooks that are
executed already and the sources stay what they are. A file is written only if it changed.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from cpl.publish.chapters import Chapter, ChapterError, find_pages
from cpl.publish.contract import unexplained_figures
from cpl.publish.execute import with_outputs
from cpl.publish.live import files_for_site
from cpl.publish.provenance import footer
from cpl.store import atomic_write

__all__ = ["remove", "settings_files", "staged_notebook", "write_stage"]


def write_stage(
    stage: Path,
    root: Path,
    chapters: Mapping[str, Chapter],
    executed: Mapping[str, tuple[str, Mapping[str, Any]]],
) -> None:
    """Make the stage hold exactly what the site is rendered from.

    Args:
        stage: The folder; what is in it and no longer needed is removed.
        root: The project's folder.
        chapters: The chapters of the site by name.
        executed: Notebook and provenance of each.
    """
    wanted: dict[Path, bytes] = {}
    for name, chapter in chapters.items():
        notebook, record = executed[name]
        place = chapter.path.relative_to(root).with_suffix(".ipynb")
        wanted[place] = staged_notebook(chapter, notebook, record).encode()
    notebooks = {chapter.path for chapter in chapters.values()}
    pages = [path for path in find_pages(root) if path not in notebooks]
    for path in [*pages, *settings_files(root)]:
        wanted[path.relative_to(root)] = path.read_bytes()
    text = "\n".join(page.read_text(encoding="utf-8") for page in find_pages(root))
    wanted |= {Path("book") / place: content for place, content in files_for_site(text).items()}
    for place, content in wanted.items():
        target = stage / place
        if not target.is_file() or target.read_bytes() != content:
            atomic_write(target, content)
    for path in sorted(stage.rglob("*"), reverse=True):
        if path.is_file() and path.relative_to(stage) not in wanted:
            path.unlink()
        elif path.is_dir() and not any(path.iterdir()):
            path.rmdir()


def staged_notebook(chapter: Chapter, executed: str, record: Mapping[str, Any]) -> str:
    """Return the notebook that is published: today's text, kept outputs, and the footer.

    Raises:
        ChapterError: If a figure has no alternative text, or shares its cell with another one.
    """
    import nbformat

    old = nbformat.reads(executed, as_version=4)
    notebook = old if record["chosen"] else with_outputs(chapter, old)
    if problems := unexplained_figures(chapter, notebook):
        raise ChapterError("\n".join(problems))
    notebook.cells.append(nbformat.v4.new_markdown_cell(footer(chapter, record), id="provenance"))
    return json.dumps(notebook, indent=1, sort_keys=True, ensure_ascii=False) + "\n"


def settings_files(root: Path) -> list[Path]:
    """Return the files that the renderer needs beside the pages."""
    book = root / "book"
    folders = [book / "_ext", book / "_static", book / "images"]
    inside = [path for folder in folders for path in sorted(folder.rglob("*")) if path.is_file()]
    named = [root / "_config.yml", root / "_toc.yml", *sorted(book.glob("*.bib"))]
    return [*named, *(path for path in inside if "__pycache__" not in path.parts)]


def remove(folder: Path) -> None:
    """Remove a folder if it exists."""
    if folder.exists():
        shutil.rmtree(folder)
