"""What rows 45 to 49 ask of many runs: predictions, odds, windows, alarms, and their intervals."""

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import minimize

from cpl.quadruped.analysis import (
    both_by_chance,
    effects,
    failure_odds,
    foreseen,
    judged,
    logistic,
    overruled,
    resampled,
    weighted_auc,
    windows_covered,
)
from cpl.quadruped.training import auc


def described(names, **more):
    """Return the descriptions of runs on the triangle, in distribution."""
    said = {"config.shape": "triangle", "config.range": "in", "config.policy": "no_quantile"}
    return pd.DataFrame([{"run": name, **said, **more} for name in names])


def steps(run, l_hat, error, q=0.0):
    """Return a run of predictions whose outcomes, two steps later, are `error`."""
    n = len(l_hat)
    code = np.concatenate([[0, 0], np.asarray(error)])[:n]
    padded = np.concatenate([code, np.zeros(n - len(code), dtype=int)])
    return pd.DataFrame(
        {"run": run, "step": range(n), "l_hat": l_hat, "q": q, "slam_error": padded}
    )


def test_a_prediction_meets_what_came_two_steps_later():
    table = steps("a", [0.9, 0.1, 0.5, 0.5], [1, 0])
    rows = foreseen(table, described("a"))
    assert rows[["step", "l_hat", "error"]].to_numpy().tolist() == [[0, 0.9, 1.0], [1, 0.1, 0.0]]
    assert (rows["shape"].iloc[0], rows["policy"].iloc[0]) == ("triangle", "no_quantile")


def test_an_outcome_behind_a_gap_is_unknown():
    table = steps("a", [0.9, 0.1, 0.5, 0.5], [1, 0]).drop(index=2)
    assert foreseen(table, described("a"))["step"].tolist() == [1]


def test_logs_without_predictions_are_not_judged():
    table = pd.DataFrame({"run": ["a"], "step": [0], "x_m": [0.0]})
    assert foreseen(table, described("a")).empty
    assert judged(table, described("a"), 0).empty
    assert overruled(table, described("a"), 0).empty


def test_predictions_are_judged_by_hand():
    """Two runs alike: 0.9 right, 0.9 wrong, 0.1 right, 0.1 wrong."""
    table = pd.concat([steps(run, [0.9, 0.9, 0.1, 0.1, 0, 0], [1, 0, 0, 1]) for run in ("a", "b")])
    rows = judged(table, described("ab"), 0, resamples=20).set_index("number")
    assert rows["value"].to_dict() == pytest.approx(
        {
            "auc": 0.5,
            "brier": (2 * 0.01 + 2 * 0.81) / 4,
            "false_positive_rate": 0.5,
            "false_alarms": 0.5,
            "base_rate": 0.5,
        }
    )
    assert (rows["low"] == rows["value"]).all()  # the runs are alike, so every resample is
    assert (rows["n"] == 2).all()


@given(seed=st.integers(0, 10_000))
def test_the_weighted_auc_is_that_of_repeated_rows(seed):
    rng = np.random.default_rng(seed)
    score, label = rng.integers(0, 5, 20) / 4, rng.integers(0, 2, 20).astype(float)
    weight = rng.integers(0, 3, 20)
    again = np.repeat(np.arange(20), weight)
    expected = auc(score[again], label[again])
    assert weighted_auc(score, label, weight.astype(float)) == pytest.approx(expected, nan_ok=True)


@given(seed=st.integers(0, 10_000))
def test_the_logistic_fit_is_the_likelihoods_maximum(seed):
    rng = np.random.default_rng(seed)
    x = rng.normal(size=(80, 2))
    y = (rng.random(80) < 1 / (1 + np.exp(-(x @ [1.0, -0.5] - 0.3)))).astype(float)
    columns = np.column_stack([np.ones(80), x])

    def loss(beta):
        eta = columns @ beta
        return float(np.logaddexp(0, eta).sum() - y @ eta)

    fit = logistic(x, y)
    assert fit.converged
    other = minimize(loss, np.zeros(3), method="BFGS")
    assert loss(fit.coefficients) <= other.fun + 1e-6
    np.testing.assert_allclose(fit.coefficients, other.x, atol=2e-3)


def test_classes_that_can_be_separated_do_not_converge_and_say_so():
    x = np.array([[0.0], [1.0], [2.0], [3.0]])
    assert not logistic(x, np.array([0.0, 0.0, 1.0, 1.0])).converged


def test_a_weight_counts_a_row_so_often():
    x, y = np.array([[0.0], [0.0], [1.0], [1.0]]), np.array([0.0, 1.0, 0.0, 1.0])
    fit = logistic(x, y, np.array([1.0, 1.0, 1.0, 3.0]))
    assert np.exp(fit.coefficients).tolist() == pytest.approx([1.0, 3.0])


def test_other_labels_than_0_and_1_are_refused():
    with pytest.raises(ValueError, match="y 0 or 1"):
        logistic(np.zeros((2, 1)), np.array([0.0, 2.0]))


def walked(run, speeds, errors):
    """Return a straight walk with the given speeds, and an error where the last one is fast."""
    x = np.concatenate([[0], np.cumsum(0.1 * np.asarray(speeds))])
    return pd.DataFrame(
        {
            "run": run,
            "t_s": 0.1 * np.arange(len(x)),
            "true_x_m": x,
            "true_y_m": 0.0,
            "true_yaw_rad": 0.01 * np.arange(len(x)) ** 2,
            "slam_error": [0, *errors],
        }
    )


