import numpy as np
import pytest
from scipy import stats as sp

from cpl.rng import stream
from cpl.stats import (
    check_law,
    mean_interval,
    paired_difference,
    proportion,
    split_conformal_law,
    split_conformal_rank,
)


@pytest.mark.parametrize(("hits", "n"), [(0, 10), (3, 10), (10, 10), (1, 1), (450, 500)])
def test_proportion_is_scipys_exact_interval(hits, n):
    ours, theirs = proportion(hits, n), sp.binomtest(hits, n).proportion_ci(method="exact")
    assert (ours.low, ours.high) == pytest.approx((theirs.low, theirs.high), abs=1e-12)
    assert ours.value == hits / n


def test_proportion_covers_at_least_its_confidence():
    """Exact: sum the binomial over the outcomes whose interval contains p."""
    n, intervals = 20, [proportion(k, 20, confidence=0.9) for k in range(21)]
    for p in np.linspace(0.01, 0.99, 50):
        covered = [sp.binom.pmf(k, n, p) for k, e in enumerate(intervals) if e.low <= p <= e.high]
        assert sum(covered) >= 0.9 - 1e-12


def test_mean_interval_by_hand():
    estimate = mean_interval([1.0, 2.0, 3.0, 4.0])
    assert estimate.value == 2.5
    assert estimate.high - 2.5 == pytest.approx(3.182446 * np.std([1, 2, 3, 4], ddof=1) / 2)


def test_paired_difference_finds_a_shift_that_unpaired_would_not():
    rng = stream(0, "paired")
    control = rng.normal(0, 10, 60)
    estimate = paired_difference(control + rng.normal(1, 0.5, 60), control, rng)
    assert 0.7 < estimate.low < estimate.value < estimate.high < 1.3


def test_paired_difference_is_seeded():
    x, y = stream(0, "x").random(20), stream(0, "y").random(20)
    assert paired_difference(x, y, stream(1)) == paired_difference(x, y, stream(1))


@pytest.mark.parametrize(
    ("n", "alpha", "rank"),
    [(9, 0.1, 9), (19, 0.05, 19), (29, 0.1, 27), (99, 0.3, 70), (100, 0.1, 91), (1, 0.5, 1)],
)
def test_split_conformal_rank_table(n, alpha, rank):
    assert split_conformal_rank(n, alpha) == rank


def test_the_beta_law_is_the_law_of_an_order_statistic():
    rng = stream(0, "order")
    coverage = np.sort(rng.random((20_000, 19)), axis=1)[:, split_conformal_rank(19, 0.1) - 1]
    check = check_law(coverage, split_conformal_law(19, 0.1))
    assert abs(check.mean_z) < 4
    assert abs(check.variance_z) < 4
    assert check.ks_p > 1e-4


def test_a_wrong_law_is_noticed():
    coverage = np.sort(stream(0, "order").random((20_000, 19)), axis=1)[:, 16]
    assert abs(check_law(coverage, split_conformal_law(19, 0.1)).mean_z) > 4


@pytest.mark.parametrize(
    ("call", "named"),
    [
        (lambda: proportion(11, 10), "hits"),
        (lambda: proportion(0, 0), "n=0"),
        (lambda: proportion(1, 2, confidence=1.0), "confidence"),
        (lambda: mean_interval([1.0]), "sample"),
        (lambda: mean_interval([1.0, np.nan]), "sample"),
        (lambda: paired_difference([1.0, 2.0], [1.0, 2.0, 3.0], stream(0)), "control"),
        (lambda: split_conformal_rank(0, 0.1), "n must"),
        (lambda: split_conformal_rank(5, 1.5), "alpha"),
        (lambda: split_conformal_law(5, 0.1), "n=5"),
    ],
)
def test_bad_arguments_are_named(call, named):
    with pytest.raises(ValueError, match=named):
        call()
