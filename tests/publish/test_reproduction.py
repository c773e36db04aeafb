"""From nothing, into a layer of its own, and claim against claim."""

import json
import os
from dataclasses import replace

import pytest

from cpl.claims import ledger
from cpl.publish.reproduction import _agree, _claims, plan, reproduce


def test_a_plan_takes_one_seed_and_knows_how_long_it_took():
    steps = {step.experiment: step for step in plan("paper")}
    assert steps["pathwise"].expected_s > 0
    for step in steps.values():
        if "pairs" in getattr(step.job.module, "EXTENT", ()):
            assert step.job.config.pairs == 1
    with pytest.raises(ValueError, match="no experiment 'pathwisee', did you mean 'pathwise'"):
        plan("paper", ["pathwisee"])


def test_everything_is_computed_into_a_layer_of_its_own(tmp_path):
    seen, said = [], []

    def report(line):
        seen.append(os.environ.get("CPL_FRESH"))
        said.append(line)

    told = reproduce(plan("smoke", ["proximity"]), tmp_path, workers=1, report=report)
    assert seen == ["1"]
    assert "CPL_FRESH" not in os.environ
    assert (tmp_path / "results" / "proximity" / "paper.json").is_file()
    assert [claim["row"] for claim in told["claims"]] == [16]
    assert told["claims"][0]["agrees"]
    assert told == json.loads((tmp_path / "report.json").read_text()) | {"claims": told["claims"]}
    again = reproduce(plan("smoke", ["proximity"]), tmp_path, workers=1, report=report)
    assert again["steps"][0]["content"] == told["steps"][0]["content"]


def test_a_claim_agrees_when_the_intervals_meet():
    row = next(row for row in ledger() if row.row == 2)
    assert _agree(row, row)
    far = replace(row, value=row.high + 2, low=row.high + 1, high=row.high + 3)
    near = replace(row, value=row.high + 2, low=row.high, high=row.high + 3)
    assert not _agree(row, far)
    assert _agree(row, near)
    (claim,) = _claims({2: row}, [far])
    assert not claim.agrees
    assert claim.published[0] == row.value
