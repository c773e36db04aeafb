"""The experiments with the switch: the real run, shrunken, and what their settings refuse."""

from dataclasses import replace

import numpy as np
import pytest

from cpl.experiments import compute
from cpl.experiments.listen import replays
from cpl.experiments.switch import controls, exit_time, pareto, switch_ablation, switch_choice
from cpl.experiments.switch.setup import evaluation_seeds, validation_seeds
from cpl.policies.measures import SUMS, cube, table_of

MODULES = [pareto, controls, switch_ablation, switch_choice, exit_time, replays]


pytestmark = pytest.mark.usefixtures("shared_store")


@pytest.fixture(scope="module")
def tables(smoke):
    return smoke("pareto", "controls", "switch_ablation", "switch_choice", "exit_time")


def test_every_curve_is_whole(tables):
    for name, keys in (
        ("pareto", ["method", "calibrated"]),
        ("controls", ["control"]),
        ("switch_ablation", ["variant"]),
    ):
        for _, part in tables[name].groupby(keys):
            sums = cube(part)
            assert np.isfinite(sums).all()
            assert (sums[..., SUMS.index("episodes")] > 0).all()


def test_methods_and_controls_are_those_that_were_asked_for(tables):
    found = set(tables["pareto"]["method"])
    assert found == {"conformal", "none", "dropout", "safe", "speed", "never"}
    assert set(tables["pareto"].query("calibrated")["method"]) == {"dropout"}
    assert {"coin", "donor", "oracle crash", "cap", "constant speed"} <= set(
        tables["controls"]["control"]
    )
    assert len(set(tables["switch_ablation"]["variant"])) == 10


def test_the_three_references_are_what_they_say(tables):
    duty = table_of(tables["pareto"], ["method"]).set_index("method")["duty"]
    assert duty["safe"] == 1.0
    assert duty["speed"] == 0.0
    assert 0.0 < duty["never"] < 1.0


def test_the_same_environment_seeds_are_driven_by_all(tables):
    safe = tables["pareto"].query("method == 'safe'").set_index("block")["distance_km"]
    again = tables["controls"].query("control == 'safe'").set_index("block")["distance_km"]
    np.testing.assert_array_equal(safe, again)


def test_long_drives_have_one_row_an_episode(tables):
    rows = tables["switch_choice"]
    config = switch_choice.PROFILES["smoke"]
    sizes = rows.groupby("policy").size()
    assert sizes["switch 0.3"] == config.long_episodes
    assert sizes["safe"] == config.episodes
    assert (rows["floor_missed"] <= rows["floor_scored"]).all()
    assert (rows["floor_scored"] <= rows["scored"] + 3).all()


def test_no_run_of_misses_is_longer_than_the_theory_allows(tables):
    assert (tables["exit_time"]["exit"] <= tables["exit_time"]["allowed"]).all()


@pytest.mark.parametrize(
    ("q", "eta", "delay"), [(0.0, 0.1, 1), (0.0, 0.1, 3), (0.4, 0.02, 3), (-0.05, 0.1, 2)]
)
def test_the_longest_run_is_reached_by_the_worst_scores(q, eta, delay):
    from cpl.conformal import Fixed, track

    err = track(np.ones(200), Fixed(eta=eta), alpha=0.1, delay=delay, q0=q).err
    allowed = exit_time.longest_run(q, eta, alpha=0.1, delay=delay)
    assert int(np.flatnonzero(~err)[0]) == allowed


def test_learned_rides_are_those_of_the_trained_pair_and_of_its_agent():
    rides = compute("replays", profile="smoke", drivers="learned", models="smoke", q_safe=0.0).table
    ego = rides.query("car == 0").dropna(subset="action")
    assert set(ego["policy"]) == {"speed", "switch", "safe", "agent"}
    assert not ego.query("policy == 'agent'")["safe"].any()
    assert ego["q_safe"].nunique() == 1
    assert 0.0 <= ego["q_safe"].iloc[0] <= 2.0
    for _, one in ego.groupby("policy"):
        assert one["l_hat"].notna().sum() == max(len(one) - 4, 0)  # from the fifth observation on


def test_seeds_of_validation_and_test_are_apart():
    assert validation_seeds(100_000).max() < evaluation_seeds(1)[0]


@pytest.mark.parametrize("module", MODULES)
def test_every_profile_has_shards_of_unique_names(module):
    for config in module.PROFILES.values():
        names = [shard.name for shard in module.EXPERIMENT.shards(config)]
        assert len(names) == len(set(names)) > 0


@pytest.mark.parametrize(
    ("module", "changes", "message"),
    [
        (pareto, {"q_safe": (2.5,)}, r"q_safe must lie in \[0, 2\], got 2.5"),
        (pareto, {"methods": ("magic",)}, "got 'magic'"),
        (pareto, {"thresholds": 1}, "thresholds must be in"),
        (pareto, {"episodes": 0}, "episodes must be in"),
        (pareto, {"blocks": 3}, "blocks must divide"),
        (pareto, {"models": "none"}, "models must be in"),
        (pareto, {"delay": 2}, "delay must be in"),
        (pareto, {"alpha": 0.0}, "alpha"),
        (pareto, {"top_speed_mps": 10.0}, "target_speeds"),
        (controls, {"points": 1}, "points"),
        (controls, {"oracle_blocks": 99}, "oracle_blocks"),
        (switch_ablation, {"q_safe": (-0.1,)}, "q_safe"),
        (switch_ablation, {"late": 3}, "late must exceed"),
        (switch_choice, {"q_safe": 3.0}, "q_safe"),
        (switch_choice, {"long_episodes": 1}, "long_episodes"),
        (exit_time, {"before": 0}, "before must be in"),
    ],
)
def test_impossible_settings_are_refused(module, changes, message):
    with pytest.raises(ValueError, match=message):
        replace(module.PROFILES["smoke"], **changes)
