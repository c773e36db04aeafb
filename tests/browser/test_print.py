"""The book on paper: one PDF with tags, bookmarks and links that lead somewhere."""

import subprocess
import sys

import pytest

from cpl.store import project_root

pytestmark = pytest.mark.browser

PRINT = """
import sys
from pathlib import Path
from cpl.publish.pdf import book_document, write_pdf
site, root, target = map(Path, sys.argv[1:])
write_pdf(site, book_document(site, root / "_toc.yml"), target)
"""


@pytest.fixture(scope="module")
def printed(site, tmp_path_factory):
    from pypdf import PdfReader

    path = tmp_path_factory.mktemp("pdf") / "book.pdf"
    # In a process of its own: the tests' browser has its event loop in this one.
    subprocess.run([sys.executable, "-c", PRINT, site, project_root(), path], check=True)
    return PdfReader(path)


def titles(outline, depth=0):
    for entry in outline:
        if isinstance(entry, list):
            yield from titles(entry, depth + 1)
        else:
            yield depth, entry.title


def test_the_pdf_is_tagged_and_says_its_language_and_title(printed):
    root = printed.trailer["/Root"]
    assert root["/MarkInfo"]["/Marked"]
    assert root["/StructTreeRoot"]
    assert root["/Lang"] == "en"
    assert printed.metadata.title == "Conformal Policy Learning"


def test_bookmarks_follow_the_table_of_contents(printed):
    found = list(titles(printed.outline))
    parts = [title for depth, title in found if depth == 0]
    chapters = [title for depth, title in found if depth == 1]
    assert parts[0] == "Conformal Policy Learning"
    assert all(part.startswith("Part ") for part in parts[1:])
    assert "Theorem 1, and how much it really promises" in chapters
    assert len(chapters) == len(set(chapters))


def test_text_is_read_in_the_order_of_the_pages(printed):
    text = "\n".join(page.extract_text() for page in printed.pages)
    order = ["What was found", "Two walls"]
    places = [text.index(words) for words in order]
    assert places == sorted(places)


def test_every_picture_has_a_description(printed):
    kinds, described = count_figures(printed.trailer["/Root"]["/StructTreeRoot"])
    assert kinds > 10
    assert described == kinds


def count_figures(node):
    """Count the pictures of a structure tree, and those with a text in their place.

    HTML's figure becomes a figure around the picture's own: the innermost is the picture.
    """
    node = node.get_object()
    if isinstance(node, list):
        counted = [count_figures(part) for part in node]
    elif isinstance(node, dict):
        counted = [count_figures(node["/K"])] if "/K" in node else []
    else:
        return 0, 0
    found, described = (sum(counts) for counts in zip(*counted, strict=True)) if counted else (0, 0)
    if isinstance(node, dict) and node.get("/S") == "/Figure" and not found:
        return 1, int(bool(node.get("/Alt")))
    return found, described
