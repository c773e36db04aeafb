"""What the experiments of the theory compute, on tiny configurations and against known numbers."""

from fractions import Fraction

import numpy as np
import pytest

from cpl.conformal import RunningMax, track_many
from cpl.experiments import compute
from cpl.experiments.theory._sequences import CLOSED, OBLIVIOUS, adversarial_scores
from cpl.experiments.theory.eventually_safe import _largest_deviation
from cpl.experiments.theory.windows import _COUNTEREXAMPLE, _breaks
from cpl.rng import stream


@pytest.mark.parametrize("kind", [*OBLIVIOUS, *CLOSED])
def test_sequences_stay_in_range_and_differ(kind):
    rule = RunningMax(c=0.1)
    scores = adversarial_scores(kind, (4, 120), stream(0, kind), rule=rule, alpha=0.1, B=0.5)
    assert scores.shape == (4, 120)
    assert scores.min() >= 0
    assert scores.max() <= 0.5
    assert len(np.unique(scores, axis=0)) == 4


def test_closed_loop_sequences_see_the_threshold():
    rule = RunningMax(c=0.1)
    ties = adversarial_scores("tie", (2, 200), stream(0), rule=rule, alpha=0.1, B=1.0)
    q, err = track_many(ties, rule, alpha=0.1)
    assert (ties == q)[:, 1:].mean() > 0.5
    assert not err[ties == q].any()


def test_the_counterexample_of_theorem_1_by_hand():
    """s = (0, B, B): two misses in the printed window T0 = 2, W = 1, and 2 > 1.95."""
    alpha, eta, B = _COUNTEREXAMPLE
    count = np.array([[0, 0, 1, 2]])  # q = 0, -0.1, 0.8: covered, missed, missed
    found = _breaks(count, alpha, eta, B, Fraction(0))
    assert found["printed"] == 1
    assert found["corrected"] == found["lower"] == found["beyond_exact"] == 0
    assert found["windows"] == 6


def test_windows_notice_a_broken_tracker():
    """Misses all the time cannot come from the tracker: the corrected form must be broken."""
    count = np.arange(61)[None, :]
    found = _breaks(count, Fraction(1, 10), Fraction(1, 10), Fraction(1), Fraction(0))
    assert found["corrected"] > 0
    assert found["beyond_exact"] > 0
    never = _breaks(count * 0, Fraction(1, 2), Fraction(1), Fraction(1), Fraction(0))
    assert never["lower"] > 0


def test_windows_in_the_papers_own_setting_survive_as_printed():
    table = compute("windows", "smoke").table.set_index("origin")
    assert table.loc["paper", "printed"] == 0
    assert table.loc["counterexample", "printed"] > 0
    assert table["corrected"].sum() == table["beyond_exact"].sum() == 0


def test_largest_deviation_against_all_windows():
    rng = stream(0, "deviation")
    err, alpha = rng.random((30, 6)) < 0.3, Fraction(1, 5)
    excess = np.concatenate([np.zeros((1, 6)), (5 * err.astype(int) - 1).cumsum(axis=0)])
    brute = [max(abs(e[j] - e[i]) for i in range(31) for j in range(i, 31)) for e in excess.T]
    assert _largest_deviation(err, alpha).tolist() == brute


def test_range_is_attained_below_and_approached_above():
    table = compute("quantile_range", "book").table
    assert not table["leaves"].any()
    assert np.allclose(table["q_min"], table["low"])
    own = table[(table["setting"] == 0) & (table["delay"] == 1)].iloc[0]
    assert own["q_max"] == pytest.approx(1.08)  # on its grid of 0.01 just under 1.09
    assert own["leaves_printed_high"]
    assert not own["leaves_printed_low"]  # loose for alpha <= 1/2


def test_update_rules_meet_the_same_scores_and_part():
    table = compute("update_rule", "smoke").table
    rate = table.assign(rate=table["errors"] / table["T"]).groupby("rule")["rate"].mean()
    assert rate["printed"] > 0.99
    assert rate["corrected"] < 0.15


def test_trailing_maximum_fails_where_the_running_one_holds():
    table = compute("adaptive_step", "smoke").table
    running = table[table["reading"] == "running"]
    assert running["violations"].sum() == 0
    freeze = table[table["kind"] == "freeze"]
    assert (freeze["error_rate"] == 1.0).all()
    excluded = table[table["kind"] == "excluded"]
    # alpha + (1 - alpha) / (w + 1), as long as the sequence runs
    assert excluded["error_rate"].iloc[0] == pytest.approx(0.1 + 0.9 / 11, abs=0.03)


def test_safety_is_what_makes_the_difference():
    table = compute("eventually_safe", "smoke").table
    assert table["violations"].sum() == 0
    unbounded = table[table["condition"] == "unbounded"]
    assert (unbounded["unsafe_broken"] > 0).all()
    assert (table["safe"] + table["unsafe"] == table["processes"]).all()
    assert (table["processes"] == 9 * 16).all()  # 3^2 labellings, 2^4 dynamics


def test_split_conformal_sums_are_of_the_draws():
    table = compute("split_conformal", "smoke").table.set_index("kind")
    cells = table.filter(like="pit_").sum(axis=1)
    assert cells["independent"] == cells["shared level"] == 500
    assert cells["urn"] == cells["ties"] == 0
    assert table["covered"].between(425, 490).all()


def test_smoke_runs_of_the_rest():
    assert compute("pathwise", "smoke").table[["above", "below"]].sum().sum() == 0
    assert set(compute("certificates", "smoke").table["verdict"]) <= {"proved", "found"}
