"""The last five observations of every road."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cpl.forecast.errors import HistoryShapeError
from cpl.forecast.history import History


@given(st.integers(1, 4), st.integers(1, 4), st.integers(0, 9), st.integers(0, 2**32 - 1))
def test_it_holds_the_last_observations_oldest_first(n, length, pushes, seed):
    rng = np.random.default_rng(seed)
    history, seen = History(n, length, 3), [[] for _ in range(n)]
    for _ in range(pushes):
        obs, ended = rng.normal(size=(n, 3)), rng.random(n) < 0.3
        history.push(obs)
        for e in range(n):
            seen[e].append(obs[e].astype(np.float32))
        history.reset(ended)
        for e in np.flatnonzero(ended):
            seen[e].clear()
    empty = [np.zeros(3, np.float32)] * length
    expected = np.stack([np.concatenate((empty + own)[-length:]) for own in seen])
    np.testing.assert_array_equal(history.flat, expected)
    assert history.ready.tolist() == [len(own) >= length for own in seen]


def test_an_observation_of_rows_is_flattened_row_by_row():
    history = History(1, 2, 4)
    history.push(np.array([[[1, 2], [3, 4]]]))
    assert history.flat.tolist() == [[0, 0, 0, 0, 1, 2, 3, 4]]
    assert history.flat.dtype == np.float32


@pytest.mark.parametrize("shape", [(2, 5, 4), (3, 5, 5), (2, 25, 1, 1), (50,)])
def test_another_shape_is_refused_and_nothing_changes(shape):
    history = History(2)
    with pytest.raises(HistoryShapeError, match=r"obs must hold \(2, 25\) numbers"):
        history.push(np.ones(shape))
    assert not history.flat.any()
    assert not history.ready.any()


def test_bad_arguments_are_named():
    with pytest.raises(ValueError, match="length must be >= 1, got 0"):
        History(3, length=0)
    with pytest.raises(ValueError, match=r"mask must be bool of shape \(3,\), got int64"):
        History(3).reset(np.zeros(3, np.int64))
