"""From nothing, into a layer of its own, and number against number."""

import json
import math
import os
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from cpl.claims import ledger
from cpl.cli import main
from cpl.experiments.run.job import job_of
from cpl.experiments.run.publication import published
from cpl.reproduce._agreement import _told_apart, agree, claims_again, pieces_again
from cpl.reproduce.reproduction import plan, reproduce, unpublished
from cpl.store import (
    PublishedShard,
    encode_model,
    manifests,
    publish,
    read_published,
    same_table,
)


@pytest.fixture(scope="module")
def steps():
    return {step.experiment: step for step in plan("paper")}


def test_a_plan_holds_everything_that_is_published(steps):
    assert steps.keys() == {m.experiment for m in manifests() if m.profile == "paper"}
    assert not steps.keys() & set(unpublished())
    assert "pathwise" not in {step.experiment for step in plan("paper", without=["pathwise"])}


def test_a_plan_takes_one_training_seed_and_the_papers_sizes(steps):
    assert steps["pathwise"].expected_s > 0
    assert steps["pathwise"].whole
    # The family's loop begins with the third pair of policies, so these are trained as well.
    assert steps["base_policies"].job.config.pairs == 3
    assert steps["base_policies"].job.config.steps == 200_000
    (alone,) = plan("paper", ["base_policies"])
    assert list(alone.job.pieces) == ["safe-0", "speed-0"]
    assert not steps["base_policies"].whole
    assert steps["quadruped_collect"].job.config.trajectories == 43
    # The penalties' weights are chosen over two seeds: the agents need both.
    assert steps["penalty_grid"].whole
    assert not plan("paper", ["penalty_grid"])[0].whole
    (pareto,) = plan("paper", ["pareto"])  # the first pair, not the second
    assert pareto.job.config.first_pair == 0
    with pytest.raises(ValueError, match="no experiment 'pathwisee'; did you mean 'pathwise'"):
        plan("paper", ["pathwisee"])
    with pytest.raises(ValueError, match="no experiment 'pathwisee'"):
        plan("paper", without=["pathwisee"])


def test_a_step_comes_behind_what_it_needs():
    names = [s.experiment for s in plan("paper", ["gate_stream", "pareto", "forecasts"])]
    assert names == ["gate_stream", "forecasts", "pareto"]


def test_everything_is_computed_into_a_layer_of_its_own(tmp_path):
    seen, said = [], []

    def report(line):
        seen.append(os.environ.get("CPL_FRESH"))
        said.append(line)

    told = reproduce(plan("paper", ["proximity"]), tmp_path, workers=1, report=report)
    assert seen == ["1", "1"]
    assert len(said) == 2
    assert "CPL_FRESH" not in os.environ
    assert (tmp_path / "results" / "proximity" / "paper.json").is_file()
    assert told["steps"][0]["pieces"] == {"compared": 1, "differing": []}
    assert [claim["row"] for claim in told["claims"]] == [16]
    assert told["claims"][0]["agrees"]
    assert told["claims"][0]["whole"]
    assert not told["resumed"]
    # One worker: the schedule of what was run takes just as long as its pieces together.
    assert told["scheduled_s"] == pytest.approx(told["processor_s"], abs=0.1)
    assert told["scheduled_s"] <= told["wall_s"] + 0.1
    written = json.loads((tmp_path / "report.json").read_text())
    assert written == json.loads(json.dumps(told))
    again = reproduce(plan("paper", ["proximity"]), tmp_path, workers=1, report=report)
    # Nothing was left to compute: it compares again and keeps what it says of the computation.
    assert again == told


def test_what_is_computed_later_says_so(tmp_path, monkeypatch):
    monkeypatch.setattr("cpl.reproduce.reproduction.claims_again", lambda *layer: [])
    for names, resumed in ((["proximity"], False), (["proximity", "certificates"], True)):
        told = reproduce(plan("paper", names), tmp_path, workers=1, report=lambda line: None)
        assert told["resumed"] is resumed


