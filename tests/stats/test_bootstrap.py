"""Intervals over two sources of chance: closed forms, and how often they cover in simulation."""

import numpy as np
import pytest
from scipy import stats as sp

from cpl.stats import band, hierarchical_weights, interval, p_value, sums


def draws(seed=0):
    return np.random.default_rng(seed)


def test_weights_count_whole_resamples():
    for crossed in (True, False):
        counts = hierarchical_weights(4, 6, draws(), resamples=50, crossed=crossed).counts
        assert counts.shape == (50, 4, 6)
        assert (counts.sum(axis=(1, 2)) == 24).all()


def test_crossed_units_are_drawn_once_for_all_groups():
    counts = hierarchical_weights(5, 8, draws(), resamples=20).counts
    for one in counts:
        drawn = one[one.sum(axis=1) > 0]
        shares = drawn / drawn.sum(axis=1, keepdims=True)
        np.testing.assert_allclose(shares, np.broadcast_to(shares[0], shares.shape))


def test_nested_units_are_drawn_anew_in_each_group():
    counts = hierarchical_weights(2, 50, draws(), resamples=200, crossed=False).counts
    first, second = counts[:, 0], counts[:, 1]
    full = (first.sum(axis=1) > 0) & (second.sum(axis=1) > 0)
    assert not np.array_equal(first[full], second[full])


def test_sums_are_those_of_the_drawn_units():
    values = draws(1).random((3, 4, 2))
    weights = hierarchical_weights(3, 4, draws(), resamples=5)
    total, drawn = sums(values, weights)
    np.testing.assert_allclose(total, values.sum(axis=(0, 1)))
    np.testing.assert_allclose(drawn, np.einsum("rgu,gum->rm", weights.counts, values))


def test_the_variance_of_a_mean_is_the_textbook_one():
    """Two-stage sampling: the spread of the group means, with the factor (G - 1) / G."""
    values = draws(2).normal(size=(8, 1)) + 0.0 * draws(3).normal(size=(8, 30))
    weights = hierarchical_weights(8, 30, draws(), resamples=20_000)
    total, drawn = sums(values, weights)
    estimate = interval(float(total) / 240, drawn / 240, groups=8)
    t = sp.t.interval(0.95, 7, loc=values[:, 0].mean(), scale=sp.sem(values[:, 0]))
    assert (estimate.low, estimate.high) == pytest.approx(t, rel=0.02)


@pytest.mark.parametrize("crossed", [True, False])
def test_intervals_cover_as_they_say_with_ten_training_seeds(crossed):
    """Truth 0, training and environment effects as large as on the road."""
    rng, hits, runs = draws(4), 0, 150
    for _ in range(runs):
        shared = rng.normal(scale=2.0, size=20) if crossed else 0.0
        values = rng.normal(scale=1.5, size=(10, 1)) + shared + rng.normal(scale=4.0, size=(10, 20))
        weights = hierarchical_weights(10, 20, rng, resamples=200, crossed=crossed)
        total, drawn = sums(values, weights)
        estimate = interval(float(total) / 200, drawn / 200, groups=10)
        hits += estimate.low <= 0 <= estimate.high
    assert 0.9 <= hits / runs <= 1.0


def test_a_band_covers_all_levels_together():
    rng, all_in, each_in, runs = draws(5), 0, 0, 120
    for _ in range(runs):
        values = rng.normal(size=(10, 1, 6)) + rng.normal(scale=3.0, size=(10, 30, 6))
        weights = hierarchical_weights(10, 30, rng, resamples=200, crossed=False)
        total, drawn = sums(values, weights)
        found = band(total / 300, drawn / 300, groups=10)
        inside = (found.low <= 0) & (found.high >= 0)
        all_in += inside.all()
        each_in += inside.mean()
    assert 0.9 <= all_in / runs <= each_in / runs <= 1.0


def test_a_band_over_one_level_is_the_interval():
    drawn = draws(6).normal(size=(50_000, 1))
    one = interval(0.0, drawn, groups=10)
    wide = band([0.0], drawn, groups=10)
    assert wide.high[0] == pytest.approx(one.high, rel=0.02)


def test_a_band_is_wider_than_each_interval_and_has_no_width_where_nothing_varies():
    drawn = np.column_stack([draws(7).normal(size=(2000, 4)), np.ones(2000)])
    found = band([0.0, 0.0, 0.0, 0.0, 1.0], drawn, groups=10)
    assert (found.high[:4] > interval(0.0, drawn[:, 0], groups=10).high).all()
    assert found.low[4] == found.high[4] == 1.0


def test_p_values_agree_with_intervals():
    drawn = draws(8).normal(size=20_000)
    estimate = interval(2.5, drawn, groups=10)
    assert (p_value(2.5, drawn, groups=10) < 0.05) == (estimate.low > 0)
    edge = estimate.value - estimate.low
    assert p_value(edge, drawn, groups=10) == pytest.approx(0.05, abs=1e-6)
    assert p_value(0.0, np.zeros(3), groups=10) == 1.0
    assert p_value(1.0, np.zeros(3), groups=10) == 0.0


def test_wrong_arguments_are_named():
    with pytest.raises(ValueError, match="units >= 2"):
        hierarchical_weights(3, 1, draws())
    weights = hierarchical_weights(3, 4, draws(), resamples=5)
    with pytest.raises(ValueError, match=r"shape \(3, 4, ...\), got \(4, 3\)"):
        sums(np.ones((4, 3)), weights)
    with pytest.raises(ValueError, match="finite"):
        sums(np.full((3, 4), np.nan), weights)
    with pytest.raises(ValueError, match="confidence"):
        interval(0.0, [0.0, 1.0], groups=3, confidence=1.0)
    with pytest.raises(ValueError, match="resampled must have shape"):
        band([0.0, 1.0], np.ones((5, 3)), groups=3)
