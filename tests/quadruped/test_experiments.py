"""The experiments, shrunken: shards, pairing, and that a shard is a pure function."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from cpl.experiments import _quadruped, quadruped_collect, quadruped_eval, quadruped_walks
from cpl.quadruped import COLUMNS, GainLimits, PolicyConfig, Predictor, TrainingConfig

SHORT = replace(quadruped_collect.PROFILES["smoke"], max_s=1.0)


@pytest.fixture
def net():
    """Return a network that always says one half."""
    weights = {"w1": np.zeros((1, 47)), "b1": np.zeros(1), "w2": np.zeros(1), "b2": np.zeros(())}
    return Predictor(mean=np.zeros(47), std=np.ones(47), **weights)


def test_the_paper_collects_43_trajectories_at_one_gain():
    config = quadruped_collect.PROFILES["paper"]
    assert (len(quadruped_collect.shards(config)), config.kp) == (43, 1.5)


def test_a_collected_shard_is_a_log_and_is_reproducible():
    shard = quadruped_collect.shards(SHORT)[1]
    table = quadruped_collect.run_shard(SHORT, shard)
    assert table.columns.tolist() == ["trajectory", *COLUMNS]
    assert table["outcome"].tolist()[-1] == "timeout"
    assert set(table["kp"]) == {SHORT.kp}
    pd.testing.assert_frame_equal(quadruped_collect.run_shard(SHORT, shard), table)


def test_the_predictor_is_trained_on_the_collected_log():
    rng = np.random.default_rng(0)
    shards = quadruped_collect.shards(SHORT)
    rows = pd.concat([quadruped_collect.run_shard(SHORT, shard) for shard in shards])
    rows["slam_error"] = rng.integers(0, 2, size=len(rows))  # what the errors are is not the point
    net = _quadruped.predictor(rows, SHORT.seed, SHORT.keypoints, TrainingConfig(epochs=1))
    assert net.w1.shape == (128, 47)


def test_an_evaluated_shard_holds_every_policy_on_the_same_noise(net, monkeypatch):
    monkeypatch.setattr(quadruped_eval, "_trained", lambda *_: net)
    config = replace(
        quadruped_eval.PROFILES["smoke"],
        policies=("constant", "no_quantile", "oracle"),
        supervision=("without", "with"),
        max_s=0.5,
    )
    shards = quadruped_eval.shards(config)
    assert [shard.name for shard in shards] == ["triangle-in-0", "triangle-out-0"]
    table = quadruped_eval.run_shard(config, shards[0])
    assert len(table) == 6
    assert set(table["outcome"]) == {"timeout"}
    assert table.loc[0, "mean_kp"] == 1.5
    again = quadruped_eval.run_shard(config, shards[0])
    pd.testing.assert_frame_equal(again, table)


def test_the_paper_profile_has_the_cells_of_the_paper_and_more():
    config = quadruped_walks.PROFILES["paper"]
    assert len(quadruped_walks.shards(config)) == 3 * 2 * 20
    book = quadruped_eval.PROFILES["book"]
    assert len(quadruped_eval.shards(book)) * len(book.policies) == 36


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"policies": ("brave",)}, r"policies .* not \['brave'\]"),
        ({"shapes": ("star",)}, r"shapes .* not \['star'\]"),
        ({"collect": "huge"}, "collect .* not 'huge'"),
        ({"repeats": 0}, "repeats must be at least 1, not 0"),
    ],
)
def test_settings_are_checked(change, message):
    with pytest.raises(ValueError, match=message):
        replace(quadruped_eval.PROFILES["book"], **change)


def test_collecting_nothing_is_refused():
    with pytest.raises(ValueError, match="trajectories must be above 0, not 0"):
        replace(SHORT, trajectories=0)


def test_an_unknown_policy_is_named(net):
    with pytest.raises(ValueError, match="not 'brave'"):
        _quadruped.policy("brave", GainLimits(kp_min=1, kp_max=2), PolicyConfig(), net)
