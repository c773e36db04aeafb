"""The bounds by hand, their laws, and the trackers held to them along every path."""

import math
from fractions import Fraction
from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cpl.conformal import (
    PI,
    Decaying,
    Fixed,
    RunningMax,
    TrailingRange,
    bounds,
    step_sizes,
    track_exact,
    track_many,
)
from cpl.conformal.reference import follow

ALPHA, ETA, B = 0.1, 0.1, 1  # the paper's highway: eta = 0.1 B

settings = st.fixed_dictionaries(
    {
        "alpha": st.fractions(
            min_value=Fraction(1, 50), max_value=Fraction(49, 50), max_denominator=50
        ),
        "eta": st.fractions(min_value=Fraction(1, 20), max_value=5, max_denominator=20),
        "B": st.fractions(min_value=Fraction(1, 20), max_value=5, max_denominator=20),
    }
)
delays = st.integers(min_value=1, max_value=5)
lengths = st.integers(min_value=1, max_value=300)


@pytest.mark.parametrize(
    ("alpha", "W", "delay", "theorem", "most"),
    [
        (0.1, 40, 1, 0.375, 0.35),
        (0.1, 40, 3, 0.425, 0.40),
        (0.2, 40, 1, 0.475, 0.45),
        (0.2, 40, 2, 0.5, 0.475),
    ],
)
def test_the_papers_settings(alpha, W, delay, theorem, most):
    assert bounds.error_rate_bound(alpha, ETA, B, W, delay=delay) == theorem
    assert bounds.max_errors(alpha, ETA, B, W, delay=delay) / W == most


def test_windows_that_promise_nothing():
    assert [bounds.smallest_informative_window(a, ETA, B) for a in (0.1, 0.2)] == [13, 14]
    assert [bounds.smallest_two_sided_window(a, ETA, B) for a in (0.1, 0.2)] == [110, 55]
    assert [bounds.longest_miss_run(0.1, ETA, B, delay=h) for h in (1, 3)] == [12, 14]
    table = bounds.window_table(0.1, ETA, B, range(1, 120))
    assert table.W[table.informative].min() == 13
    assert table.W[table.min_errors > 0].min() == 110


def test_floating_alpha_times_W_does_not_tip_the_ceiling():
    assert math.ceil(0.55 * 100 + 1) == 57
    assert bounds.max_errors(0.55, 1, 1, W=100) == 56
    assert math.floor(0.29 * 100 - 1) == 27
    assert bounds.min_errors(0.29, 1, 1, W=100) == 28
    for W in range(1, 200):
        exact = bounds.max_errors(Fraction(7, 100), Fraction(1, 10), 1, W)
        assert bounds.max_errors(0.07, 0.1, 1.0, W) == exact


@given(settings, lengths, delays)
def test_counts_lie_strictly_within_the_deviation(setting, W, h):
    deviation = bounds.deviation_bound(**setting, delay=h)
    most, least = (f(**setting, W=W, delay=h) for f in (bounds.max_errors, bounds.min_errors))
    assert 0 <= least <= most <= W
    assert most - setting["alpha"] * W < deviation
    assert setting["alpha"] * W - least < deviation
    assert bounds.error_rate_bound(**setting, W=W, delay=h) > Fraction(most, W)


@given(settings, lengths, delays)
def test_the_start_is_a_window_like_any_other(setting, W, h):
    most, least = (f(**setting, W=W, delay=h) for f in (bounds.max_errors, bounds.min_errors))
    first = bounds.max_errors_from_start(**setting, W=W, delay=h)
    fewest = bounds.min_errors_from_start(**setting, W=W, delay=h)
    assert least <= fewest <= first <= most


@given(settings, delays)
def test_informative_windows_begin_where_the_count_says(setting, h):
    W = bounds.smallest_informative_window(**setting, delay=h)
    assert bounds.max_errors(**setting, W=W, delay=h) < W
    assert W == 1 or bounds.max_errors(**setting, W=W - 1, delay=h) == W - 1
    two = bounds.smallest_two_sided_window(**setting, delay=h)
    assert bounds.min_errors(**setting, W=two, delay=h) == 1
    assert two == 1 or bounds.min_errors(**setting, W=two - 1, delay=h) == 0


@given(settings, delays)
def test_the_width_of_the_range_is_the_deviation(setting, h):
    held = bounds.quantile_range(**setting, delay=h)
    assert held.width == setting["eta"] * bounds.deviation_bound(**setting, delay=h)
    assert held.low in held
    assert held.high not in held
    printed = bounds.quantile_range_as_printed(**setting)
    assert printed.width == bounds.quantile_range(**setting).width


