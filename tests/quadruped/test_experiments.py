"""The experiments, shrunken: shards, pairing, and that a shard is a pure function."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from cpl.experiments import published, verify
from cpl.experiments.quadruped import lab as _quadruped
from cpl.experiments.quadruped import (
    legged_collect,
    legged_predictor,
    legged_walks,
    quadruped_collect,
    quadruped_eval,
    quadruped_logs,
    quadruped_predictor,
    quadruped_walks,
)
from cpl.quadruped import COLUMNS, GainLimits, PolicyConfig, Predictor, decode_predictor
from cpl.quadruped.predictor import encode_predictor

SHORT = replace(quadruped_collect.PROFILES["smoke"], max_s=1.0)


@pytest.fixture
def net():
    """Return a network that always says one half."""
    weights = {"w1": np.zeros((1, 47)), "b1": np.zeros(1), "w2": np.zeros(1), "b2": np.zeros(())}
    return Predictor(mean=np.zeros(47), std=np.ones(47), **weights)


def test_the_paper_collects_43_trajectories_at_one_gain():
    config = quadruped_collect.PROFILES["paper"]
    assert (len(quadruped_collect.EXPERIMENT.shards(config)), config.kp) == (43, 1.5)


def test_a_collected_shard_is_a_log_and_is_reproducible():
    shard = quadruped_collect.EXPERIMENT.shards(SHORT)[1]
    table = quadruped_collect.EXPERIMENT.run(SHORT, shard)
    assert table.columns.tolist() == ["trajectory", *COLUMNS]
    assert table["outcome"].tolist()[-1] == "timeout"
    assert set(table["kp"]) == {SHORT.kp}
    pd.testing.assert_frame_equal(quadruped_collect.EXPERIMENT.run(SHORT, shard), table)


@pytest.fixture
def inputs(net):
    """Return what a shard gets that walks with that network."""
    table = pd.DataFrame([{"fold": -1, "model": encode_predictor(net, {})}])
    return {"predictor": {"all": table}}


def collected():
    """Return the shards of a short collection, with errors drawn at random."""
    rng = np.random.default_rng(0)
    shards = quadruped_collect.EXPERIMENT.shards(SHORT)
    tables: dict[str, pd.DataFrame] = {}
    for shard in shards:
        table = quadruped_collect.EXPERIMENT.run(SHORT, shard)
        tables[shard.name] = table.assign(slam_error=rng.integers(0, 2, size=len(table)))
    return {"log": tables}


def test_the_predictor_is_trained_on_the_collected_log_and_judged_on_held_out_paths():
    config = quadruped_predictor.Config(collect="smoke", folds=2, epochs=1)
    names = [shard.name for shard in quadruped_predictor.EXPERIMENT.shards(config)]
    assert names == ["all", "fold-0", "fold-1"]
    tables = [
        quadruped_predictor.EXPERIMENT.run(config, shard, collected())
        for shard in quadruped_predictor.EXPERIMENT.shards(config)
    ]
    rows = pd.concat(tables, ignore_index=True)
    assert rows["fold"].tolist() == [-1, 0, 1]
    assert rows["rows"].iloc[1:].sum() == rows["rows"].iloc[0]
    assert (rows["training_rows"] + rows["rows"]).iloc[1:].tolist() == [rows["rows"][0]] * 2
    assert decode_predictor(rows["model"][0])[0].w1.shape == (128, 47)
    assert rows["model"].iloc[1:].tolist() == [b"", b""]


def test_an_evaluation_stands_on_the_predictor_and_not_on_the_collection():
    config = quadruped_eval.PROFILES["paper"]
    (need,) = quadruped_eval.EXPERIMENT.needs(config, quadruped_eval.EXPERIMENT.shards(config)[0])
    assert (need.experiment, need.shards) == ("quadruped_predictor", ("all",))
    assert need.config == quadruped_predictor.PROFILES["paper"]
    predictor = quadruped_predictor.EXPERIMENT
    (below,) = predictor.needs(need.config, predictor.shards(need.config)[0])
    assert (below.experiment, len(below.shards)) == ("quadruped_collect", 43)


def test_the_published_predictor_beats_persistence_on_paths_it_has_not_seen():
    table = published("quadruped_predictor").table.query("fold >= 0")
    assert len(table) == 5
    assert (table["auc"] > table["auc_persistence"]).all()
    assert (table["brier"] < table["brier_persistence"]).mean() > 0.5


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"collect": "huge"}, "collect .* got 'huge'"),
        ({"folds": 1}, "folds must be 0 or at least 2, got 1"),
    ],
)
def test_settings_of_the_predictor_are_checked(change, message):
    with pytest.raises(ValueError, match=message):
        replace(quadruped_predictor.PROFILES["book"], **change)


def test_the_legged_experiments_mirror_the_kinematic_ones():
    walks = legged_walks.PROFILES["paper"]
    assert walks.policies == quadruped_walks.PROFILES["paper"].policies
    (need,) = legged_walks.EXPERIMENT.needs(walks, legged_walks.EXPERIMENT.shards(walks)[0])
    assert (need.experiment, need.shards) == ("legged_predictor", ("all",))
    predictor = legged_predictor.EXPERIMENT
    (below,) = predictor.needs(need.config, predictor.shards(need.config)[0])
    assert below.experiment == "legged_collect"
    assert below.config.kp == quadruped_collect.PROFILES["paper"].kp
    with pytest.raises(ValueError, match="trajectories must be in"):
        replace(legged_collect.PROFILES["smoke"], trajectories=0)


def test_the_logs_are_asked_only_if_they_are_the_ones_that_are_named():
    config = replace(quadruped_logs.PROFILES["smoke"], sha256=("0" * 12,) * 2)
    with pytest.raises(ValueError, match="sha256 of quadruped must be 000000000000"):
        quadruped_logs.EXPERIMENT.run(config, quadruped_logs.EXPERIMENT.shards(config)[0])
    with pytest.raises(ValueError, match="sha256 must be one a folder"):
        replace(config, sha256=())
    with pytest.raises(ValueError, match=r"repeats must be in \[1, inf\)"):
        replace(config, repeats=0)


def test_what_the_shipped_logs_say_has_each_number_once():
    table = published("quadruped_logs").table
    cell = ["folder", "row", "number", "shape", "part"]
    assert not table.duplicated(cell).any()
    assert set(table["provenance"]) == {"simulated-kinematic", "simulated-legged"}
    assert set(table["row"]) == set(range(42, 50))
    known = table.dropna(subset=["low"])
    assert (known["low"] <= known["value"] + 1e-9).all()
    assert (known["value"] <= known["high"] + 1e-9).all()


@pytest.mark.rehearsal
def test_what_the_shipped_logs_say_is_said_again():
    report = verify("quadruped_logs", sample=1, seed=0)
    assert report.agrees, report.differences


def test_an_evaluated_shard_holds_every_policy_on_the_same_noise(inputs):
    config = replace(
        quadruped_eval.PROFILES["smoke"],
        policies=("constant", "no_quantile", "oracle"),
        supervision=("without", "with"),
        max_s=0.5,
    )
    shards = quadruped_eval.EXPERIMENT.shards(config)
    assert [shard.name for shard in shards] == ["triangle-in-0", "triangle-out-0"]
    table = quadruped_eval.EXPERIMENT.run(config, shards[0], inputs)
    assert len(table) == 6
    assert set(table["outcome"]) == {"timeout"}
    assert table.loc[0, "mean_kp"] == 1.5
    again = quadruped_eval.EXPERIMENT.run(config, shards[0], inputs)
    pd.testing.assert_frame_equal(again, table)


def test_the_paper_profile_has_the_cells_of_the_paper_and_more():
    config = quadruped_walks.PROFILES["paper"]
    assert len(quadruped_walks.EXPERIMENT.shards(config)) == 3 * 2 * 20
    book = quadruped_eval.PROFILES["book"]
    assert len(quadruped_eval.EXPERIMENT.shards(book)) * len(book.policies) == 36


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"policies": ("brave",)}, r"policies .* got 'brave'"),
        ({"shapes": ("star",)}, r"shapes .* got 'star'"),
        ({"collect": "huge"}, "collect .* got 'huge'"),
        ({"repeats": 0}, r"repeats must be in \[1, inf\)"),
    ],
)
def test_settings_are_checked(change, message):
    with pytest.raises(ValueError, match=message):
        replace(quadruped_eval.PROFILES["book"], **change)


def test_collecting_nothing_is_refused():
    with pytest.raises(ValueError, match="trajectories must be in"):
        replace(SHORT, trajectories=0)


def test_an_unknown_policy_is_named(net):
    with pytest.raises(ValueError, match="not 'brave'"):
        _quadruped.policy("brave", GainLimits(kp_min=1, kp_max=2), PolicyConfig(), net)
