"""The whole book as one tagged PDF, with bookmarks, made by Chromium from the rendered site.

All pages are put into one document, part by part, their headings one level lower and their
addresses made unique; links between pages become links within the document. Live figures are
replaced by their pictures, and code that pages fold away is left out.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from html import escape
from pathlib import Path
from typing import Any

import yaml

from cpl.store import atomic_write

__all__ = ["PdfError", "book_document", "checklist_document", "print_book", "write_pdf"]

_PAGES = "book/"  # where pages lie within the site
_GONE = (
    "script", "a.headerlink", ".live-stage", "details.hide", ".prev-next-footer", "button",
    ".toggle-button", ".book-parts", "#how-this-page-was-made",
)  # fmt: skip
_CHECKLIST = ("book/run_it", "checklist")
_POINTS_AT = ("for", "aria-labelledby", "aria-describedby", "headers")


class PdfError(RuntimeError):
    """The book cannot be printed; the message says what is missing."""


def book_document(site: Path, toc: Path) -> str:
    """Put all pages of the site into one.

    Args:
        site: The rendered site.
        toc: The table of contents, `_toc.yml`.

    Returns:
        HTML for a file beside the pages, `book/*.html`.

    Raises:
        PdfError: If a page of the table of contents is not there.
    """
    contents = yaml.safe_load(toc.read_text(encoding="utf-8"))
    parts = [("", [contents["root"]])] + [
        ("Part " + part["caption"].replace(" · ", ": "), list(_files(part["chapters"])))
        for part in contents["parts"]
    ]
    inside = {file for _, files in parts for file in files}
    body, listing = [], []
    for caption, files in parts:
        if caption:
            body.append(f'<h1 class="part">{escape(caption)}</h1>')
            listing.append(f"<li><strong>{escape(caption)}</strong></li>")
        for file in files:
            title, article = _article(site, file, inside)
            body.append(article)
            listing.append(f'<li><a href="#{_prefix(file)}">{escape(title)}</a></li>')
    title = _head(site, contents["root"]).select_one("article h1").find(string=True).strip()
    front = (
        f'<h1 class="book-title">{escape(title)}</h1><p>The whole book. Live figures are shown as'
        f" pictures; code that the pages fold away is left out.</p>"
        f'<nav aria-label="Contents"><ul>{"".join(listing)}</ul></nav>'
    )
    return _document(site, contents["root"], title, front + "".join(body))


def checklist_document(site: Path, page: str, section: str) -> str:
    """Take one section of a page, such as a checklist that is ticked off on paper.

    Args:
        site: The rendered site.
        page: The page without ending, such as `book/run_it`.
        section: The id of the section.

    Raises:
        PdfError: If there is no such page or section.
    """
    soup = _head(site, page)
    found = soup.find(id=section)
    if found is None:
        raise PdfError(f"{page} has no section {section!r}")
    _strip(found)
    title = found.find(["h1", "h2", "h3"]).get_text().strip()
    for heading in found.find_all(["h2", "h3", "h4"]):
        heading.name = f"h{int(heading.name[1]) - 1}"
    for box in found.find_all("input"):
        box.replace_with("☐ ")
    return _document(site, page, title, str(found))


def print_book(root: Path) -> list[Path]:
    """Print the rendered book and, if it has one, the checklist of a run.

    Args:
        root: The project's folder; the site is in `_build/html`.

    Returns:
        The PDFs, in `_build/pdf`.

    Raises:
        PdfError: If the book is not rendered or there is no Chromium.
    """
    site, target = root / "_build" / "html", root / "_build" / "pdf"
    document = book_document(site, root / "_toc.yml")
    made = [write_pdf(site, document, target / "conformal-policy-learning.pdf")]
    page, section = _CHECKLIST
    if _has(site, page) and _head(site, page).find(id=section) is not None:
        checklist = checklist_document(site, page, section)
        made.append(write_pdf(site, checklist, target / "run-checklist.pdf"))
    return made


def write_pdf(site: Path, document: str, target: Path, *, timeout_s: float = 300) -> Path:
    """Print a document that lies beside the pages of a site.

    Args:
        site: The rendered site.
        document: HTML, as `book_document` returns it.
        target: The PDF.
        timeout_s: How long Chromium may take [s].

    Returns:
        The PDF.

    Raises:
        PdfError: If there is no Chromium, or it complains about the document.
    """
    beside = site / _PAGES / f"_print-{os.getpid()}.html"  # two may print at a time
    atomic_write(beside, document)
    try:
        content = _print(beside, timeout_s)
    finally:
        beside.unlink()
    target.parent.mkdir(parents=True, exist_ok=True)
    return atomic_write(target, content)


def _print(page: Path, timeout_s: float) -> bytes:
    try:
        from playwright.sync_api import sync_playwright
    except ModuleNotFoundError as error:
        raise PdfError("printing needs the extra `browser`: pip install -e .[browser]") from error
    chromium = os.environ.get("CHROMIUM") or shutil.which("chromium") or shutil.which("chrome")
    if not chromium:
        raise PdfError("no Chromium found: install the package chromium, or set CHROMIUM")
    complaints: list[str] = []
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path=chromium, args=["--no-sandbox", "--disable-gpu"]
        )
        tab = browser.new_page(color_scheme="light", reduced_motion="reduce")
        tab.set_default_timeout(1000 * timeout_s)
        tab.on("pageerror", lambda error: complaints.append(str(error)))
        tab.goto(page.as_uri(), wait_until="load")
        tab.evaluate("() => window.MathJax?.startup?.promise")
        content = tab.pdf(
            format="A4",
            tagged=True,
            outline=True,
            display_header_footer=True,
            header_template="<span></span>",
            footer_template=_FOOTER,
            margin={"top": "18mm", "bottom": "20mm", "left": "20mm", "right": "20mm"},
            print_background=True,
        )
        browser.close()
    if complaints:
        raise PdfError("the document complains: " + "; ".join(complaints))
    return content


def _files(chapters: list[Any]) -> Iterator[str]:
    for chapter in chapters:
        yield chapter["file"]
        yield from _files(chapter.get("sections", []))


def _head(site: Path, file: str) -> Any:  # noqa: ANN401 (bs4 has no types worth the name)
    from bs4 import BeautifulSoup

    path = site / f"{file}.html"
    if not path.is_file():
        raise PdfError(f"{file} is not rendered: build the book first")
    return BeautifulSoup(path.read_text(encoding="utf-8"), "html.parser")


def _prefix(file: str) -> str:
    return f"page-{file.rpartition('/')[2]}"


def _article(site: Path, file: str, inside: set[str]) -> tuple[str, str]:
    """Return a page's title and its text, fit to stand among the others."""
    article = _head(site, file).select_one("article.bd-article")
    _strip(article)
    prefix = _prefix(file)
    for node in article.find_all(True):
        if node.get("id"):
            node["id"] = f"{prefix}--{node['id']}"
        for name in _POINTS_AT:
            if node.get(name):
                node[name] = " ".join(f"{prefix}--{one}" for one in _words(node[name]))
        if node.name == "a" and node.get("href"):
            _relink(node, prefix, inside)
        if node.name in ("h1", "h2", "h3", "h4", "h5"):
            node.name = f"h{int(node.name[1]) + 1}"
        if node.name == "details":
            node["open"] = ""
    title = article.find("h2").get_text().strip()
    return title, f'<section class="page" id="{prefix}">{article.decode_contents()}</section>'


