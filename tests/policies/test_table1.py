"""Table I's analysis against numbers that can be worked out by hand."""

import numpy as np
import pandas as pd
import pytest

from cpl.policies.table1 import (
    PRINTED,
    ROWS,
    against_print,
    agreement,
    beside_hull,
    beside_hull_printed,
    differences,
    equivalent,
    ranks,
    tabulate,
)
from cpl.stats import Estimate


def episodes(points, pairs=3, seeds=40, top=40.0):
    """Every policy lasts its duration at its speed, give or take a second by the seed."""
    parts = []
    for policy, (duration, speed) in points.items():
        for pair in range(pairs):
            steps = duration + np.where(np.arange(seeds) % 2, 1.0, -1.0)
            parts.append(
                pd.DataFrame(
                    {
                        "pair": pair, "top_mps": top, "policy": policy, "seed": np.arange(seeds),
                        "steps": steps, "crashed": True, "speed_sum": speed * (steps - 1),
                        "last_speed": 0.0, "distance_m": speed * steps, "q_sum": 0.1 * steps,
                        "q_steps": steps, "scored": 10, "missed": 1, "fast_steps": 0,
                        "as_speed": policy == "speed",
                    }
                )
            )  # fmt: skip
    return pd.concat(parts, ignore_index=True)


POINTS = {"slow": (40.0, 20.0), "rl": (20.0, 30.0), "switch": (35.0, 24.0), "speed": (10.0, 35.0)}
CELLS = tabulate(episodes(POINTS))


def test_measures_are_ratios_of_sums():
    assert CELLS.value("duration_s", "rl", 40.0) == pytest.approx(20.0)
    assert CELLS.value("clean_speed_mps", "rl", 40.0) == pytest.approx(30.0)
    # The second of the crash, at a standstill here, counts in the other two.
    assert CELLS.value("step_speed_mps", "rl", 40.0) == pytest.approx(30.0 * 19 / 20)
    by_episode = 30.0 * (18 / 19 + 20 / 21) / 2
    assert CELLS.value("episode_speed_mps", "rl", 40.0) == pytest.approx(by_episode)
    assert CELLS.by_pair("mean_q", "rl", 40.0) == pytest.approx([0.1] * 3)
    gap, p = CELLS.difference("duration_s", "switch", "rl", 40.0)
    assert (gap.value, p) == (pytest.approx(15.0), pytest.approx(0.0))
    assert CELLS.ratio("duration_s", "slow", "rl", 40.0).value == pytest.approx(2.0)


def test_the_coin_is_on_the_straight_line():
    speed = {name: CELLS.value("episode_speed_mps", name, 40.0) for name in POINTS}
    share = (speed["switch"] - speed["slow"]) / (speed["rl"] - speed["slow"])
    line = 40 + share * (20 - 40)
    gain = beside_hull(CELLS, 40.0, "switch", family=("slow", "rl"))
    assert gain.value == pytest.approx(35 - line)
    # A point below the line changes nothing, one above it does.
    wider = beside_hull(CELLS, 40.0, "switch", family=("slow", "rl", "speed"))
    assert wider.value <= gain.value
    assert np.isnan(beside_hull(CELLS, 40.0, "speed", family=("slow", "rl")).value)


def test_ranks_and_differences_name_everybody_once():
    names = list(POINTS)
    found = ranks(CELLS, 40.0, rows=names)
    assert found.sum(axis=1).tolist() == pytest.approx([1.0] * 4)
    assert found.loc["slow", 1] == found.loc["speed", 4] == 1.0
    gaps = differences(CELLS, 40.0, rows=names)
    assert len(gaps) == 6
    assert (gaps["p_holm"] >= gaps["p"]).all()


def test_equivalence_needs_the_whole_interval():
    assert equivalent(Estimate(value=30.0, low=29.0, high=31.0, n=9), 30.5, 2.0) == "same"
    assert equivalent(Estimate(value=30.0, low=29.0, high=33.0, n=9), 30.5, 2.0) == "open"
    assert equivalent(Estimate(value=30.0, low=29.0, high=31.0, n=9), 33.5, 2.0) == "other"


def test_the_printed_table_is_the_same_as_itself():
    table = pd.concat(
        episodes({row: PRINTED[row, top][::2] for row in ROWS}, top=top) for top in (30.0, 40.0)
    )
    # Without a second of standing still the speed is the printed one in every episode.
    table = table.assign(speed_sum=table["speed_sum"] * table["steps"] / (table["steps"] - 1))
    found = against_print(tabulate(table))
    assert len(found) == 28
    assert set(found["verdict"]) == {"same"}
    longer = against_print(tabulate(table.assign(steps=table["steps"] * 2)))
    assert set(longer["verdict"]) == {"other"}


def test_agreement_compares_all_four_numbers():
    table = episodes({"speed": (10.0, 35.0), "rl_1": (10.0, 35.0)}, pairs=2)
    assert agreement(table, "speed", "rl_1", 40.0)["all"].all()
    other = table.assign(steps=table["steps"] + (table["policy"] == "rl_1"))
    assert not agreement(other, "speed", "rl_1", 40.0)["all"].any()


def test_holes_and_strangers_are_refused():
    with pytest.raises(ValueError, match="everybody in all blocks"):
        tabulate(episodes(POINTS).query("not (pair == 1 and policy == 'rl')"))
    with pytest.raises(ValueError, match="got 'nobody'"):
        CELLS.value("duration_s", "nobody", 40.0)
    with pytest.raises(ValueError, match="got 'luck'"):
        CELLS.value("luck", "rl", 40.0)


def test_who_is_not_driven_in_a_range_has_nothing_there():
    table = pd.concat([episodes(POINTS), episodes({"rl": (30.0, 25.0)}, top=30.0)])
    cells = tabulate(table)
    assert np.isnan(cells.value("duration_s", "speed", 30.0))
    assert cells.value("duration_s", "rl", 30.0) == pytest.approx(30.0)


def test_the_printed_switch_is_seconds_above_a_coin():
    # At 20-40 the best coin sends the agent, 25.0 s at 32.1 m/s, or brakes, 40 s at 20 m/s.
    share = (23.9 - 20.0) / (32.1 - 20.0)
    assert beside_hull_printed(40.0) == pytest.approx(37.8 - (40.0 - share * 15.0))
