"""Sums over blocks, ratios of sums, and comparisons of curves made of them."""

import numpy as np
import pandas as pd
import pytest

from cpl.policies.comparison import (
    chosen,
    compare,
    curve_of,
    estimates,
    foretold,
    leads,
    standing,
    summary,
    weights_for,
)
from cpl.policies.measures import AXES, MEASURES, SUMS, block_sums, cube, measure, table_of
from cpl.policies.standings import marked, overview, sound_pairs, standings
from cpl.stats import Estimate


def rides(seeds=8, settings=2):
    """Episodes with round numbers: every second one crashes at its last step."""
    n = seeds * settings
    crashed = np.arange(n) % 2 == 1
    steps = np.where(crashed, 10, 40)
    return pd.DataFrame(
        {
            "setting": np.repeat(np.arange(settings), seeds),
            "seed": np.tile(20_000_000 + np.arange(seeds), settings),
            "steps": steps,
            "crashed": crashed,
            "speed_sum": np.where(crashed, 9 * 30.0 + 12.0, 40 * 20.0),
            "last_speed": np.where(crashed, 12.0, 20.0),
            "distance_m": np.where(crashed, 300.0, 800.0),
            "overtaken": np.where(crashed, 3, 1),
            "safe_steps": np.where(crashed, 5, 40),
            "changes": 1,
            "u_sum": 1.0,
            "u_steps": 4,
            "scored": 5,
            "missed": 1,
        }
    )


def test_every_measure_by_hand():
    pooled = table_of(block_sums(rides(), 4).assign(method="x"), ["method"]).iloc[0]
    expected = {
        "duration_s": 25.0,
        "crash_rate": 0.5,
        "crashes_per_km": 0.5 / 0.55,
        "crashes_per_overtaken": 0.25,
        "episode_speed_mps": (28.2 + 20) / 2,
        "step_speed_mps": (282 + 800) / 50,
        "clean_episode_speed_mps": 25.0,
        "clean_step_speed_mps": (270 + 800) / 49,
        "distance_km": 0.55,
        "overtaken": 2.0,
        "duty": 0.9,
        "changes": 1.0,
        "mean_u": 0.25,
        "error_rate": 0.2,
    }
    assert set(expected) == set(MEASURES)
    assert {name: pooled[name] for name in expected} == pytest.approx(expected)


def test_a_crash_in_the_first_step_has_no_clean_speed():
    one = rides().iloc[:1].assign(steps=1, crashed=True, speed_sum=9.0, last_speed=9.0)
    pooled = table_of(block_sums(one, 1), ["setting"]).iloc[0]
    assert np.isnan(pooled["clean_episode_speed_mps"])
    assert pooled["episode_speed_mps"] == 9.0


def test_blocks_are_consecutive_seeds_and_the_same_in_all_settings():
    sums = block_sums(rides(), 4)
    assert sums.groupby("setting")["block"].apply(list).tolist() == [[0, 1, 2, 3]] * 2
    assert (sums["episodes"] == 2).all()
    with pytest.raises(ValueError, match="blocks must divide the 8 seeds"):
        block_sums(rides(), 3)


def table(gain=0.0, pairs=6, blocks=5, levels=4, noise=0.05, seed=0):
    """Two methods on a straight front; the second is faster by `gain`."""
    rng, rows = np.random.default_rng(seed), []
    for pair in range(pairs):
        skill = rng.normal(scale=noise)
        for block in range(blocks):
            luck = rng.normal(scale=noise)
            for method, extra in (("a", 0.0), ("b", gain)):
                for level in range(levels):
                    speed = 22.0 + 2.0 * level + extra + skill + luck
                    row = dict.fromkeys(SUMS, 1.0) | {"episodes": 100, "steps": 4000 - 500 * level}
                    row |= {"episode_speed_sum": 100 * speed, "speed_sum": speed * row["steps"]}
                    row |= {"crashes": 10 * level + 1, "distance_km": 80.0}
                    rows.append({"pair": pair, "method": method, "level": level, "block": block, **row})  # fmt: skip  # noqa: E501
    return pd.DataFrame(rows)


@pytest.mark.parametrize("axes", AXES.values(), ids=list(AXES))
def test_a_lead_of_one_metre_a_second_is_found(axes):
    found = compare(table(1.0), {"method": "b"}, {"method": "a"}, axes)
    np.testing.assert_allclose(found.gain.value, 1.0)
    assert found.least.low > 0
    assert found.volume.low > 0
    assert found.p < 0.05
    back = compare(table(1.0), {"method": "a"}, {"method": "b"}, axes)
    np.testing.assert_allclose(back.gain.value, -found.gain.value)


def test_no_lead_is_not_called_one():
    found = compare(table(0.0), {"method": "b"}, {"method": "a"}, AXES["paper"])
    assert found.gain.low.max() <= 0 <= found.gain.high.min()
    assert found.volume.low <= 0 <= found.volume.high


