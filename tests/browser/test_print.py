"""The book on paper: one PDF with tags, bookmarks and links that lead somewhere."""

import pytest

from cpl.publish.pdf import book_document, write_pdf
from cpl.store import project_root

pytestmark = pytest.mark.browser


@pytest.fixture(scope="module")
def printed(site, tmp_path_factory):
    from pypdf import PdfReader

    document = book_document(site, project_root() / "_toc.yml")
    path = write_pdf(site, document, tmp_path_factory.mktemp("pdf") / "book.pdf")
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
    order = ["What was found", "The question of this chapter", "Two walls", "Glossary"]
    places = [text.index(words) for words in order]
    assert places == sorted(places)


def test_every_picture_has_a_description(printed):
    kinds, described = count_figures(printed.trailer["/Root"]["/StructTreeRoot"])
    assert kinds > 10
    assert described == kinds


def count_figures(node):
    """Count the figures of a structure tree, and those with a text in their place."""
    found = described = 0
    waiting = [node]
    while waiting:
        node = waiting.pop().get_object()
        if isinstance(node, list):
            waiting.extend(node)
        elif isinstance(node, dict):
            if node.get("/S") == "/Figure":
                found += 1
                described += bool(node.get("/Alt"))
            if "/K" in node:
                waiting.append(node["/K"])
    return found, described
