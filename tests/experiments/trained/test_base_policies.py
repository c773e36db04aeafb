"""The base policies as an experiment, and the check of the learner."""

import numpy as np
import pytest

from cpl.experiments import compute
from cpl.experiments.trained.base_policies import EXPERIMENT, PROFILES, Config, road
from cpl.experiments.trained.learner_check import compare
from cpl.experiments.trained.policies import base_policy, need_policies
from cpl.highway import PAPER
from cpl.network import decode_networks


def test_the_papers_road_and_rewards():
    config = PROFILES["paper"]
    assert road(config, "speed") == PAPER
    safe = road(config, "safe")
    assert (safe.collision_reward, safe.high_speed_reward, safe.right_lane_reward) == (-1, 0, 0)
    assert len(EXPERIMENT.shards(config)) == 20
    with pytest.raises(ValueError, match=r"kind must be one of .* got 'fast'"):
        road(config, "fast")


def test_trained_policies_are_found_again():
    result = compute("base_policies", profile="smoke", steps=400)
    table = result.table
    assert table.groupby("kind").size().tolist() == [10, 10]
    assert (table["seed"] < 10_000_000).all()
    last = table.groupby("kind")["model"].last()
    assert table["model"].map(bool).sum() == 2
    assert decode_networks(last["safe"]).config["parameters"]["steps"] == 400
    need = need_policies("paper", 0)
    inputs = {need.label: {f"{kind}-0": rows for kind, rows in table.groupby("kind")}}
    obs = np.random.default_rng(0).random((6, 5, 5), dtype=np.float32)
    for kind in ("safe", "speed"):
        drive = base_policy(inputs, kind, 0)
        assert drive.network.sizes == (25, 64, 64, 5)
        assert set(drive(obs)) <= set(range(5))
    with pytest.raises(ValueError, match="got 'safe-1'"):
        base_policy(inputs, "safe", 1)


def test_a_pair_is_the_same_however_many_there_are():
    one, two = (Config(pairs=n, steps=200, vehicles_count=4, hidden=(16,)) for n in (1, 2))
    first = [EXPERIMENT.run(config, EXPERIMENT.shards(config)[0]) for config in (one, two)]
    assert first[0].equals(first[1])


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"pairs": 0}, r"pairs must be in \[1, inf\)"),
        ({"learner": "torch"}, "learner must be .* got 'torch'"),
        ({"levels": 1}, r"levels must be in \[2, inf\)"),
        ({"steps": 0}, "steps must be an integer >= 1, got 0"),
        ({"vehicles_count": -1}, "vehicles_count must be"),
    ],
)
def test_impossible_settings_are_refused(changes, message):
    with pytest.raises(ValueError, match=message):
        Config(**({"pairs": 1} | changes))


def test_the_check_compares_trainings():
    table = compute("learner_check", profile="smoke").table
    assert table.groupby(["kind", "learner", "training", "top_speed_mps"]).size().eq(4).all()
    found = compare(table)
    assert len(found) == 8
    assert found["p_value"].between(1 / 3, 1).all()  # of two against two there are six ways