def test_shared_ends_count_for_the_area_only():
    rows = table(1.0)
    ends = rows[rows["method"] == "a"].query("level == 3").assign(method="end", level=0)
    both = pd.concat([rows, ends.assign(steps=500, episode_speed_sum=3500.0)])
    plain = compare(both, {"method": "b"}, {"method": "a"}, AXES["paper"])
    ended = compare(
        both, {"method": "b"}, {"method": "a"}, AXES["paper"], ends=({"method": "end"},)
    )
    np.testing.assert_array_equal(plain.levels, ended.levels)
    assert plain.volume.value != ended.volume.value


def test_curves_are_compared_on_the_blocks_they_share():
    rows = table(1.0)
    short = rows[(rows["method"] == "a") | (rows["block"] < 3)]
    found = compare(short, {"method": "b"}, {"method": "a"}, AXES["exposure"])
    same = compare(rows[rows["block"] < 3], {"method": "b"}, {"method": "a"}, AXES["exposure"])
    np.testing.assert_array_equal(found.gain.value, same.gain.value)


def test_estimates_and_curves_agree_with_the_pooled_table():
    rows = chosen(table(), {"method": "a"})
    pooled = table_of(rows, ["level"])["episode_speed_mps"].to_numpy()
    found = estimates(rows, "episode_speed_mps")
    np.testing.assert_allclose([e.value for e in found], pooled)
    assert all(e.low < e.value < e.high for e in found)
    curve = curve_of(rows, AXES["paper"], weights_for(rows))
    np.testing.assert_allclose(curve.y, pooled)


def test_the_next_training_seed_is_foretold():
    """With 40 pairs, one more lies inside in about 95 of 100 cases, and the interval says so."""
    rows = chosen(table(pairs=41, noise=0.5, seed=3), {"method": "a"})
    inside = []
    for pair in range(41):
        others, left = rows[rows["pair"] != pair], rows[rows["pair"] == pair]
        new = table_of(left, ["level"])["episode_speed_mps"].to_numpy()
        told = foretold(others, "episode_speed_mps")
        inside.append(np.mean([e.low <= v <= e.high for e, v in zip(told, new, strict=True)]))
    assert 0.85 <= np.mean(inside) <= 1.0
    with pytest.raises(ValueError, match="at least two pairs, got 1"):
        foretold(rows[rows["pair"] == 0], "episode_speed_mps")


def test_others_without_a_level_in_common_are_left_out():
    rows = table(1.0)
    far = rows[rows["method"] == "a"].assign(method="far", steps=100)
    found = leads(pd.concat([rows, far]), "method", "b", ["a", "far"], AXES["paper"])
    assert list(found) == ["a"]


def test_standings_have_a_row_for_every_range_and_plane_that_there_is():
    rows = table(1.0)
    ends = [chosen(rows, {"method": "a", "level": k}).assign(method=name)
            for k, name in ((0, "safe"), (3, "never"))]  # fmt: skip
    both = pd.concat([rows, *ends]).assign(calibrated=False, top_mps=40.0)
    again = chosen(both, {"method": "a"}).assign(calibrated=True)
    everything = pd.concat([both, again, both.assign(top_mps=50.0)])
    planes = {name: AXES[name] for name in ("paper", "exposure")}
    found = standings(everything, "b", ["a"], planes)
    assert found[["top_mps", "plane"]].to_numpy().tolist() == [
        [40.0, "paper"], [40.0, "exposure"], [50.0, "paper"], [50.0, "exposure"],
    ]  # fmt: skip
    assert [marked(lead) for lead in found["a"]] == ["+1.00*"] * 4
    calibrated = standings(everything, "b", ["a"], planes, calibrated=True)
    assert calibrated["top_mps"].tolist() == [40.0, 40.0]
    assert sound_pairs(chosen(both, {"method": "safe"})) == list(range(6))
    assert sound_pairs(chosen(both, {"method": "never"}).assign(method="safe")) == []
    told = overview(everything, "b", ["a"], top_mps=40.0)
    assert told["rivals"].value_counts().to_dict() == {
        "as published": 6, "as published, sound pairs": 2, "calibrated": 2,
    }  # fmt: skip
    assert set(told["a"]) == {"+1.00*"}


def test_a_summary_has_the_spread_between_pairs():
    both = pd.concat([rides().assign(pair=0), rides().assign(pair=1, steps=20)])
    row = summary(both.assign(q_safe=0.3, policy="switch"), ["policy"]).iloc[0]
    assert row["duration_s"] == pytest.approx(22.5)
    assert row["duration_sd_s"] == pytest.approx(np.std([25.0, 20.0], ddof=1))
    assert row["step_speed_mps"] == pytest.approx(2 * (282 + 800) / (2 * 45))
    assert row["crash_rate"] == 0.5


def test_a_lead_has_a_word():
    def words(low, high):
        return standing(Estimate(value=0.0, low=low, high=high, n=3))

    assert [words(0.1, 1.0), words(-1.0, -0.1), words(-1.0, 1.0)] == [
        "ahead of", "behind", "level with",
    ]  # fmt: skip


def test_what_is_missing_is_named():
    rows = table()
    with pytest.raises(ValueError, match="values must be in the table"):
        chosen(rows, {"method": "c"})
    with pytest.raises(ValueError, match="table must have"):
        cube(chosen(rows, {"method": "a"}).iloc[1:])
    with pytest.raises(ValueError, match="name must be one of"):
        measure(np.zeros(len(SUMS)), "speed")
