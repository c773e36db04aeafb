"""The report's page says what the report says, and that there is none where there is none."""

import json

import pytest

from cpl.figures import reproduced


def step(name, *, whole=True, compared=2, differing=(), missing=None):
    pieces = None if missing else {"compared": compared, "differing": list(differing)}
    return {
        "experiment": name, "whole": whole, "shards": 3, "processor_s": None if missing else 90.0,
        "pieces": pieces, "missing": missing,
    }  # fmt: skip


def claim(row, agrees, *, whole=True):
    return {
        "row": row, "claim": "a | b", "published": [1.0, 0.5, 1.5], "again": [1.25, None, None],
        "whole": whole, "agrees": agrees,
    }  # fmt: skip


REPORT = {
    "made": "2026-01-02", "commit": "0123456789", "workers": 2, "cluster": False, "resumed": False,
    "compared": {"date": "2026-01-02", "commit": "0123456789"},
    "machine": {"processor": "AMD EPYC", "cores": 2, "system": "Linux x86_64"},
    "wall_s": 600.0, "processor_s": 1100.0, "left_out": {"legged_walks": "nothing published"},
    "steps": [
        step("windows"),
        step("pareto", whole=False, compared=1, differing=["pair0-40: column 'x', row 1: <b> 1"]),
        step("proximity", compared=0),
        step("robot_loop", missing="no module named 'unitree'"),
    ],
    "claims": [claim(1, True), claim(20, False), claim(21, None, whole=False)],
}  # fmt: skip


@pytest.fixture
def found(tmp_path):
    path = tmp_path / "report.json"
    path.write_text(json.dumps(REPORT))
    return reproduced.read(path)


def test_the_report_is_told_as_it_is(found):
    assert found.when() == (
        "Made 2026-01-02 from the source 01234567 on AMD EPYC (2 cores, Linux x86_64), with "
        "2 processes: 10.0 minutes, 18.3 of processor time."
    )
    later = {**REPORT, "compared": {"date": "2026-01-03", "commit": "abcdef0123"}}
    assert (
        reproduced.Reproduction(later)
        .when()
        .endswith(" Compared again 2026-01-03 by the source abcdef01.")
    )
    assert found.covers() == (
        "3 experiments, 2 of them exactly as published and the others with one training seed. "
        "Left out: legged_walks (nothing published); robot_loop (no module named 'unitree')."
    )
    assert found.outcome() == (
        "Of 3 published pieces that were computed again, 2 are the same. Of the claims, 1 agree, "
        "1 differ, and about 1 one training seed cannot say."
    )
    assert (found.count("compared"), found.count("same")) == (3, 2)
    assert [found.claims(kind) for kind in (True, False, None)] == [1, 1, 1]


def test_tables_have_a_line_each(found):
    lines = str(found.experiments()).splitlines()[2:]
    assert lines[1] == "| pareto | one training seed | 3 | 1.50 | 0 of 1 |"
    assert lines[2].endswith("| other settings |")
    assert len(str(found.ledger()).splitlines()) == 2 + 3
    assert r"| 20 | a \| b | 1 [0.5, 1.5] | 1.25 | the same | differs |" in str(found.ledger())
    assert r"\<b\>" in str(found.differences())


def test_a_resumed_run_says_so(found):
    assert "went on" in reproduced.Reproduction({**found.report, "resumed": True}).when()


def test_without_a_report_every_part_says_that_there_is_none(tmp_path):
    none = reproduced.read(tmp_path / "report.json")
    said = [none.when(), none.experiments(), none.differences(), none.ledger()]
    assert all("No reproduction has been published" in str(text) for text in said)
    assert none.outcome() == "So nothing is claimed here."
    assert none.covers() == "Nothing is covered."
    assert none.count("same") == none.claims(True) == 0
