"""The student edition: what is taken out is not to be found in anything that was made."""

import json
import os
import re
import subprocess
import sys
import zipfile

import pytest

from cpl.course.editions import pages_of, student_site
from cpl.course.leaks import RUN, leaks, words_of
from cpl.course.student import stub, student_notebook, student_text
from cpl.publish.chapters import find_chapters
from cpl.publish.execute import as_notebook
from cpl.publish.run import execute_all
from cpl.publish.stage import write_stage
from cpl.store import project_root

SENTINELS = (
    "quokkafenced",
    "quokkagated",
    "quokkacode",
    "quokkaglued",
    "quokkahidden",
    "quokkaout",
)

# Every form in which a solution may stand in a chapter, each with a word of its own.
TEXT = """
# A small chapter

We ask for the double of a number, and then for a function that doubles. The text has to outweigh
the code, so here is a sentence that says nothing else, and here is another one beside it.

```{code-cell} ipython3
:tags: [parameters]
alpha: float = 0.1  # [-] (0, 1): the number
```

```{exercise} Doubling
:label: ex-small-one

*Goal: double. 5 minutes, pencil and paper.* What is twice two?
```

````{solution} ex-small-one
:class: dropdown

It is quokkafenced, and everybody can see that it is: {glue:text}`secret`.

```python
print("quokkafenced inside")
```
````

```{code-cell} ipython3
:tags: [solution]
from cpl.publish import glue

glue("secret", "quokkaglued")
```

```{exercise} A function
:label: ex-lab-small

*Goal: write one. 5 minutes, code.* Write `double(x)`.
```

```{solution-start} ex-lab-small
:class: dropdown
```

One multiplies by quokkagated, which is two.

```{code-cell} ipython3
:tags: [exercise]
def double(x):
    # BEGIN SOLUTION
    quokkacode = 2
    print("quokka" + "out")
    return quokkacode * x
    # END SOLUTION
```

And that was all that quokkagated has to say.

```{solution-end}
```

```{code-cell} ipython3
:tags: [check]
assert double(2) == 4
```

```{code-cell} ipython3
:tags: [check, hidden]
assert double(0.5) == 1, "quokkahidden"
```

```{code-cell} ipython3
_ = double(3)
```

A last sentence that everybody may read.
"""

CONFIG = """
title: A small book
author: Nobody
only_build_toc_files: true
execute:
  execute_notebooks: "off"
repository:
  url: ""
parse:
  myst_enable_extensions: [colon_fence, dollarmath]
sphinx:
  extra_extensions: [sphinx_exercise]
"""


@pytest.fixture
def small(project, header):
    root = project(small=header + TEXT)
    (root / "_config.yml").write_text(CONFIG)
    return root


def everything(folder):
    """Yield every file below a folder, and what is in archives, as bytes."""
    for path in folder.rglob("*"):
        if path.is_file():
            yield path.relative_to(folder).as_posix(), path.read_bytes()
            if zipfile.is_zipfile(path):
                with zipfile.ZipFile(path) as archive:
                    yield from ((f"{path.name}:{n}", archive.read(n)) for n in archive.namelist())


def test_no_form_of_a_solution_is_left_in_any_file_of_the_site(small, tmp_path):
    chapters = find_chapters(small)
    executed = execute_all(list(chapters.values()), small, report=lambda _: None)
    front = student_site(small, chapters, executed, tmp_path / "student")
    assert front.is_file()
    found = [
        (n, s) for n, c in everything(tmp_path / "student") for s in SENTINELS if s.encode() in c
    ]
    assert found == []
    html = (tmp_path / "student" / "book" / "small.html").read_text()
    assert "What is twice two?" in html
    assert "A last sentence that everybody may read." in html
    assert "assert" in html, "the check that students may see"
    assert leaks(tmp_path / "student", pages_of(small)) == []

    stage = tmp_path / "stage"  # what the reader's site is made of has them: the search finds them
    write_stage(stage, small, chapters, executed)
    known = {s for _, c in everything(stage) for s in SENTINELS if s.encode() in c}
    assert known == set(SENTINELS)
    said = "\n".join(leaks(stage, pages_of(small)))
    for label in ("ex-small-one", "ex-lab-small"):
        assert f"book/small.ipynb: {label}: " in said


def test_a_notebook_keeps_its_questions_and_its_stubs(small):
    notebook = as_notebook(find_chapters(small)["small"])
    text = json.dumps(student_notebook(notebook))
    assert not [s for s in SENTINELS if s in text]
    kept = student_notebook(notebook)["cells"]
    assert [c["source"] for c in kept if "exercise" in c["metadata"].get("tags", ())] == [
        "def double(x):\n    ..."
    ]
    assert all(c["outputs"] == [] for c in kept if c["cell_type"] == "code")


def test_a_solution_that_is_not_closed_swallows_the_rest():
    text = "Before.\n\n```{solution-start} ex-one\n```\n\nSecret."
    assert student_text(text) == "Before.\n\n"


def test_a_stub_keeps_what_is_outside_of_the_marks():
    source = "import math\n\n\ndef f(x):\n    # BEGIN SOLUTION\n    return x\n    # END SOLUTION\n"
    assert stub(source) == "import math\n\n\ndef f(x):\n    ...\n"


@pytest.mark.parametrize("name", find_chapters(project_root()))
def test_nothing_of_a_solution_is_left_in_the_sources_of_a_chapter(name):
    """The same search as over the built site, over what it is built from."""
    chapter = find_chapters(project_root())[name]
    text = json.dumps(student_notebook(as_notebook(chapter)))
    assert "SOLUTION" not in text
    assert "{solution" not in text
    secrets = chapter.text
    kept = {tuple(run) for run in runs(student_text(chapter.text))}
    for body in re.findall(r"\{solution\} *[\w-]+\n(.*?)\n`{3,}$", secrets, re.S | re.M):
        only = {run for run in runs(body) if run not in kept}
        assert not only & set(runs(text)), name


def runs(text):
    words = words_of(text)
    return [tuple(words[i : i + RUN]) for i in range(len(words) - RUN + 1)]


@pytest.mark.rehearsal
def test_make_course_builds_two_editions_and_the_students_has_no_solutions(tmp_path):
    """`cpl course build`, whole, and a search over every file that students get."""
    done = subprocess.run(
        [sys.executable, "-m", "cpl", "course", "build", "--out", str(tmp_path)],
        cwd=project_root(),
        env={**os.environ},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    student, instructor = tmp_path / "student", tmp_path / "instructor"
    pages = pages_of(project_root())
    assert leaks(student, pages) == []
    assert leaks(instructor / "site", pages), "the search finds what is there"
    assert not [n for n, c in everything(student / "site" / "_sources") if b"SOLUTION" in c]
    for edition in (student, instructor):
        assert (edition / "site" / "index.html").is_file()
        assert len(list((edition / "slides").glob("lecture_*.html"))) == 4
    assert b'class="notes"' in (instructor / "slides" / "lecture_1.html").read_bytes()
    assert b'class="notes"' not in (student / "slides" / "lecture_1.html").read_bytes()
    assert len(list((student / "labs").glob("*.ipynb"))) == 4
    assert len(list((instructor / "labs").glob("*-grader.zip"))) == 4
    assert len(list(student.glob("cpl-*.whl"))) == 1
    hosts = re.compile(rb"(?:src|href)=\"(https?:)?//")
    slides = [c for n, c in everything(student / "slides") if n.endswith(".html")]
    assert not [c for c in slides if hosts.search(c)]
