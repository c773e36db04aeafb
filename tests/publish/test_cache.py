"""A result is at hand exactly if nothing that it rests on has changed."""

import os
import shutil
import subprocess
import sys

import pytest

from cpl.publish import cache
from cpl.publish.chapters import find_chapter
from cpl.store import project_root

DRIVER = """
import sys
from pathlib import Path
from cpl.publish.chapters import find_chapters
from cpl.publish.run import execute_all

root = Path(sys.argv[1])
execute_all(list(find_chapters(root).values()), root, report=lambda text: print(text, flush=True))
"""

CHAPTER = """
# {name}

```{{code-cell}} ipython3
:tags: [parameters]
a: int = 1  # [-] any: one
```

```{{code-cell}} ipython3
{code}
```
"""


def key(root, **values):
    chapter = find_chapter(root, "small")
    defaults = {parameter.name: parameter.default for parameter in chapter.parameters}
    return cache.key_of(cache.basis(chapter, {**defaults, **values}, root))


def test_the_key_changes_with_code_and_parameters_but_not_with_prose(project):
    root = project()
    path = root / "book" / "small.md"
    before = key(root)
    assert key(root) == before
    assert key(root, alpha=0.2) != before
    path.write_text(path.read_text().replace("A small chapter", "Another title"))
    assert key(root) == before
    path.write_text(path.read_text().replace("2 * alpha", "3 * alpha"))
    assert key(root) != before


def test_the_key_changes_with_the_manifests_that_a_chapter_reads(project):
    root = project()
    path = root / "book" / "small.md"
    manifest = root / "data" / "results" / "toy" / "paper.json"
    manifest.parent.mkdir(parents=True)
    plain = key(root)
    manifest.write_text("{}")
    assert key(root) == plain
    path.write_text(path.read_text().replace("print(", "from cpl.store import data_path\nprint("))
    reads = key(root)
    manifest.write_text('{"rows": 1}')
    assert key(root) != reads


def test_versions_are_part_of_what_a_result_rests_on(project):
    chapter = find_chapter(project(), "small")
    versions = cache.basis(chapter, {}, project_root())["versions"]
    assert versions["python"].startswith(f"{sys.version_info.major}.")
    assert {"numpy", "papermill", "matplotlib"} <= set(versions)


def test_a_damaged_or_foreign_entry_is_not_used(tmp_path):
    cache.save(tmp_path, "a", "notebook", {"key": "k", "seconds": 1})
    assert cache.load(tmp_path, "a", "k") is not None
    assert cache.load(tmp_path, "a", "other") is None
    assert cache.load(tmp_path, "b", "k") is None
    for name, damage in [("a.ipynb", b"notebooK"), ("a.json", b'{"key"'), ("a.ipynb", b"\xff")]:
        cache.save(tmp_path, "a", "notebook", {"key": "k", "seconds": 1})
        (tmp_path / name).write_bytes(damage)
        assert cache.load(tmp_path, "a", "k") is None


@pytest.fixture
def built(project, header):
    """A project with its own copy of cpl, and the function that executes its chapters."""
    codes = {
        "uses": "from cpl.conformal.rules import Fixed\nFixed(eta=1.0)",
        "quotes": 'from cpl.publish import glue\nglue("a", a)',
        "alone": "a + 1",
    }
    root = project(**{n: header + CHAPTER.format(name=n, code=c) for n, c in codes.items()})
    shutil.copytree(
        project_root() / "cpl", root / "cpl", ignore=shutil.ignore_patterns("__pycache__")
    )
    environment = {**os.environ, "PYTHONPATH": str(root), "PYTHONDONTWRITEBYTECODE": "1"}

    def build():
        done = subprocess.run(
            [sys.executable, "-c", DRIVER, str(root)],
            env=environment,
            cwd=root,
            capture_output=True,
            text=True,
            check=True,
        )
        lines = [line for line in done.stdout.splitlines() if line.startswith("executing ")]
        return sorted(lines[0].removeprefix("executing ").split(", ")) if lines else []

    return root, build


def test_exactly_the_chapters_below_a_change_are_executed_again(built):
    root, build = built
    rules = root / "cpl" / "conformal" / "rules.py"
    assert build() == ["alone", "quotes", "uses"]
    rules.write_text(f"# A comment changes nothing.\n{rules.read_text()}")
    assert build() == []
    rules.write_text(f"{rules.read_text()}\n_changed = 1\n")
    assert build() == ["uses"]
