"""A chapter over a grid: every point is run, compared on one page, and not run twice."""

import json

import pytest

from cpl.publish.chapters import find_chapter
from cpl.publish.execute import ExecutionError
from cpl.publish.grid import LARGEST, axes, points, run_grid
from cpl.settings.words import ParameterError


def test_values_are_checked_before_anything_runs(project):
    parameters = find_chapter(project(), "small").parameters
    assert axes(parameters, ["alpha=0.1,0.2", "sizes=1,2;3"]) == {
        "alpha": [0.1, 0.2],
        "sizes": [(1, 2), (3,)],
    }
    assert axes(parameters, ["form=paper,corrected,paper"]) == {"form": ["paper", "corrected"]}


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["alhpa=0.1"], "did you mean 'alpha'"),
        (["alpha"], "a sweep is written"),
        (["alpha=0.1,2"], "alpha must be a float in"),
        (["alpha=0.1,"], "alpha must be"),
        (["alpha=0.1", "alpha=0.2"], "swept twice"),
        (["alpha=__import__('os')"], "alpha must be"),
    ],
)
def test_slips_are_named(project, words, message):
    with pytest.raises(ParameterError, match=message):
        axes(find_chapter(project(), "small").parameters, words)


def test_a_grid_has_bounds():
    with pytest.raises(ParameterError, match=f"{LARGEST} runs at most, got 400"):
        points({"a": list(range(20)), "b": list(range(20))}, {})
    with pytest.raises(ParameterError, match="a is both set and swept"):
        points({"a": [1, 2]}, {"a": 3})


def test_runs_are_compared_and_not_repeated(project, tmp_path):
    root = project()
    chapter = find_chapter(root, "small")
    payload = "<script>alert(1)</script>"
    grid = points({"alpha": [0.1, 0.25]}, {"note": payload})
    said = []
    page = run_grid(chapter, grid, tmp_path / "out", root, jobs=1, report=said.append)
    html = page.read_text()
    assert "0.20" in html
    assert "0.50" in html
    assert payload not in html
    assert "&lt;script&gt;" in html
    told = json.loads((tmp_path / "out" / "sweep.json").read_text())
    assert [run["numbers"]["double"] for run in told["runs"]] == ["0.20", "0.50"]
    assert all((tmp_path / "out" / run["page"]).is_file() for run in told["runs"])
    run_grid(chapter, grid, tmp_path / "out", root, jobs=1, report=said.append)
    assert said[0] == "0 of 2 runs are at hand"
    assert said[-1] == "2 of 2 runs are at hand"


def test_a_failing_point_is_named_and_the_others_are_kept(project, tmp_path):
    root = project()
    path = root / "book" / "small.md"
    path.write_text(path.read_text().replace("2 * alpha", "2 / (alpha - 0.5)"))
    chapter = find_chapter(root, "small")
    grid = points({"alpha": [0.1, 0.5]}, {})
    page = run_grid(chapter, grid, tmp_path / "out", root, jobs=1, report=lambda _: None)
    assert "Run 1 failed" in page.read_text()
    with pytest.raises(ExecutionError, match="ZeroDivisionError"):
        run_grid(chapter, grid[1:], tmp_path / "two", root, jobs=1, report=lambda _: None)
