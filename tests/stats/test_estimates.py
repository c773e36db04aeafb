import numpy as np
import pytest
from scipy import stats as sp

from cpl.rng import stream
from cpl.stats import (
    mean_interval,
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


@pytest.mark.parametrize(
    ("n", "alpha", "rank"),
    [(9, 0.1, 9), (19, 0.05, 19), (29, 0.1, 27), (99, 0.3, 70), (100, 0.1, 91), (1, 0.5, 1)],
)
def test_split_conformal_rank_table(n, alpha, rank):
    assert split_conformal_rank(n, alpha) == rank


def test_the_beta_law_is_the_law_of_an_order_statistic():
    rng = stream(0, "order")
    coverage = np.sort(rng.random((20_000, 19)), axis=1)[:, split_conformal_rank(19, 0.1) - 1]
    assert sp.kstest(coverage, split_conformal_law(19, 0.1).cdf).pvalue > 1e-4
    assert sp.kstest(coverage, split_conformal_law(20, 0.1).cdf).pvalue < 1e-4


@pytest.mark.parametrize(
    ("call", "named"),
    [
        (lambda: proportion(11, 10), "hits"),
        (lambda: proportion(0, 0), "n=0"),
        (lambda: proportion(1, 2, confidence=1.0), "confidence"),
        (lambda: mean_interval([1.0]), "sample"),
        (lambda: mean_interval([1.0, np.nan]), "sample"),
        (lambda: split_conformal_rank(0, 0.1), "n must"),
        (lambda: split_conformal_rank(5, 1.5), "alpha"),
        (lambda: split_conformal_law(5, 0.1), "n=5"),
    ],
)
def test_bad_arguments_are_named(call, named):
    with pytest.raises(ValueError, match=named):
        call()