def test_a_start_outside_widens_the_range():
    above = bounds.quantile_range(ALPHA, ETA, B, q1=3)
    assert (above.high, above.high_attained) == (3, True)
    assert 3 in above
    assert str(above) == "[-0.01, 3.0]"
    assert bounds.quantile_range(ALPHA, ETA, B, q1=-2).low == -2


@given(settings, st.integers(min_value=1, max_value=6))
def test_waiting_is_never_worse_than_taking_turns(setting, h):
    turns = bounds.interleaved_deviation_bound(**setting, trackers=h)
    assert bounds.deviation_bound(**setting, delay=h) <= turns


def test_windows_are_counted_with_W_terms_and_as_printed_with_one_more():
    err = np.array([False, True, True, False])
    assert bounds.window_errors(err, 1, 2) == 2
    assert bounds.window_errors_as_printed(err, 0, 2) == 2
    with pytest.raises(ValueError, match="W must leave the window inside the 4 steps"):
        bounds.window_errors_as_printed(err, 1, 3)


def test_the_smaller_statements():
    assert bounds.latch_ratio(Fraction(1, 10)) == 9
    assert bounds.unscored_predictions(2, delay=3) == 2
    assert bounds.error_rate_bound_with_resets(0.1, 0.1, 1, episode_length=40, delay=3) == 0.4
    assert bounds.attained_for_certain(0.9, 1, 2, delay=2)
    assert not bounds.attained_for_certain(0.9, 1, 1.5, delay=2)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"alpha": 1.0}, r"alpha must lie in \(0, 1\), got 1.0"),
        ({"eta": 0}, "eta must be > 0, got 0"),
        ({"B": -1}, "B must be > 0, got -1"),
        ({"W": 0}, "W must be an integer >= 1, got 0"),
        ({"delay": 0}, "delay must be an integer >= 1, got 0"),
    ],
)
def test_bad_arguments_are_named(wrong, message):
    good = {"alpha": 0.1, "eta": 0.1, "B": 1, "W": 10, "delay": 1}
    for bound in (bounds.max_errors, bounds.min_errors, bounds.error_rate_bound):
        with pytest.raises(ValueError, match=message):
            bound(**(good | wrong))


# ------------------------------------------------------------------ varying steps


def test_a_constant_step_gives_theorem_1_back():
    fixed = bounds.variable_step_bound([Fraction(1, 10)] * 40, B=1)
    assert fixed == bounds.deviation_bound(Fraction(1, 10), Fraction(1, 10), 1)


@given(st.lists(st.fractions(min_value=Fraction(1, 9), max_value=9, max_denominator=9), min_size=1))
def test_exact_and_floating_steps_agree(etas):
    exact = bounds.variable_step_bound(etas, B=2)
    assert bounds.variable_step_bound([float(e) for e in etas], B=2) == pytest.approx(float(exact))
    assert bounds.variable_step_bound(etas, B=2, largest_eta=10) >= exact


def test_monotone_steps_are_special_cases():
    rising, falling = [0.25, 0.5, 1], [1, 0.5, 0.25]
    assert bounds.increasing_step_bound(0.25, 1, 2) == bounds.variable_step_bound(rising, 2)
    assert bounds.decreasing_step_bound(1, 0.25, 2) == bounds.variable_step_bound(falling, 2)
    running = [Fraction(1, 10) * s for s in (1, 1, 3, 4)]
    shown = bounds.running_maximum_bound(Fraction(1, 10), 1, 4)
    assert shown == bounds.variable_step_bound(running, 4)


def test_bad_steps_are_named():
    for bad, message in (
        (lambda: bounds.variable_step_bound([], 1), "etas must hold at least one step"),
        (lambda: bounds.inverse_step_variation([1, 0]), "etas must be > 0, got 0"),
        (lambda: bounds.increasing_step_bound(2, 1, 1), "eta_last must be >= eta_first = 2, got 1"),
        (lambda: bounds.decreasing_step_bound(1, 2, 1), "eta_last must be <= eta_first = 1, got 2"),
        (lambda: bounds.running_maximum_bound(1, 2, 1), "maximum_at_start must be <= B = 1, got 2"),
        (lambda: bounds.eventually_safe_range(0.1, 1, -1), "q_floor must be >= 0, got -1"),
    ):
        with pytest.raises(ValueError, match=message):
            bad()


# ------------------------------------------------------- the trackers, along every path


