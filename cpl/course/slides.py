"""Make the lectures' slides of the figures and numbers that the chapters have computed.

A lecture is `book/_slides/lecture_*.md`. Nothing in it is typed that a chapter computes:

    {value}`theory:exact`                 the number that the chapter `theory` glued as `exact`
    ```{chapter-figure} theory:fig-worst  the figure of that name, with its alternative text
    ```

Both are taken from the executed chapters; sphinx-revealjs makes the slides, which need no network.
Each slide has speaker notes (key S) that begin with the minutes it takes.
"""

from __future__ import annotations

import ast
import base64
import json
import os
import re
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cpl.publish.render import SiteError
from cpl.publish.stage import remove
from cpl.store import atomic_write

__all__ = ["Harvest", "build_slides", "expand", "harvest", "lectures", "minutes_of"]


@dataclass(frozen=True, kw_only=True)
class _Picture:
    content: bytes
    ending: str
    alt: str


@dataclass(frozen=True, kw_only=True)
class Harvest:
    """What an executed chapter offers to a slide.

    Attributes:
        title: The chapter's title.
        values: The numbers that it glued, as text, by name.
        pictures: Its figures by name.
    """

    title: str
    values: Mapping[str, str]
    pictures: Mapping[str, _Picture]


def lectures(root: Path) -> list[Path]:
    """Return the sources of the lectures, in order."""
    return sorted((root / "book" / "_slides").glob("lecture_*.md"))


def minutes_of(text: str) -> int:
    r"""Return how long a lecture takes [min], by its speaker notes.

    Examples:
        >>> note = "```{revealjs-notes}\n(4 min) Ask.\n```\n"
        >>> minutes_of(note + note)
        8
    """
    return sum(int(found) for found in _MINUTES.findall(text))


def harvest(executed: str, title: str) -> Harvest:
    """Collect what an executed notebook computed.

    Args:
        executed: The notebook, as text.
        title: The chapter's title.
    """
    values: dict[str, str] = {}
    pictures: dict[str, _Picture] = {}
    for cell in json.loads(executed)["cells"]:
        options = cell["metadata"].get("mystnb", {})
        for output in cell.get("outputs", ()):
            data: Mapping[str, Any] = output.get("data", {})
            glued = output.get("metadata", {}).get("scrapbook", {}).get("name")
            if glued:
                values[glued] = str(ast.literal_eval("".join(next(iter(data.values())))))
            name = options.get("figure", {}).get("name")
            alt = " ".join(str(options.get("image", {}).get("alt", "")).split())
            if name and "image/svg+xml" in data:
                content = "".join(data["image/svg+xml"]).encode()
                pictures[name] = _Picture(content=content, ending="svg", alt=alt)
            elif name and "image/png" in data:
                content = base64.b64decode("".join(data["image/png"]))
                pictures[name] = _Picture(content=content, ending="png", alt=alt)
    return Harvest(title=title, values=values, pictures=pictures)


def expand(text: str, chapters: Mapping[str, Harvest]) -> tuple[str, dict[str, bytes]]:
    """Put values and figures of the chapters into a lecture.

    Args:
        text: The lecture as it is written.
        chapters: What the chapters offer, by their names.

    Returns:
        The lecture for the renderer, and the pictures it shows, by file name.

    Raises:
        ValueError: If it asks for something that no chapter offers.
    """
    files: dict[str, bytes] = {}

    def found(match: re.Match[str], kind: str) -> Any:  # noqa: ANN401
        chapter, _, name = match["what"].strip().partition(":")
        offered = getattr(chapters[chapter], kind) if chapter in chapters else {}
        if name not in offered:
            msg = f"a lecture shows {match['what'].strip()!r}, which no chapter offers"
            raise ValueError(msg)
        return offered[name]

    def picture(match: re.Match[str]) -> str:
        chapter, _, name = match["what"].strip().partition(":")
        one = found(match, "pictures")
        file = f"{chapter}-{name}.{one.ending}"
        files[file] = one.content
        source = f"{chapters[chapter].title} · `cpl run {chapter}`"
        return f"```{{figure}} images/{file}\n:alt: {one.alt}\n\n{source}\n```"

    text = _PICTURE.sub(picture, text)
    return _VALUE.sub(lambda match: found(match, "values"), text), files


def build_slides(
    root: Path, chapters: Mapping[str, Harvest], work: Path, output: Path, *, notes: bool = True
) -> Path:
    """Render the slides of all lectures.

    Args:
        root: The project's folder.
        chapters: What the chapters offer, by their names.
        work: A folder for the renderer's sources; emptied first.
        output: The folder for the slides; emptied first.
        notes: Whether the speaker's notes are kept; they have answers to exercises.

    Returns:
        The page from which the lectures are opened.

    Raises:
        SiteError: If the renderer fails or warns.
        ValueError: If a lecture asks for something that no chapter offers.
    """
    remove(work)
    remove(output)
    for source in lectures(root):
        written = source.read_text(encoding="utf-8")
        text, files = expand(written if notes else _NOTES.sub("", written), chapters)
        atomic_write(work / source.name, text)
        for name, content in files.items():
            atomic_write(work / "images" / name, content)
    folder = root / "book" / "_slides"
    atomic_write(work / "index.md", (folder / "index.md").read_bytes())
    atomic_write(work / "_static" / "slides.css", (folder / "slides.css").read_bytes())
    atomic_write(work / "conf.py", _CONF)
    doctrees = work / "_doctrees"
    words = ["-b", "revealjs", "-W", "--keep-going", "-q", "-d", str(doctrees), str(work)]
    done = subprocess.run(
        [sys.executable, "-m", "sphinx", *words, str(output)],
        capture_output=True,
        encoding="utf-8",
        check=False,
        env={
            **os.environ,
            "PYTHONWARNINGS": "ignore",
            "PYTHONPATH": str(root / "book" / "_ext"),
        },
    )
    if done.returncode != 0:
        msg = "the slides' renderer complains\n\n" + (done.stdout + done.stderr).strip()
        raise SiteError(msg)
    return output / "index.html"


_VALUE = re.compile(r"\{value\}`(?P<what>[^`]+)`")
_PICTURE = re.compile(
    r"^```\{chapter-figure\} *(?P<what>[^\n]+)\n```[ \t]*$",
    re.MULTILINE,
)
_NOTES = re.compile(r"^```\{revealjs-notes\}\n.*?^```[ \t]*$\n?", re.DOTALL | re.MULTILINE)
_MINUTES = re.compile(r"^```\{revealjs-notes\}\n\((\d+) min\)", re.MULTILINE)
_CONF = """# What sphinx-revealjs needs to know.
project = "Conformal Policy Learning: lectures"
copyright = "2026, the cpl authors"
language = "en"
extensions = ["myst_parser", "sphinx.ext.mathjax", "sphinx_revealjs", "offline"]
myst_enable_extensions = ["amsmath", "attrs_inline", "colon_fence", "dollarmath"]
suppress_warnings = ["myst.header"]
revealjs_html_theme = "revealjs-simple"
revealjs_style_theme = "white"
revealjs_static_path = ["_static"]
revealjs_css_files = ["slides.css"]
revealjs_script_plugins = [
    {"name": "RevealNotes", "src": "revealjs/plugin/notes/notes.js"},
]
revealjs_script_conf = {
    "controls": True, "progress": True, "slideNumber": "c/t", "hash": True, "center": False,
    "navigationMode": "linear", "transition": "none", "width": 1200, "height": 720,
}
"""
