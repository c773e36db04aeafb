"""Why agents do not listen, and the attempts to make them: the real run, shrunken."""

from dataclasses import replace

import numpy as np
import pytest

from cpl.experiments.listen import beyond, why_do, why_inside, why_retrained, why_support
from cpl.experiments.trained import agents_beyond, agents_why
from cpl.experiments.trained.agents import need_agents
from cpl.experiments.trained.recipes import RECIPES, roads
from cpl.policies.measures import SUMS, cube

MODULES = [agents_beyond, agents_why, beyond, why_do, why_inside, why_retrained, why_support]


pytestmark = pytest.mark.usefixtures("shared_store")


@pytest.fixture(scope="module")
def tables(smoke):
    return smoke(*(module.__name__.rpartition(".")[2] for module in MODULES))


def test_every_recipe_is_trained_and_leaves_one_network(tables):
    for name in ("agents_why", "agents_beyond"):
        table = tables[name]
        assert set(table["recipe"]) <= set(RECIPES)
        models = table.groupby("recipe")["model"].agg(lambda column: sum(map(bool, column)))
        assert (models == 1).all()
        assert (table["q_low"] <= table["q_middle"]).all()
        assert (table["q_middle"] <= table["q_high"]).all()


def test_wide_roads_differ_in_speed_and_density_only():
    drawn = roads(RECIPES["gate"], "smoke")
    assert len(drawn) == 9
    assert {road.target_speeds[-1] for road in drawn} == {30.0, 40.0, 50.0}
    assert {road.collision_reward for road in drawn} == {-5.0}
    assert len(roads(RECIPES["louder"], "smoke")) == 1


def test_interventions_are_whole_and_leave_the_tracker_alone(tables):
    for name in ("why_do", "why_retrained"):
        table = tables[name]
        assert set(table["doing"]) == {"natural", "mean", "donor", "swap", "set"}
        config = why_do.PROFILES["smoke"]
        told = table.fillna({"value": -1.0}).query("doing != 'mean'")
        for _, part in told.groupby(["agent", "top_mps", "doing", "value"]):
            assert len(part) == config.blocks
        first = table.query("doing == 'natural'")
        assert (first["episodes"] == config.episodes // config.blocks).all()


def test_shares_are_shares_and_probes_are_areas(tables):
    table = tables["why_inside"]
    shares = table[table["question"].isin(["changed", "slower", "faster", "flips"])]["value"]
    assert ((shares >= 0) & (shares <= 1)).all()
    assert (table.query("question == 'gradient'")["value"] >= 0).all()
    assert set(table.query("agent == 'rl_nq'")["of"]).isdisjoint({"features, q at 0"})
    q = table.query("agent == 'rl' and question == 'gradient' and of == 'q'")
    assert len(q) == 1


def test_support_counts_every_decision_with_a_forecast(tables):
    table = tables["why_support"]
    places = table.groupby(["agent", "top_mps", "exploration"])["decisions"].sum()
    assert len(places) == 5
    assert (places > 0).any()


def test_attempts_and_rivals_drive_the_same_episodes(tables):
    table = tables["beyond"]
    config = beyond.PROFILES["smoke"]
    expected = {
        "switch", "switch, carried", "crash forecast", "risk control", "coin", "clock", "cap",
        "safe", "speed", *config.agents,
    }  # fmt: skip
    assert set(table["method"]) == expected
    assert set(table["road"]) == set(config.roads)
    assert set(table.query("method == 'gate'")["doing"]) == {"natural", "mean", "donor"}
    assert set(table.query("method == 'wide_nq'")["doing"]) == {"natural"}
    for _, part in table.query("doing == 'natural'").groupby(["road", "method"]):
        sums = cube(part)
        assert np.isfinite(sums).all()
        assert (sums[..., SUMS.index("episodes")] == config.episodes // config.blocks).all()


def test_agents_are_asked_of_those_who_trained_them():
    needs = need_agents("paper", ["rl", "louder", "wide", "gate"], 11)
    assert {need.experiment: need.shards for need in needs} == {
        "listeners": ("rl-11",),
        "agents_why": ("louder-11",),
        "agents_beyond": ("wide-11", "gate-11"),
    }
    assert all(need.config.pairs == 12 for need in needs)
    with pytest.raises(ValueError, match="got 'nobody'"):
        need_agents("paper", ["nobody"], 0)


@pytest.mark.parametrize("module", MODULES)
def test_every_profile_has_shards_of_unique_names(module):
    for config in module.PROFILES.values():
        names = [shard.name for shard in module.EXPERIMENT.shards(config)]
        assert len(names) == len(set(names)) > 0


@pytest.mark.parametrize(
    ("module", "changes", "message"),
    [
        (agents_why, {"recipes": ("magic",)}, "got 'magic'"),
        (agents_why, {"pairs": 0}, "pairs must be in"),
        (agents_beyond, {"models": "none"}, "models must be in"),
        (agents_beyond, {"steps": 0}, "steps"),
        (why_do, {"agents": ("rl_nq",)}, "got 'rl_nq'"),
        (why_do, {"q_values": ()}, "q_values"),
        (why_do, {"donors": 0}, "donors"),
        (why_inside, {"agents": ("gate",)}, "got 'gate'"),
        (why_inside, {"ridge": 0.0}, "ridge"),
        (why_inside, {"validation_episodes": 1}, "validation_episodes"),
        (why_support, {"agents": ("x",)}, "got 'x'"),
        (why_support, {"explorations": (2.0,)}, "explorations"),
        (beyond, {"agents": ("x",)}, "got 'x'"),
        (beyond, {"roads": ("moon",)}, "got 'moon'"),
        (beyond, {"points": 1}, "points"),
        (beyond, {"donors": 0}, "donors"),
        (beyond, {"epsilons": (2.0,)}, "epsilons"),
    ],
)
def test_impossible_settings_are_refused(module, changes, message):
    with pytest.raises(ValueError, match=message):
        replace(module.PROFILES["smoke"], **changes)
