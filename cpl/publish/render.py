"""Run Jupyter Book over a stage, offline, with warnings as errors."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

from cpl.publish.stage import remove

__all__ = ["SiteError", "render"]


class SiteError(RuntimeError):
    """The renderer failed or warned; the message is what it said."""


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
        encoding="utf-8",
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