def _strip(article: Any) -> None:  # noqa: ANN401
    for selector in _GONE:
        for node in article.select(selector):
            node.decompose()


def _words(value: str | list[str]) -> list[str]:
    return value.split() if isinstance(value, str) else value


def _relink(link: Any, prefix: str, inside: set[str]) -> None:  # noqa: ANN401
    """Point a link to the place within the document; other addresses of the site lose theirs."""
    page, _, anchor = link["href"].partition("#")
    if page.startswith(("http:", "https:", "mailto:")):
        return
    name = page.removesuffix(".html")
    if page and f"{_PAGES}{name}" not in inside:
        link.unwrap()
        return
    target = f"page-{name}" if page else prefix
    link["href"] = f"#{target}--{anchor}" if anchor else f"#{target}"


def _document(site: Path, page: str, title: str, body: str) -> str:
    """Wrap a text with the styles and the MathJax of a page of the site."""
    head = _head(site, page).head
    styles = [str(link) for link in head.select('link[rel="stylesheet"]')]
    scripts = _mathjax(site)
    return (
        f'<!DOCTYPE html>\n<html lang="en" data-theme="light"><head><meta charset="utf-8">'
        f"<title>{escape(title)}</title>{''.join(styles)}<style>{_CSS}</style>{''.join(scripts)}"
        f'</head><body><main class="bd-content"><article class="bd-article">{body}</article></main>'
        f"</body></html>\n"
    )


def _mathjax(site: Path) -> list[str]:
    """Return the scripts with which the site's pages set mathematics; not every page has them."""
    for path in sorted((site / _PAGES).glob("*.html")):
        scripts = _head(site, f"{_PAGES}{path.stem}").select("script")
        found = [str(script) for script in scripts if "mathjax" in str(script).lower()]
        if found:
            return found
    return []


def _has(site: Path, page: str) -> bool:
    return (site / f"{page}.html").is_file()


_FOOTER = (
    '<div style="font: 8px sans-serif; width: 100%; text-align: center; color: #444">'
    '<span class="pageNumber"></span></div>'
)
_CSS = """
html, body { background: #fff; color: #111; font-size: 10.5pt; height: auto; overflow: visible; }
main, article { display: block; max-width: none; padding: 0; margin: 0; }
.bd-article { line-height: 1.5; overflow: visible; }
.bd-article h1, .bd-article h2 { break-before: page; break-after: avoid; }
.bd-article h1.book-title { break-before: auto; margin-top: 30vh; }
.bd-article h1.part + .page h2 { break-before: auto; }
h3, h4, h5 { break-after: avoid; }
pre, code { white-space: pre-wrap; overflow-wrap: anywhere; }
figure, img, div.proof, table tr { break-inside: avoid; }
img { max-height: 19cm; }
table { width: 100%; font-size: 8.5pt; overflow-wrap: break-word; }
.pst-scrollable-table-container, div.cell_output { overflow: visible; }
.live-fallback { display: block; }
nav ul { list-style: none; padding: 0; }
nav li strong { display: block; margin-top: .6em; }
.checklist input, .task-list-item { break-inside: avoid; }
"""
