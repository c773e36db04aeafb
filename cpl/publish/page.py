"""One chapter as one HTML file: it can be mailed, and opened without a network.

The renderer is the book's own, with its simplest theme; styles, pictures and MathJax are put into
the page itself.
"""

from __future__ import annotations

import base64
import json
import mimetypes
import re
import tempfile
from collections.abc import Mapping
from html import unescape
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import yaml

from cpl.publish.chapters import Chapter
from cpl.publish.live import files_for_page
from cpl.publish.render import render
from cpl.publish.stage import settings_files, staged_notebook

__all__ = ["standalone"]


def standalone(chapter: Chapter, executed: str, record: Mapping[str, Any], root: Path) -> str:
    """Render an executed chapter as a page that needs no other file and no other host.

    References to other chapters are shown by name only, since those chapters are not there.

    Args:
        chapter: The chapter.
        executed: Its executed notebook.
        record: The provenance of the execution.
        root: The project's folder, whose settings and styles are used.

    Returns:
        The HTML.

    Raises:
        SiteError: If the renderer fails.
    """
    with tempfile.TemporaryDirectory(prefix="cpl-page-") as folder:
        stage = Path(folder) / "stage"
        place = chapter.path.relative_to(root).with_suffix("")
        for path in settings_files(root):
            target = stage / path.relative_to(root)
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_bytes(path.read_bytes())
        for name, content in files_for_page(chapter.text, chapter.name).items():
            target = stage / "book" / name
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_bytes(content)
        notebook = stage / place.with_suffix(".ipynb")
        notebook.parent.mkdir(parents=True, exist_ok=True)
        text = _with_references(staged_notebook(chapter, executed, record), chapter)
        notebook.write_text(text, encoding="utf-8")
        toc = {"format": "jb-book", "root": place.as_posix()}
        (stage / "_toc.yml").write_text(yaml.safe_dump(toc))
        (stage / "_config.yml").write_text(yaml.safe_dump(_plain_theme(root, chapter)))
        site = render(stage, Path(folder) / "out", strict=False)
        page = site / place.with_suffix(".html")
        return _inlined(page.read_text(encoding="utf-8"), page.parent)


def _with_references(notebook: str, chapter: Chapter) -> str:
    """Put the works that the chapter cites before its footer; the book has a page for them."""
    if "{cite" not in chapter.text:
        return notebook
    content = json.loads(notebook)
    source = "## References\n\n```{bibliography}\n:filter: docname in docnames\n```\n"
    cell = {"cell_type": "markdown", "id": "references", "metadata": {}, "source": source}
    content["cells"].insert(-1, cell)
    return json.dumps(content)


def _plain_theme(root: Path, chapter: Chapter) -> dict[str, Any]:
    """Return the book's settings with Sphinx's own basic theme instead of the book's."""
    config = yaml.safe_load((root / "_config.yml").read_text(encoding="utf-8"))
    config["title"] = chapter.title
    inner = config.setdefault("sphinx", {}).setdefault("config", {})
    if "extensions" in inner:
        inner["extensions"] = [name for name in inner["extensions"] if name not in _ONLY_FOR_SITES]
    inner |= {
        "html_theme": "basic",
        "html_theme_options": {"nosidebar": True},
        "html_show_sphinx": False,
        "html_copy_source": False,
        "html_permalinks": False,
    }
    return config


def _inlined(html: str, folder: Path) -> str:
    """Put everything that the page loads into the page, and drop its links to other pages."""
    html = html.replace("<html", '<html data-theme="light"', 1)  # book.css knows two themes
    html = re.sub(r"<script\b[^>]*>.*?</script>", "", html, flags=re.DOTALL)
    html = re.sub(r'<div class="related".*?</div>', "", html, flags=re.DOTALL)
    html = re.sub(r'<link (?:[^>]*)rel="(?!stylesheet)[^"]*"[^>]*>', "", html)
    html = re.sub(r'<link [^>]*href="([^"]+)"[^>]*>', lambda m: _style(m[1], folder), html)
    html = re.sub(r'(<img [^>]*src=)"([^"]+)"', lambda m: f'{m[1]}"{_data(m[2], folder)}"', html)
    scripts = _mathjax() if 'class="math' in html else ""
    head = f'<meta name="viewport" content="width=device-width" /><style>{_CSS}</style>{scripts}'
    return html.replace("</head>", f"{head}</head>", 1)


def _local(address: str, folder: Path) -> Path:
    return folder / unescape(address).partition("?")[0].partition("#")[0]


def _style(address: str, folder: Path) -> str:
    path = _local(address, folder)
    text = path.read_text(encoding="utf-8")
    loaded = re.sub(r"url\(['\"]?([^)'\"]+)['\"]?\)", lambda m: _url(m[1], path.parent), text)
    return f"<style>{loaded}</style>"


def _url(address: str, folder: Path) -> str:
    return f'url("{_data(address, folder)}")'


def _data(address: str, folder: Path) -> str:
    """Return a file as a data address; one that is none of ours stays as it is."""
    if address.startswith(("data:", "#")):
        return address
    path = _local(address, folder)
    kind = mimetypes.guess_type(path.name)[0] or "application/octet-stream"
    return f"data:{kind};base64,{base64.b64encode(path.read_bytes()).decode()}"


def _mathjax() -> str:
    package = find_spec("sphinx-mathjax-offline")
    if package is None or package.origin is None:
        msg = "sphinx-mathjax-offline is not installed"
        raise ModuleNotFoundError(msg)
    code = Path(package.origin).parent / "static" / "mathjax" / "tex-svg.js"
    settings = 'window.MathJax = {options: {enableMenu: false, processHtmlClass: "math"}};'
    text = code.read_text(encoding="utf-8").replace("</script", "<\\/script")
    return f"<script>{settings}</script><script>{text}</script>"


_ONLY_FOR_SITES = ("sphinx_book_theme", "sphinx_copybutton", "sphinx_togglebutton")
_CSS = """
body { max-width: 46rem; margin: 2rem auto; padding: 0 1rem; line-height: 1.6;
       font-family: system-ui, sans-serif; color: #1b1b1b; background: #fff; }
img, svg { max-width: 100%; height: auto; }
pre { overflow-x: auto; padding: .6rem .8rem; background: #f5f6f8; border-radius: 6px; }
table { border-collapse: collapse; display: block; overflow-x: auto; }
td, th { padding: .3rem .6rem; border-bottom: 1px solid #ddd; text-align: left; }
div.body { min-width: 0; max-width: none; }
"""
