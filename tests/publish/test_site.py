"""A small book is built from its sources, and a run leaves a page that stands alone."""

import json
import re

import nbformat
import pytest

from cpl.publish.chapters import ChapterError, find_chapter, find_chapters
from cpl.publish.execute import as_notebook
from cpl.publish.render import SiteError, render
from cpl.publish.run import execute_all, new_folder, run_chapter
from cpl.publish.site import build
from cpl.publish.stage import staged_notebook, write_stage


def test_a_book_is_built_and_an_improved_text_needs_no_execution(project):
    root = project()
    said = []
    page = build(root, report=said.append)
    html = (page.parent / "book" / "small.html").read_text()
    assert "The double is <span" in html
    assert ">0.20<" in html
    assert "How this page was made" in html
    assert "cpl run small" in re.sub("<[^>]*>", "", html)
    assert any("executing small" in line for line in said)
    download = page.parent / "_sources" / "book" / "small.ipynb"
    assert nbformat.read(download, as_version=4).cells[-1].id == "provenance"

    path = root / "book" / "small.md"
    path.write_text(path.read_text().replace("A small chapter", "A better title"))
    said.clear()
    chapters = find_chapters(root)
    write_stage(stage := root / "_build" / "stage", root, chapters, kept(chapters, root, said))
    assert "A better title" in (stage / "book" / "small.ipynb").read_text()
    assert said == ["1 of 1 chapters are up to date"]


def kept(chapters, root, said):
    return execute_all(list(chapters.values()), root, report=said.append)


def test_a_warning_is_an_error_and_names_the_page(project):
    root = project(small="---\nkernelspec: {name: python3}\n---\n# S\n")
    stage = root / "_build" / "stage"
    write_stage(stage, root, {}, {})
    (stage / "book" / "front.md").write_text("# Front\n\n{ref}`nowhere`\n")
    with pytest.raises(SiteError, match=r"front\.md:3: WARNING: undefined label"):
        render(stage, root / "_build" / "render")


def test_a_run_writes_notebook_page_and_provenance(project):
    root = project()
    chapter = find_chapter(root, "small")
    folder = run_chapter(chapter, {"alpha": 0.3}, root / "out", root)
    assert sorted(path.name for path in folder.iterdir()) == [
        "small.html",
        "small.ipynb",
        "small.json",
    ]
    made = json.loads((folder / "small.json").read_text())
    assert made["parameters"]["alpha"] == 0.3
    assert made["seconds"] > 0
    html = (folder / "small.html").read_text()
    assert ">0.60<" in html
    loaded = re.findall(r'(?:src|href)="([^"#][^"]*)"', html)
    assert [address for address in loaded if not address.startswith("data:")] == []


def test_the_stage_holds_what_is_wanted_and_nothing_else(project):
    root = project(small="---\nkernelspec: {name: python3}\n---\n# S\n")
    stage = root / "_build" / "stage"
    (stage / "book" / "old").mkdir(parents=True)
    (stage / "book" / "old" / "page.md").write_text("# Old\n")
    write_stage(stage, root, {}, {})
    names = {path.relative_to(stage).as_posix() for path in stage.rglob("*") if path.is_file()}
    assert names == {"_config.yml", "_toc.yml", "book/front.md", "book/small.md"}
    assert not (stage / "book" / "old").exists()


def test_a_figure_without_alt_text_does_not_reach_the_site(project):
    chapter = find_chapter(project(), "small")
    notebook = as_notebook(chapter)
    image = nbformat.v4.new_output("display_data", data={"image/png": "AAAA"})
    notebook.cells[-1]["outputs"] = [image]
    with pytest.raises(ChapterError, match="has no alt text"):
        staged_notebook(chapter, nbformat.writes(notebook), {"chosen": {}})


def test_each_run_goes_to_a_folder_of_its_own(project):
    root = project()
    chapter = find_chapter(root, "small")
    first = new_folder(root, chapter, {"note": "../../x y"})
    assert first.parent == root / "_build" / "runs" / "small"
    assert re.fullmatch(r"\d{8}T\d{6}_note-[\w.-]+", first.name)
    assert first.is_dir()  # made, so that no other run of this second takes it
    assert new_folder(root, chapter, {"note": "../../x y"}) != first
