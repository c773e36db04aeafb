"""Many runs at once: numbers from whatever the logs hold, the bound, pairs, alarms."""

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cpl.conformal import RunningMax, track
from cpl.quadruped.analysis import (
    alarms,
    alarms_by_policy,
    compare,
    coverage_beside_bound,
    failure_shares,
    guaranteed_coverage,
    possible,
    reversals,
    score_runs,
)
from cpl.quadruped.metrics import windowed_coverage

WAYPOINTS = ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0))


def logged(run, policy, *, end, repeat=0, steps=50):
    """Return a straight walk along the x axis that misses its end by something in y."""
    along = np.linspace(0, 1, steps)
    return pd.DataFrame(
        {
            "run": run,
            "step": range(steps),
            "t_s": 0.1 * np.arange(steps),
            "x_m": along,
            "y_m": 0.0,
            "true_x_m": along,
            "true_y_m": end * along,
            "slam_error": [1] * 5 + [0] * (steps - 5),
            "l_hat": 0.5,
            "q": 0.9,
            "score": [np.nan, np.nan, *[0.5] * (steps - 2)],
            "err": [-1, -1, *[0] * (steps - 2)],
            "outcome": [""] * (steps - 1) + ["arrived"],
        }
    ), {
        "run": run,
        "provenance": "simulated-kinematic",
        "config.shape": "triangle",
        "config.range": "in",
        "config.policy": policy,
        "config.repeat": repeat,
        "config.waypoints": WAYPOINTS,
        "config.tracker.alpha": 0.2,
        "config.tracker.c": 0.1,
        "config.tracker.delay": 2,
    }


@pytest.fixture
def runs():
    """Return the tables of four runs: two policies, two repeats."""
    made = [
        logged("a", "paper", end=0.1),
        logged("b", "no_quantile", end=0.3),
        logged("c", "paper", end=0.2, repeat=1),
        logged("d", "no_quantile", end=0.3, repeat=1),
    ]
    return pd.concat([rows for rows, _ in made]), pd.DataFrame([said for _, said in made])


@pytest.fixture
def poses_only(runs):
    """Return the first run as a third party would have it: poses, and nobody knows the truth."""
    table, summary = runs
    return table.query("run == 'a'")[["run", "step", "t_s", "x_m", "y_m"]], summary.iloc[
        :1, :2
    ].copy()


def test_a_run_is_scored_by_hand(runs):
    first = score_runs(*runs).iloc[0]
    assert (first["policy"], first["repeat"], first["outcome"]) == ("paper", 0, "arrived")
    assert first["start_end_m"] == pytest.approx(np.hypot(1, 0.1))
    assert first["believed_start_end_m"] == 1.0
    assert first["path_error_m"] == pytest.approx(0.05)
    assert first["slam_error_rate"] == 0.1
    assert (first["coverage"], first["windows_below"]) == (1.0, 0.0)


def test_what_is_missing_is_not_made_up(poses_only):
    first = score_runs(*poses_only).iloc[0]
    assert first["believed_start_end_m"] == 1.0
    assert np.isnan(
        first[["start_end_m", "path_error_m", "slam_error_rate", "coverage"]].tolist()
    ).all()
    told = possible(*poses_only).set_index("analysis")
    assert told["runs"].tolist() == [1, 0, 0, 0, 0, 0, 0]
    assert told.loc["coverage, and its bound", "missing"] == "score, err, config.tracker.alpha"


def test_what_cannot_be_compared_gives_no_rows(poses_only):
    rng = np.random.default_rng(0)
    assert compare(score_runs(*poses_only), "duration_s", rng).empty
    assert coverage_beside_bound(*poses_only).empty
    assert alarms(*poses_only).empty


def test_pairs_share_their_repeat(runs):
    told = compare(score_runs(*runs), "path_error_m", np.random.default_rng(0))
    assert told["shape"].tolist() == ["triangle", "all"]
    one = told.iloc[0]
    assert one["difference"] == pytest.approx(-0.075)
    assert (one["n"], one["p"], one["least_p"], one["better"]) == (2, 0.5, 0.5, 1.0)


def test_alarms_are_sorted_by_what_the_rule_does_with_them(runs):
    # l_hat + q = 1.4 > 1.1 and l_hat - q = -0.4 < 0.2 at every step: all alarms are overruled,
    # and of the 48 steps of a run with a known outcome those numbered 0, 1, 2 were right.
    told = alarms(*runs).set_index("what")
    assert told["steps"].to_dict() == {"no alarm": 0, "alarm kept": 0, "alarm overruled": 192}
    assert told.loc["alarm overruled", "slam_errors"] == 12


def test_alarms_are_asked_policy_by_policy(runs, poses_only):
    told = alarms_by_policy(*runs)
    assert told["policy"].tolist() == ["no_quantile"] * 3 + ["paper"] * 3
    assert told["steps"].tolist() == [0, 0, 96] * 2
    assert alarms_by_policy(*poses_only).empty


def test_an_outcome_behind_a_gap_does_not_count(runs):
    table, summary = runs
    assert alarms(table[table["step"] != 10], summary)["steps"].sum() == 4 * (48 - 2)


def test_windows_stand_beside_their_own_bound(runs):
    told = coverage_beside_bound(*runs)
    assert len(told) == 4 * (48 - 40 + 1)
    assert set(told["guaranteed"].round(3)) == {0.2}


def test_few_repeats_can_point_the_other_way():
    assert reversals([1.0, 1.0, 1.0, 1.0], 3) == 0.0
    assert np.isnan(reversals([1.0, 2.0], 3))


@given(
    st.lists(st.sampled_from([0.0, 0.05, 0.3, 0.7, 1.0]), min_size=30, max_size=90),
    st.integers(1, 3),
)
def test_no_scores_break_the_bound(scores, delay):
    err = track(scores, RunningMax(c=0.1), alpha=0.2, delay=delay).err.astype(int)
    covered = windowed_coverage(err, W=20)
    seen = np.maximum.accumulate(scores)[: len(covered)]
    bound = guaranteed_coverage(seen, alpha=0.2, c=0.1, W=20, delay=delay)
    assert (covered >= bound - 1e-9).all()


def test_a_window_has_at_least_one_step():
    with pytest.raises(ValueError, match="W must be at least 1, not 0"):
        guaranteed_coverage([1.0], alpha=0.2, c=0.1, W=0, delay=2)


def test_a_run_counts_once_in_a_bin():
    made = [logged(f"r{k}", "paper", end=0.0)[0].assign(true_yaw_rad=0.0) for k in range(5)]
    told = failure_shares(pd.concat(made)).set_index("motion")
    # 1 m in 49 steps of 0.1 s is 0.204 m/s: the bin from 0.2 to 0.4; 4 of 49 steps have an error
    assert told.loc["speed [m/s]", ["middle", "n"]].tolist() == pytest.approx([0.3, 5])
    assert told.loc["turning [rad/s]", "middle"] == pytest.approx(0.2)
    assert told["value"].tolist() == pytest.approx([4 / 49] * 2)