def test_faster_runs_with_more_errors_have_odds_above_one():
    rng = np.random.default_rng(0)
    runs = []
    for k in range(12):
        speeds = rng.uniform(0, 1, 60)
        errors = (rng.random(60) < 1 / (1 + np.exp(-(4 * speeds - 3)))).astype(int)
        runs.append(walked(str(k), speeds, errors))
    names = [str(k) for k in range(12)]
    table = failure_odds(pd.concat(runs), described(names), 0, resamples=40)
    fast = table.set_index("term").loc["0.1 m/s faster"]
    assert fast["low"] < np.exp(0.4) < fast["high"]
    assert fast["low"] > 1
    assert fast["n"] == 12
    assert failure_odds(runs[0].drop(columns="true_x_m"), described("0"), 0).empty


def test_two_rollouts_reach_the_level_by_chance_in_a_third_of_the_cases():
    assert both_by_chance() == pytest.approx(0.352, abs=1e-3)
    rng = np.random.default_rng(0)
    errors = rng.random((20_000, 2, 40)) < 0.2
    reached = (errors.mean(axis=2) <= 0.2).all(axis=1).mean()
    assert both_by_chance() == pytest.approx(reached, abs=0.015)


@pytest.mark.parametrize("wrong", [{"alpha": 0.0}, {"W": 0}, {"rollouts": 0}])
def test_a_chance_of_nothing_is_refused(wrong):
    with pytest.raises(ValueError, match="must"):
        both_by_chance(**wrong)


def test_windows_are_counted_and_runs_resampled():
    covered = pd.DataFrame(
        {"run": ["a", "a", "b", "b"], "window": [0, 1, 0, 1], "coverage": [0.8, 0.9, 0.7, 0.85]}
    )
    rows = windows_covered(covered, described("ab"), 0, policy="no_quantile", resamples=50)
    assert rows["shape"].tolist() == ["all", "triangle"]
    first = rows.iloc[0]
    assert (first["reached"], first["whole"], first["n"]) == (0.75, 0.5, 2)
    assert (first["low"], first["high"]) == (0.5, 1.0)
    assert windows_covered(covered, described("ab"), 0, policy="paper").empty


def test_the_rule_is_asked_where_it_was_not():
    """At q = 0.9 the rule overrules every alarm with 0.2 < l_hat < 1.1 - 0 and l_hat - q < 0.2."""
    table = pd.concat(
        [steps(run, [0.9, 0.9, 0.0, 0.0, 0, 0], [1, 1, 0, 0], q=0.5) for run in ("a", "b")]
    )
    rows = overruled(table, described("ab"), 0, resamples=20).set_index("number")["value"]
    # 0.9 + 0.5 is an alarm; 0.9 - 0.5 is not below 0.2, so the rule keeps it.
    assert (rows["overruled"], rows["kept"], rows["none"]) == (0.0, 1.0, 0.0)
    assert np.isnan(rows["true"])
    at_large_q = overruled(table.assign(q=0.9), described("ab"), 0, resamples=20)
    assert at_large_q.set_index("number")["value"]["true"] == 1.0


def scored(differences):
    """Return pairs whose treated run is off by the given differences: (shape, range) -> list."""
    rows = []
    for (shape, gains), values in differences.items():
        for repeat, value in enumerate(values):
            cell = {"shape": shape, "range": gains, "repeat": repeat}
            rows += [
                cell | {"policy": "paper", "x": value},
                cell | {"policy": "no_quantile", "x": 0.0},
            ]
    return pd.DataFrame(rows)


def test_effects_and_interaction_by_hand():
    made = scored({("triangle", "in"): [1.0, 3.0], ("triangle", "out"): [2.0, 5.0]})
    rows = effects(made, "x").set_index(["shape", "part"])
    assert rows.loc[("triangle", "in"), "value"] == 2.0
    assert rows.loc[("triangle", "out - in"), "value"] == 1.5  # 2 - 1 and 5 - 3, paired
    assert rows.loc[("all", "out"), "n"] == 2
    assert rows.loc[("all", "in"), "low"] < 2.0 < rows.loc[("all", "in"), "high"]


def test_a_pair_alone_has_no_interval_and_no_row():
    assert effects(scored({("triangle", "in"): [1.0]}), "x").empty
    assert effects(scored({("triangle", "in"): [1.0]}).query("policy == 'paper'"), "x").empty


def test_runs_of_a_stratum_are_drawn_among_themselves():
    """With one run a stratum nothing can vary."""
    rows = pd.DataFrame({"run": ["a", "b", "b"], "shape": ["x", "y", "y"], "v": [0.0, 1.0, 2.0]})
    told = resampled(
        rows,
        lambda r, w: float((r["v"] * w).sum()),
        np.random.default_rng(0),
        resamples=30,
        stratum="shape",
    )
    assert (told.value, told.low, told.high, told.n) == (3.0, 3.0, 3.0, 2)
    with pytest.raises(ValueError, match="must not be empty"):
        resampled(rows.iloc[:0], lambda r, w: 0.0, np.random.default_rng(0))
