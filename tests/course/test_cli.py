"""What a teacher types, and the slides that come of it."""

import json
import re

import pytest

from cpl.cli import main
from cpl.course.editions import build_course, pages_of
from cpl.course.exercises import exercises_of
from cpl.course.slides import build_slides, expand, harvest
from cpl.store import project_root


def test_list_has_a_line_for_each_exercise(capsys):
    assert main(["course", "list"]) == 0
    lines = capsys.readouterr().out.splitlines()
    pages = pages_of(project_root())
    labels = [one.label for name, text in pages.items() for one in exercises_of(text, name)]
    assert [line.split()[0] for line in lines] == labels


@pytest.mark.parametrize("words", [["course"], ["course", "build", "--only", "everything"]])
def test_what_makes_no_sense_ends_with_status_2(words, capsys):
    with pytest.raises(SystemExit) as end:
        main(words)
    assert end.value.code == 2
    assert capsys.readouterr().err


def test_a_file_that_is_not_there_is_named(capsys):
    assert main(["course", "grade", "no-such.zip", "no-such.ipynb"]) == 2
    assert "there is no file no-such.zip" in capsys.readouterr().err


def test_an_unknown_part_is_refused_before_anything_is_built(tmp_path):
    with pytest.raises(ValueError, match="parts must be some of student, instructor, labs, slides"):
        build_course(tmp_path, tmp_path / "out", parts=("everything",))
    assert not (tmp_path / "out").exists()


EXECUTED = json.dumps(
    {
        "cells": [
            {
                "cell_type": "code",
                "metadata": {
                    "mystnb": {
                        "image": {"alt": "A line\n  that rises."},
                        "figure": {"name": "fig-up"},
                    }
                },
                "outputs": [
                    {
                        "data": {"application/papermill.record/text/plain": "'0.350'"},
                        "metadata": {"scrapbook": {"name": "exact"}},
                    },
                    {
                        "data": {
                            "image/svg+xml": ["<svg xmlns='http://www.w3.org/2000/svg'>", "</svg>"]
                        }
                    },
                ],
            }
        ]
    }
)

LECTURE = """# A lecture

It is {value}`small:exact`, of $q_t$.

```{revealjs-notes}
(5 min) Say that it is $q_t$, {value}`small:exact`.
```

## A figure

```{chapter-figure} small:fig-up
```
"""


def test_a_lecture_shows_the_chapters_numbers_and_figures():
    small = harvest(EXECUTED, "Small")
    assert small.values == {"exact": "0.350"}
    text, files = expand(LECTURE, {"small": small})
    assert "It is 0.350, of $q_t$." in text
    assert ":alt: A line that rises." in text
    assert list(files) == ["small-fig-up.svg"]


@pytest.mark.parametrize("name", ["small:missing", "nowhere:exact"])
def test_a_lecture_cannot_show_what_no_chapter_offers(name):
    with pytest.raises(ValueError, match=f"shows '{name}', which no chapter offers"):
        expand(f"{{value}}`{name}`", {"small": harvest(EXECUTED, "Small")})


def test_slides_need_no_other_host_and_notes_can_be_left_out(tmp_path):
    root = tmp_path / "project"
    slides = root / "book" / "_slides"
    slides.mkdir(parents=True)
    source = project_root() / "book"
    (slides / "slides.css").write_bytes((source / "_slides" / "slides.css").read_bytes())
    (slides / "index.md").write_text("# Lectures\n\n```{toctree}\nlecture_1\n```\n")
    (slides / "lecture_1.md").write_text(LECTURE)
    (root / "book" / "_ext").symlink_to(source / "_ext")
    chapters = {"small": harvest(EXECUTED, "Small")}
    for notes in (True, False):
        front = build_slides(root, chapters, tmp_path / "work", tmp_path / "out", notes=notes)
        page = (front.parent / "lecture_1.html").read_text()
        assert ('class="notes"' in page) == notes
        assert "It is 0.350, of" in page
        assert 'alt="A line that rises."' in page
        assert re.findall(r'(?:src|href)="(?:https?:)?//', page) == []
        assert "_static/mathjax/startup.js" in page
