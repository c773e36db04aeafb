"""The distance to the nearest car and its squashed form."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cpl.highway.proximity import distance_from_proximity, nearest_distance, proximity


def test_nearest_distance_is_the_smallest_over_cars_for_each_environment():
    ego = np.array([[0.0, 0.0], [100.0, 4.0]])
    others = np.array([[[3.0, 4.0], [6.0, 8.0]], [[100.0, 16.0], [95.0, 4.0]]])
    np.testing.assert_array_equal(nearest_distance(ego, others), [5.0, 5.0])


@pytest.mark.parametrize(
    ("ego", "others", "name"),
    [
        ([0.0, 0.0, 0.0], [[1.0, 1.0]], "ego"),
        ([0.0, 0.0], [1.0, 1.0, 1.0], "others"),
        ([0.0, 0.0], np.empty((0, 2)), "others"),
    ],
)
def test_nearest_distance_refuses_wrong_shapes(ego, others, name):
    with pytest.raises(ValueError, match=name):
        nearest_distance(ego, others)


@given(st.floats(0, 300), st.floats(0, 300))
def test_proximity_is_in_the_half_open_unit_interval_and_decreases(a, b):
    near, far = sorted((a, b))
    assert 0 < proximity(far) <= proximity(near) <= 1


@given(st.floats(0, 100))
def test_proximity_is_inverted(distance):
    assert distance_from_proximity(proximity(distance)) == pytest.approx(distance, abs=1e-6)


@pytest.mark.parametrize("bad", [-1.0, np.nan, np.inf])
def test_proximity_refuses_what_is_no_distance(bad):
    with pytest.raises(ValueError, match="l must be finite"):
        proximity(bad)


@pytest.mark.parametrize("bad", [0.0, 1.5, np.nan])
def test_distance_refuses_what_is_no_proximity(bad):
    with pytest.raises(ValueError, match="l_tilde"):
        distance_from_proximity(bad)


def test_proximity_does_not_overflow_far_away():
    assert proximity(1e5) == 0.0  # the smallest double is larger than the true value
