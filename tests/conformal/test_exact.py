"""The count form against rational arithmetic, and the drift that it does not have."""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cpl.conformal import Fixed, RunningMax, track, track_exact

quarters = st.integers(-8, 40).map(lambda k: k / 8)


def rational(scores, eta, alpha, delay, q0):
    """Return thresholds and known misses, all numbers exact."""
    q, err, thresholds, misses = Fraction(q0), [], [], []
    for t, score in enumerate(scores):
        known = max(t - delay + 1, 0)
        misses.append(sum(err[:known]))
        q = Fraction(q0) + Fraction(eta) * (misses[-1] - alpha * known)
        thresholds.append(q)
        err.append(Fraction(score) > q)
    return thresholds, misses


@settings(max_examples=50)
@given(
    scores=st.lists(quarters, max_size=40),
    alpha=st.sampled_from([Fraction(1, 8), Fraction(1, 4), Fraction(3, 4)]),
    delay=st.integers(1, 4),
    q0=quarters,
)
def test_where_all_numbers_are_binary_all_forms_are_exact(scores, alpha, delay, q0):
    q, misses = rational(scores, 0.5, alpha, delay, q0)
    counted = track_exact(scores, Fixed(eta=0.5), alpha=alpha, delay=delay, q0=q0)
    summed = track(scores, Fixed(eta=0.5), alpha=float(alpha), delay=delay, q0=q0)
    assert counted.q.tolist() == summed.q.tolist() == [float(value) for value in q]
    assert counted.misses.tolist() == misses
    assert counted.err.tolist() == summed.err.tolist()


@pytest.mark.parametrize("alpha", [0.1, 0.2, Fraction(1, 3), 0.123456789])
def test_each_threshold_is_right_to_the_last_places(alpha):
    scores = np.random.default_rng(1).random(3000)
    meant = alpha if isinstance(alpha, Fraction) else Fraction(str(alpha))
    q, _, misses = track_exact(scores, Fixed(eta=0.05), alpha=alpha)
    exact, known = rational(scores.tolist(), 0.05, meant, 1, 0.0)
    assert misses.tolist() == known
    np.testing.assert_allclose(q, [float(value) for value in exact], rtol=1e-15, atol=0)


def test_the_sum_drifts_a_little_in_a_million_steps_and_the_count_does_not():
    scores = np.random.default_rng(0).random(1_000_000)
    q, err, misses = track_exact(scores, Fixed(eta=0.1), alpha=0.1)
    summed = track(scores, Fixed(eta=0.1), alpha=0.1)
    assert np.abs(summed.q - q).max() < 1e-10
    n = scores.size - 1
    exact = Fraction(0.1) * (int(misses[-1]) - Fraction(1, 10) * n)
    assert abs(Fraction(float(q[-1])) - exact) < Fraction(1, 10**15)
    assert int(err[:-1].sum()) == int(misses[-1])


@pytest.mark.parametrize("alpha", [0.0, 1.0, Fraction(3, 2), 1 / 3, Fraction(1, 10**9 + 7), "0.1"])
def test_alphas_that_are_no_fractions_are_refused(alpha):
    with pytest.raises(ValueError, match=r"^alpha must") as refused:
        track_exact([1.0], Fixed(eta=1.0), alpha=alpha)
    assert repr(alpha) in str(refused.value)


def test_other_rules_have_no_count_form():
    with pytest.raises(ValueError, match=r"rule must be Fixed.*RunningMax"):
        track_exact([1.0], RunningMax(c=1.0), alpha=0.1)


def test_no_scores_are_no_counts():
    assert [part.size for part in track_exact([], Fixed(eta=1.0), alpha=0.1)] == [0, 0, 0]
