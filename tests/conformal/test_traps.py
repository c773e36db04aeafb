"""Every trap snaps, and the safe rule beside it does not."""

from fractions import Fraction

import numpy as np
import pytest

from cpl.conformal import Fixed, RunningMax, TrailingMax, TrailingRange, bounds, track, track_exact
from cpl.conformal.reference import follow, running_maximum
from cpl.conformal.traps import (
    TRAPS,
    clipped_at_zero,
    clipped_comparison,
    clipped_state,
    constant_scores_and_trailing_range,
    every_dangerous_step_missed,
    floored_trailing_maximum,
    past_trailing_maximum,
    printed_theorem,
    printed_update,
    trailing_maximum_frozen,
    traps_table,
)


def as_floats(trap):
    return np.array([float(s) for s in trap.path.scores])


def test_trailing_maximum_freezes_below_zero():
    trap = trailing_maximum_frozen()
    assert trap.path.q[-1] < 0
    assert trap.error_rate == 1
    assert all(s == 0 for s in trap.path.scores[trap.start :])
    # The trap stands on a tie, so floats need numbers that they hold exactly.
    dyadic = trailing_maximum_frozen(alpha=0.125, c=1, window=8, second=0.5)
    _, err = track(as_floats(dyadic), TrailingMax(c=1.0, window=8), alpha=0.125)
    assert err[dyadic.start :].all()
    assert dyadic.error_rate == 1
    safe = follow(trap.path.scores, alpha=0.1, eta=running_maximum(0.1))
    assert safe.error_rate <= 0.15
    _, err = track(as_floats(trap), RunningMax(c=0.1), alpha=0.1)
    assert err.mean() <= 0.15


@pytest.mark.parametrize(("floor", "T", "rate"), [(0.01, 2200, 0.55), (0.001, 6100, 0.92)])
def test_a_floor_is_not_enough(floor, T, rate):
    trap = floored_trailing_maximum(floor=floor, T=T)
    assert trap.error_rate == pytest.approx(rate, abs=0.01)
    safe = follow(trap.path.scores, alpha=0.1, eta=running_maximum(0.1))
    assert abs(sum(safe.err) - 0.1 * T) <= bounds.running_maximum_bound(0.1, 1, 1)


@pytest.mark.parametrize("window", [3, 10, 20])
def test_leaving_the_current_score_out_costs_one_miss_a_cycle(window):
    trap = past_trailing_maximum(window=window, cycles=200)
    assert trap.error_rate == pytest.approx(0.1 + 0.9 / (window + 1), abs=0.005)
    ones = [t for t, s in enumerate(trap.path.scores) if s == 1]
    assert all(trap.path.err[t] for t in ones)


def test_constant_scores_freeze_the_trailing_range():
    trap = constant_scores_and_trailing_range()
    assert trap.error_rate == 1
    q, err = track(as_floats(trap), TrailingRange(lr=0.1, window=10), alpha=0.1)
    assert err.all()
    assert q[-1] == q[1]


@pytest.mark.parametrize("alpha", [0.05, 0.1, 0.3])
def test_clipping_the_state_misses_every_second_step(alpha):
    trap = clipped_state(alpha=alpha)
    assert trap.error_rate == 0.5
    free = follow(trap.path.scores, alpha=alpha, eta=0.1)
    assert sum(free.err) <= bounds.max_errors_from_start(alpha, 0.1, 1, len(free.err))


def test_clipping_at_zero_loses_the_lower_side_only():
    trap = clipped_at_zero()
    assert sum(trap.path.err) == 0 < bounds.min_errors_from_start(0.1, 0.1, 1, 200)
    rng = np.random.default_rng(5)
    for kind in (1, 8):
        scores = (rng.random(400) ** kind).round(3).tolist()
        err = follow(scores, alpha=0.1, eta=0.1, keep_within=(0, None)).err
        for W in (20, 100):
            for start in range(0, 400 - W, 7):
                errors = bounds.window_errors(err, start, W)
                assert errors <= bounds.max_errors(0.1, 0.1, 1, W)


def test_clipping_the_comparison_winds_up():
    trap = clipped_comparison()
    assert trap.path.q[10_000] == -100
    assert trap.error_rate == 1
    assert len(trap.path.err) - trap.start > 1000 > bounds.longest_miss_run(0.1, 0.1, 1)


def test_every_dangerous_step_is_missed_at_ninety_percent_coverage():
    trap = every_dangerous_step_missed()
    assert len(trap.danger) / len(trap.path.err) == 0.08
    assert trap.error_rate == 0.1001
    assert trap.danger_error_rate == 1
    err = track_exact(as_floats(trap), Fixed(eta=0.1), alpha=0.1).err
    assert err.mean() == 0.1001
    assert err[sorted(trap.danger)].all()
    with pytest.raises(ValueError, match=r"every must be >= 1 / alpha \+ 1 = 11, got 9"):
        every_dangerous_step_missed(every=9)
    with pytest.raises(ValueError, match="danger must hold at least one time"):
        _ = clipped_state().danger_error_rate


def test_the_printed_forms():
    trap = printed_theorem()
    limit = bounds.error_rate_bound(0.1, 1, 0.85, W=1)
    assert bounds.window_errors_as_printed(trap.path.err, trap.start, 1) > limit
    assert bounds.window_errors(trap.path.err, trap.start, 1) < limit
    assert printed_update().error_rate == 1
    assert follow(printed_update().path.scores, alpha=0.1, eta=0.05).error_rate < 0.15


def test_drift_of_the_running_sum_is_tiny_and_the_count_has_none():
    scores = np.random.default_rng(6).random(1_000_000)
    summed = track(scores, Fixed(eta=0.1), alpha=0.1)
    counted = track_exact(scores, Fixed(eta=0.1), alpha=0.1)
    same = summed.err == counted.err
    assert same.all()
    drift = float(np.abs(summed.q - counted.q).max())
    assert 1e-15 < drift < 1e-10


def test_the_table_names_every_trap():
    table = traps_table()
    assert len(table) == len(TRAPS) == table.trap.nunique()
    unfair = table[table.trap != "Theorem 1 as printed"]
    assert (np.abs(unfair.error_rate - unfair.alpha) > 0.05).sum() == len(unfair) - 1
    assert Fraction(1, 10) == printed_update().alpha
