"""Render the stage with Jupyter Book, offline, with warnings as errors."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

from cpl.publish.chapters import find_chapters, find_pages
from cpl.publish.run import Report, execute_all
from cpl.publish.stage import remove, write_stage
from cpl.store import atomic_write

__all__ = ["SiteError", "build", "render"]


class SiteError(RuntimeError):
    """The renderer failed or warned; the message is what it said."""


def build(root: Path, *, jobs: int = 2, report: Report = print) -> Path:
    """Build the site: execute what is not at hand, lay it out, render it.

    Args:
        root: The project's folder.
        jobs: How many chapters run at a time.
        report: Told what is going on.

    Returns:
        The front page, `_build/html/index.html`.

    Raises:
        ExecutionError: If a chapter fails.
        SiteError: If the renderer fails or warns; the old site is then left as it was.
    """
    pages = set(find_pages(root))
    chapters = {n: c for n, c in find_chapters(root).items() if c.path in pages}
    executed = execute_all(list(chapters.values()), root, jobs=jobs, report=report)
    stage = root / "_build" / "stage"
    write_stage(stage, root, chapters, executed)
    report(f"rendering {len(pages)} pages")
    fresh = render(stage, root / "_build" / "render")
    front = find_pages(root)[0].relative_to(root).with_suffix(".html").as_posix()
    atomic_write(fresh / "index.html", _ENTRANCE.format(front=front))
    site, old = root / "_build" / "html", root / "_build" / "html.old"
    remove(old)
    if site.exists():
        site.rename(old)
    fresh.rename(site)
    remove(old)
    return site / "index.html"


def render(stage: Path, output: Path, *, strict: bool = True) -> Path:
    """Run Jupyter Book over a stage, from nothing: only then are its warnings complete.

    Args:
        stage: Folder with pages, `_config.yml` and `_toc.yml`.
        output: Folder for what the renderer writes; emptied first.
        strict: Whether a warning is an error.

    Returns:
        The folder of the rendered pages.

    Raises:
        SiteError: If it fails, or warns and is strict.
    """
    remove(output)
    words = ["build", str(stage), "--path-output", str(output), "--all", "--quiet"]
    words += ["-W", "--keep-going"] if strict else []
    done = subprocess.run(
        [sys.executable, "-c", "from jupyter_book.cli.main import main; main()", *words],
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "PYTHONWARNINGS": "ignore", "PYTHONPATH": str(stage / "book" / "_ext")},
    )
    pages = output / "_build" / "html"
    if done.returncode != 0 or not (pages / "index.html").exists():
        raise SiteError(_complaints(done.stdout + done.stderr, stage))
    return pages


def _complaints(said: str, stage: Path) -> str:
    """Return the warnings and errors among what the renderer said, else all of it."""
    plain = re.sub(r"\x1b\[[0-9;]*m", "", said).replace(f"{stage}{os.sep}", "")
    # myst-nb counts 10000 lines a cell.
    plain = re.sub(
        r"(\S+)\.ipynb:(\d+)\d{4}:", lambda m: f"{m[1]}.md, {m[2]}. cell of the notebook:", plain
    )
    lines = [line for line in plain.splitlines() if "WARNING" in line or "ERROR" in line]
    return "the renderer complains\n\n" + ("\n".join(lines) or plain.strip())


# A static host and a reader with a file manager both open index.html first.
_ENTRANCE = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8" />
<meta http-equiv="refresh" content="0; url={front}" />
<title>To the front page</title>
</head>
<body><p><a href="{front}">To the front page</a></p></body>
</html>
"""
