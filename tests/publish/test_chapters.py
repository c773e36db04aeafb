"""Chapters are found and split as jupytext splits them, without importing it."""

import jupytext
import pytest

from cpl.publish.chapters import Chapter, ChapterError, find_chapter, find_chapters, find_pages
from cpl.settings.words import ParameterError
from cpl.store import project_root


def chapter(path, text):
    return Chapter(name=path.stem, path=path, text=text)


def test_chapters_come_in_the_order_of_the_contents(project, header):
    root = project(zebra=header + "# Z\n", ape=header + "# A\n")
    (root / "book" / "draft.md").write_text(header + "# Draft\n")
    assert list(find_chapters(root)) == ["zebra", "ape", "draft"]
    assert [page.stem for page in find_pages(root)] == ["front", "zebra", "ape"]
    assert find_chapter(root, "ape").title == "A"


def test_an_unknown_chapter_is_refused_with_the_nearest_name(project):
    root = project()
    with pytest.raises(ParameterError, match=r"did you mean 'small'\? Chapters: small"):
        find_chapter(root, "smalll")
    with pytest.raises(ParameterError, match="there is no chapter"):
        find_chapter(root, "../book/small")


def test_two_chapters_of_one_name_are_refused(project, header):
    root = project()
    (root / "book" / "part").mkdir()
    (root / "book" / "part" / "small.md").write_text(header)
    with pytest.raises(ChapterError, match="two chapters are called 'small'"):
        find_chapters(root)


def test_contents_may_not_name_what_is_not_there(project):
    root = project()
    (root / "book" / "front.md").unlink()
    with pytest.raises(ChapterError, match=r"book/front\.md"):
        find_pages(root)


@pytest.mark.parametrize("options", [":tags: [a, b]\n", "---\ntags: [a, b]\n---\n"])
def test_both_ways_to_write_options_are_read(tmp_path, header, options):
    text = f"{header}# T\n\n```{{code-cell}} ipython3\n{options}x = 1\n\ny = 2\n```\nafter\n"
    title, cell, after = chapter(tmp_path / "a.md", text).cells
    assert (cell.tags, cell.source, cell.line) == (("a", "b"), "x = 1\n\ny = 2", 9)
    assert (title.source, after.source) == ("# T", "after")


def test_every_chapter_of_the_book_is_split_as_jupytext_splits_it():
    for found in find_chapters(project_root()).values():
        notebook = jupytext.reads(found.text, fmt="md:myst")
        expected = [cell for cell in notebook.cells if cell.cell_type == "code"]
        cells = [cell for cell in found.cells if cell.code]
        assert [cell.source for cell in cells] == [cell.source for cell in expected]
        assert [list(cell.tags) for cell in cells] == [
            cell.metadata.get("tags", []) for cell in expected
        ]


def test_the_first_cell_and_no_other_holds_the_parameters(tmp_path, header):
    cell = "```{code-cell} ipython3\n:tags: [parameters]\na: int = 1  # [-] any: one\n```\n"
    plain = "```{code-cell} ipython3\nx = 1\n```\n"
    assert len(chapter(tmp_path / "a.md", header + cell + plain).parameters) == 1
    for wrong in ("", plain, plain + cell, cell + cell):
        with pytest.raises(ChapterError, match="first code cell, and no other"):
            _ = chapter(tmp_path / "a.md", header + wrong).parameters


def test_options_that_are_not_yaml_are_an_error(tmp_path, header):
    text = f"{header}```{{code-cell}} ipython3\n---\na: [\n---\nx\n```\n"
    with pytest.raises(ChapterError, match="not YAML"):
        _ = chapter(tmp_path / "a.md", text).cells
