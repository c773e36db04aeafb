"""The forecast that nothing changes."""

import numpy as np
import pytest

from cpl.forecast.persistence import persistence


@pytest.mark.parametrize(
    ("length", "horizon", "pairs"), [(5, 3, 2), (3, 3, 0), (2, 3, 0), (0, 1, 0)]
)
def test_pairs_are_those_that_were_checked(length, horizon, pairs):
    forecast, truth = persistence(np.arange(float(length)), horizon=horizon)
    np.testing.assert_array_equal(forecast, np.arange(float(pairs)))
    np.testing.assert_array_equal(truth, np.arange(float(pairs)) + horizon)


@pytest.mark.parametrize("bad", [[[1.0]], [np.nan], [np.inf]])
def test_refuses_what_is_no_sequence_of_numbers(bad):
    with pytest.raises(ValueError, match="values"):
        persistence(bad, horizon=1)


def test_refuses_a_horizon_that_looks_back():
    with pytest.raises(ValueError, match="horizon"):
        persistence([1.0, 2.0], horizon=0)
