"""The book's own chapters: the contract, the table of contents, and the lint of their code."""

import subprocess
import sys

import pytest

from cpl.publish.chapters import find_chapters, find_pages
from cpl.publish.contract import violations
from cpl.store import cpl_imports, import_closure, project_root

ROOT = project_root()
CHAPTERS = find_chapters(ROOT)
RUFF = (sys.executable, "-m", "ruff", "check", "--quiet", "--output-format", "concise")


@pytest.mark.parametrize("name", CHAPTERS)
def test_a_chapter_keeps_to_the_contract(name):
    assert violations(CHAPTERS[name]) == []


@pytest.mark.parametrize("name", CHAPTERS)
def test_the_code_of_a_chapter_is_clean(name):
    chapter = CHAPTERS[name]
    # The code stands on the lines of the chapter, so that what ruff says leads there.
    lines = [""] * chapter.text.count("\n")
    for cell in chapter.cells:
        if cell.code:
            source = cell.source.splitlines()
            start = chapter.text.splitlines().index(source[0], cell.line - 1) if source else 0
            lines[start : start + len(source)] = source
    done = subprocess.run(
        [*RUFF, "--stdin-filename", f"book/{name}.py", "-"],
        input="\n".join(lines).rstrip() + "\n",
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode != 0:
        pytest.fail(done.stdout.replace(f"{name}.py", f"{name}.md") + done.stderr, pytrace=False)


def test_every_page_of_the_book_is_in_the_table_of_contents():
    pages = set(find_pages(ROOT))
    written = {
        path
        for path in (ROOT / "book").rglob("*.md")
        if not path.parent.name.startswith("_")  # lectures, which are no pages
    }
    assert sorted(path.name for path in written - pages) == []


@pytest.mark.parametrize("name", CHAPTERS)
def test_a_chapter_depends_on_what_it_uses_and_not_on_the_chain(name):
    closure = import_closure(*cpl_imports(CHAPTERS[name].code))
    chain = [module for module in closure if module.startswith(("cpl.publish.", "cpl.cli"))]
    assert set(chain) <= {"cpl.publish._glue"}
