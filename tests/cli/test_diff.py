"""`cpl diff` tells which numbers moved, and refuses what is not a run."""

import json

import pytest

from cpl.cli import main
from cpl.publish import cache


@pytest.fixture
def make(tmp_path):
    def write(name, chapter="small", parameters=None, **glued):
        outputs = [
            {
                "data": {"application/papermill.record/text/plain": repr(text)},
                "metadata": {"scrapbook": {"name": key}},
            }
            for key, text in glued.items()
        ]
        folder = tmp_path / name
        record = {"key": "k", "chapter": chapter, "parameters": parameters or {}}
        cache.save(folder, chapter, json.dumps({"cells": [{"outputs": outputs}]}), record)
        return str(folder)

    return write


def test_what_moved_is_listed_with_the_parameters_that_differ(make, capsys):
    first = make("a", parameters={"alpha": 0.1}, bound="0.350", count="12", same="1")
    second = make("b", parameters={"alpha": 0.2}, bound="0.351", count="14", same="1")
    assert main(["diff", first, second]) == 1
    said = capsys.readouterr()
    assert said.out.splitlines() == [
        "parameter alpha: 0.1 -> 0.2",
        "within bound: 0.350 -> 0.351  (0.28%)",
        "MOVED  count: 12 -> 14  (14.29%)",
    ]
    assert "1 of 3 numbers moved" in said.err
    assert main(["diff", first, second, "--rtol", "0.2"]) == 0
    assert main(["diff", first, first]) == 0


def test_what_is_no_run_is_refused(make, capsys, tmp_path):
    good = make("a", n="1")
    for words, message in (
        ([str(tmp_path / "none"), good], "must be the folder of one run"),
        ([good, make("c", chapter="other", n="1")], "must be of one chapter"),
        (["published", "published"], "must be the folder of a run"),
        ([good, "published"], "no executed chapter 'small'"),
        ([good, good, "--rtol", "-1"], "rtol must be"),
    ):
        assert main(["diff", *words]) == 2, words
        assert message in capsys.readouterr().err


def test_a_damaged_run_is_refused(make, capsys, tmp_path):
    good, bad = make("a", n="0.10"), make("b", n="0.10")
    path = tmp_path / "b" / "small.ipynb"
    path.write_text(path.read_text().replace("0.10", "0.90"))
    assert main(["diff", good, bad]) == 2
    assert "was damaged" in capsys.readouterr().err
