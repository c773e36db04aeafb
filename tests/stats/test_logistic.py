"""The linear reading: it finds the weights it was made with, and ranks as it should."""

import numpy as np
import pytest

from cpl.stats.logistic import auc, fit_logistic


def test_it_finds_the_weights_that_made_the_answers():
    rng = np.random.default_rng(0)
    x = rng.normal(2.0, 3.0, size=(20_000, 3))
    odds = (x - 2.0) / 3.0 @ [1.0, -2.0, 0.0] + 0.5
    y = rng.random(len(x)) < 1 / (1 + np.exp(-odds))
    model = fit_logistic(x, y, ridge=1e-3)
    np.testing.assert_allclose(model.weights, [1.0, -2.0, 0.0], atol=0.08)
    assert model.bias == pytest.approx(0.5, abs=0.08)
    assert auc(model.log_odds(x), y) > 0.85


def test_a_larger_penalty_gives_smaller_weights():
    rng = np.random.default_rng(1)
    x = rng.normal(size=(200, 5))
    y = x[:, 0] > 0
    sizes = [np.abs(fit_logistic(x, y, ridge=r).weights).sum() for r in (0.1, 10.0, 1000.0)]
    assert sizes[0] > sizes[1] > sizes[2]


def test_answers_that_are_all_alike_give_no_weights():
    model = fit_logistic([[0.0], [1.0]], [True, True])
    assert model.weights.tolist() == [0.0]
    assert model.bias == pytest.approx(np.log(5))
    assert np.isnan(auc([0.1, 0.2], [1, 1]))


def test_ranks_with_ties_count_half():
    assert auc([1.0, 1.0], [0, 1]) == 0.5
    assert auc([2.0, 1.0], [0, 1]) == 0.0


@pytest.mark.parametrize(
    ("x", "y", "ridge", "message"),
    [
        ([1.0, 2.0], [0, 1], 1.0, "y must have the length"),
        ([[1.0]], [0, 1], 1.0, "y must have the length"),
        ([[1.0]], [0], -1.0, "ridge must be >= 0"),
    ],
)
def test_what_does_not_fit_is_refused(x, y, ridge, message):
    with pytest.raises(ValueError, match=message):
        fit_logistic(x, y, ridge=ridge)