@pytest.mark.parametrize("record", [True, False])
def test_what_agreed_is_called_verified_on_demand(tmp_path, monkeypatch, record):
    recorded = []
    monkeypatch.setattr(
        "cpl.experiments.run.publication.record_agreement", lambda *told: recorded.append(told)
    )
    monkeypatch.setattr("cpl.reproduce.reproduction.claims_again", lambda *layer: [])
    reproduce(
        plan("paper", ["proximity"]), tmp_path, workers=1, record=record, report=lambda line: None
    )
    assert recorded == ([("proximity", "paper", ("all",))] if record else [])


def test_the_command_says_what_it_would_take(capsys):
    assert main(["reproduce", "--dry-run", "pathwise"]) == 0
    out = capsys.readouterr().out
    assert "pathwise: 132 pieces, as published, " in out
    assert "min of work" in out


def test_a_model_is_the_same_whatever_the_number_of_seeds_beside_it():
    def piece(value, **config):
        model = encode_model({"w": np.full(2, value)}, {"config": config, "seed": 3})
        return pd.DataFrame({"n": [1, 2], "model": [b"", model]})

    one, ten = (_told_apart(piece(1.0, pairs=n, lr=0.1), {"pairs"}) for n in (1, 10))
    assert same_table(one, ten) is None
    assert same_table(_told_apart(piece(2.0, pairs=1, lr=0.1), {"pairs"}), ten)
    assert same_table(_told_apart(piece(1.0, pairs=1, lr=0.2), {"pairs"}), ten)


def test_a_piece_that_differs_is_named():
    result = published("proximity", "paper")
    task = job_of("proximity", "paper", result.config)
    assert pieces_again(task, result).differing == ()
    changed = result.table.assign(l_tilde=result.table["l_tilde"] * 1.01)
    found = pieces_again(task, replace(result, table=changed))
    assert found.compared == 1
    assert "column 'l_tilde'" in found.differing[0]
    other = job_of("proximity", "paper+", replace(result.config, points=7))
    assert pieces_again(other, result).compared == 0


def test_published_pieces_of_one_seed_can_be_judged_by_every_rule(tmp_path, steps):
    """What a reproduction will meet, without running it: the published tables, cut down."""
    for name, step in steps.items():
        table, manifest = read_published(name, "paper")
        names = step.job.pieces.keys()
        kept = [shard for shard in manifest.shards if shard.name in names]
        rows = [i for s in kept for i in range(s.first_row, s.first_row + s.rows)]
        shards, first = [], 0
        for shard in kept:
            shards.append(PublishedShard(name=shard.name, first_row=first, rows=shard.rows))
            first += shard.rows
        few = table.iloc[rows].reset_index(drop=True)
        publish(few, replace(manifest, shards=shards), root=tmp_path / "results")
    whole = {name for name, step in steps.items() if step.whole}
    claims = {claim.row: claim for claim in claims_again(tmp_path / "results", whole)}
    decided = {row.row for row in ledger() if row.computed_from and row.value is not None}
    assert decided <= claims.keys()
    for claim in claims.values():
        assert not (claim.whole and not claim.agrees), claim
        assert claim.agrees is not None or claim.reason


def test_a_claim_agrees_when_the_intervals_meet():
    row = next(row for row in ledger() if row.row == 2)
    assert agree(row, row, same_seeds=True)
    far = replace(row, value=row.high + 2, low=row.high + 1, high=row.high + 3)
    near = replace(row, value=row.high + 2, low=row.high, high=row.high + 3)
    assert not agree(row, far, same_seeds=False)
    assert agree(row, near, same_seeds=False)
    assert not agree(row, near, same_seeds=True)
    assert agree(row, near, same_seeds=True, timed=True)
    assert agree(row, replace(near, low=None), same_seeds=False) is None
    assert agree(row, replace(near, low=math.nan), same_seeds=False) is None
    other = replace(row, verdict="undecided")
    assert not agree(row, other, same_seeds=True, timed=True)