def streams(rng, n, T):
    """Return scores in [0, 1] of many kinds: even, rare, two-valued, drifting, walking."""
    kinds = [
        rng.random((n, T)),
        (rng.random((n, T)) < rng.random((n, 1))).astype(float),
        rng.random((n, T)) ** 8,
        np.clip(np.linspace(0, 1, T) + 0.1 * rng.standard_normal((n, T)), 0, 1),
        np.abs(np.sin(np.cumsum(rng.standard_normal((n, T)), axis=1))),
        np.repeat(rng.random((n, (T + 9) // 10)), 10, axis=1)[:, :T],
    ]
    return np.concatenate(kinds)


def rhythms(n, T):
    """Return scores that alternate between zeros and ones in every rhythm up to n by n."""
    return np.array(
        [np.resize([0.0] * a + [1.0] * b, T) for a, b in product(range(1, n + 1), repeat=2)]
    )


@pytest.fixture(scope="module")
def many():
    """Return 10,900 streams of 400 steps: 10,800 random ones and 100 rhythms of zeros and ones."""
    scores = np.concatenate([streams(np.random.default_rng(1), 1800, 400), rhythms(10, 400)])
    assert scores.shape == (10_900, 400)
    return scores


def window_counts(err, W):
    sums = np.cumsum(err, axis=1, dtype=np.int64)
    return sums[:, W - 1 :] - np.pad(sums, ((0, 0), (1, 0)))[:, :-W]


@pytest.mark.parametrize("delay", [1, 3])
@pytest.mark.parametrize("alpha", [0.125, 0.25, 0.75])
def test_theorem_1_in_millions_of_windows(many, alpha, delay):
    # Dyadic alpha and eta: the tracker's sums are exact, so a tie is a tie.
    eta = 0.0625
    q, err = track_many(many, Fixed(eta=eta), alpha=alpha, delay=delay)
    held = bounds.quantile_range(alpha, eta, 1, delay=delay)
    assert held.low <= q.min()
    assert q.max() < held.high
    windows = 0
    for W in (1, 5, 20, 40, 100, 399):
        counts = window_counts(err, W)
        windows += counts.size
        assert counts.max() <= bounds.max_errors(alpha, eta, 1, W, delay=delay)
        assert counts.min() >= bounds.min_errors(alpha, eta, 1, W, delay=delay)
        first = counts[:, 0]
        assert first.max() <= bounds.max_errors_from_start(alpha, eta, 1, W, delay=delay)
        assert first.min() >= bounds.min_errors_from_start(alpha, eta, 1, W, delay=delay)
    assert windows > 10**7


def test_the_papers_own_numbers_counted_exactly(many):
    for scores in many[::109]:
        err = track_exact(scores, Fixed(eta=ETA), alpha=ALPHA).err
        for W in (5, 40, 200):
            counts = window_counts(err[None], W)
            assert counts.max() <= bounds.max_errors(ALPHA, ETA, B, W)
            assert counts.min() >= bounds.min_errors(ALPHA, ETA, B, W)


@pytest.mark.parametrize("rule", [RunningMax(c=0.125), Decaying(c=0.5, power=0.6)], ids=repr)
def test_varying_steps_obey_abel(many, rule):
    alpha, T = 0.125, many.shape[1]
    _, err = track_many(many, rule, alpha=alpha)
    closest = 0.0
    for scores, misses in zip(many[::50], err[::50], strict=True):
        etas = step_sizes(scores, rule)
        if not (first := int(np.argmax(etas > 0))) < T // 2:
            continue
        for start, W in ((first, T - first), (T // 2, 40)):
            used = etas[start : start + W].tolist()
            deviation = abs(misses[start : start + W].sum() - alpha * W)
            limit = bounds.variable_step_bound(
                used, 1.0, largest_eta=float(etas[: start + W].max())
            )
            closest = max(closest, deviation / limit)
    assert 0 < closest <= 1


def test_the_running_maximum_obeys_its_bound_whatever_the_scores(many):
    rule, alpha = RunningMax(c=0.125), 0.125
    wild = many * np.exp(3 * np.sin(np.arange(400) / 30))
    _, err = track_many(wild, rule, alpha=alpha)
    for start in (20, 200):
        seen = wild[:, : start + 1].max(axis=1)
        alive = seen > 0
        deviation = np.abs(err[:, start:].sum(axis=1) - alpha * (400 - start))[alive]
        limit = 1.125 * wild.max(axis=1)[alive] / (0.125 * seen[alive])
        assert (deviation <= limit).all()
        assert bounds.running_maximum_bound(0.125, 1.0, 2.0) == 1.125 * 2 / 0.125


def test_a_variable_step_can_nearly_exhaust_its_bound():
    # Climb in two huge steps, then sink in tiny ones until the quantile is below zero.
    alpha, small = Fraction(1, 100), Fraction(1, 200)
    path = follow(
        [1, 1] + [0] * 40_000, alpha=alpha, eta=lambda _, t: Fraction(1) if t < 2 else small
    )
    W = path.err.index(True, 2) - 2  # the calm: nothing is missed
    limit = bounds.variable_step_bound([small] * W, 1, largest_eta=1)
    assert limit == bounds.decreasing_step_bound(1, small, 1)
    assert Fraction(99, 100) <= alpha * W / limit < 1


@pytest.mark.parametrize("lag", [0, 1])
def test_the_saturated_integrator_stays_in_its_range(lag):
    rng = np.random.default_rng(2)
    # Includes a C_sat so small that the first steps alone would break a bound without n(1-alpha).
    for K_I, C_sat in product((0.1, 1.0, 30.0), (0.02, 0.5, 5.0)):
        scores = np.concatenate([streams(rng, 20, 300), rhythms(6, 300), np.ones((1, 300))])
        rule = PI(Fixed(eta=0.05), K_I=K_I, C_sat=C_sat, lag=lag)
        _, err = track_many(scores, rule, alpha=0.1)
        excess = np.cumsum(err - 0.1, axis=1)
        constants = {"alpha": 0.1, "eta": 0.05, "B": 1, "K_I": K_I, "C_sat": C_sat, "lag": lag}
        low, high = bounds.pi_error_range(300, **constants)
        envelope = np.array(bounds.pi_envelope(300, **constants))
        tolerance = 1e-9
        assert excess.min() >= low - tolerance
        assert (excess <= envelope + tolerance).all()
        assert envelope.max() <= high + tolerance


def test_the_lag_breaks_the_range_without_lag():
    rng = np.random.default_rng(3)
    rule = PI(Fixed(eta=0.05), K_I=1.0, C_sat=0.5)
    _, err = track_many(streams(rng, 20, 300), rule, alpha=0.1)
    constants = {"alpha": 0.1, "eta": 0.05, "B": 1, "K_I": 1.0, "C_sat": 0.5}
    excess = np.cumsum(err - 0.1, axis=1)
    assert (excess > np.array(bounds.pi_envelope(300, **constants)) + 1e-9).any()
    assert (excess <= np.array(bounds.pi_envelope(300, **constants, lag=1)) + 1e-9).all()


def test_without_the_first_steps_the_closed_form_would_be_false():
    # Two ones are both missed: log 1 = 0 switches the integrator off.
    rule = PI(Fixed(eta=0.05), K_I=1.0, C_sat=0.02, lag=0)
    _, err = track_many(np.ones((1, 2)), rule, alpha=0.1)
    assert err.all()
    turns = [bounds.pi_turning_point(n, eta=0.05, B=1, K_I=1.0, C_sat=0.02) for n in (2, 3)]
    assert err.sum() - 0.2 > max(turns) + 0.9
    with pytest.raises(ValueError, match="lag must be 0 or 1, got 2"):
        bounds.pi_error_range(2, alpha=0.1, eta=0.05, B=1, K_I=1, C_sat=1, lag=2)


def test_signed_scores_obey_the_bound_with_their_range(many):
    alpha, eta = 0.125, 0.0625
    signed = 3 * many - 1  # in [-1, 2]
    _, err = track_many(signed, Fixed(eta=eta), alpha=alpha)
    for W in (40, 399):
        assert (np.abs(window_counts(err, W) - alpha * W) < 3 / eta + 1).all()


def test_a_trailing_range_has_no_bound(many):
    _, err = track_many(np.ones((1, 1000)), TrailingRange(lr=0.1, window=50), alpha=0.1)
    assert err.all()


def test_resets_cost_what_the_bound_allows():
    # Each episode shows 1 until the end: the misses of a start from zero, again and again.
    alpha, eta, length = 0.125, 0.0625, 40
    _, err = track_many(np.ones((1, length)), Fixed(eta=eta), alpha=alpha)
    worst = bounds.error_rate_bound_with_resets(alpha, eta, 1, episode_length=length)
    assert err.mean() == worst
    _, carried = track_many(np.ones((1, 100 * length)), Fixed(eta=eta), alpha=alpha)
    assert carried.mean() < alpha + 0.01 < worst
