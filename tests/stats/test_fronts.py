"""Curves read at common levels, and the area they dominate."""

import moocore
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cpl.stats import at_levels, common_levels, hypervolume

# Halves meet each other often, so that points tie; sevenths do not end in binary.
NUMBERS = st.integers(-6, 6).map(lambda k: k / 2) | st.integers(-40, 40).map(lambda k: k / 7)


def test_a_curve_is_read_between_its_points_in_the_order_of_x():
    assert at_levels([3, 1, 2], [30, 10, 20], [1.5, 2.5]).tolist() == [15, 25]


def test_outside_of_its_points_a_curve_keeps_its_last_value():
    assert at_levels([1.0, 2.0], [10.0, 20.0], [0.0, 9.0]).tolist() == [10.0, 20.0]


def test_many_curves_are_read_one_by_one():
    rng = np.random.default_rng(0)
    x, y, levels = rng.random((2, 3, 5)), rng.random((2, 3, 5)), np.linspace(0, 1, 4)
    many = at_levels(x, y, levels)
    assert many.shape == (2, 3, 4)
    np.testing.assert_array_equal(many[1, 2], at_levels(x[1, 2], y[1, 2], levels))


def test_ties_count_once_with_their_mean():
    assert at_levels([1, 1, 1, 3], [0, 3, 6, 9], [1, 2]).tolist() == [3, 6]


def test_levels_in_common_or_none():
    np.testing.assert_allclose(common_levels([0, 1, 5], [2, 9], [1, 4], count=3), [2, 3, 4])
    with pytest.raises(ValueError, match="levels in common"):
        common_levels([0, 1], [2, 3], count=3)
    with pytest.raises(ValueError, match="count be >= 2"):
        common_levels([0, 1], count=1)


def test_the_hypervolume_of_rectangles():
    front = [[1.0, 3.0], [2.0, 2.0], [3.0, 1.0], [0.5, 0.5]]  # the last is dominated
    assert float(hypervolume(front, [0.0, 0.0])) == pytest.approx(6.0)
    assert hypervolume([front, [[-1.0, 9.0]] * 4], [0.0, 0.0]).tolist() == pytest.approx([6.0, 0.0])


def test_a_curve_that_is_better_everywhere_dominates_more():
    front = np.random.default_rng(1).random((7, 2))
    assert hypervolume(front + 0.1, [0, 0]) > hypervolume(front, [0, 0])


def test_wrong_arguments_are_named():
    with pytest.raises(ValueError, match="shape of x"):
        at_levels([1, 2], [1, 2, 3], [0.0])
    with pytest.raises(ValueError, match="points must have shape"):
        hypervolume([1.0, 2.0], [0.0, 0.0])
    with pytest.raises(ValueError, match="finite"):
        hypervolume([[np.nan, 1.0]], [0.0, 0.0])


CURVES = st.integers(1, 7).flatmap(
    lambda k: st.lists(
        st.lists(st.tuples(NUMBERS, NUMBERS), min_size=k, max_size=k), min_size=1, max_size=5
    )
)


@given(CURVES, st.lists(NUMBERS, min_size=1, max_size=5))
def test_a_curve_is_read_as_numpy_reads_it_bit_for_bit(points, levels):
    curves = np.array(points)
    for row, one in zip(at_levels(curves[..., 0], curves[..., 1], levels), curves, strict=True):
        places, owner, counts = np.unique(one[:, 0], return_inverse=True, return_counts=True)
        means = np.bincount(owner, weights=one[:, 1]) / counts
        np.testing.assert_array_equal(row, np.interp(levels, places, means))


def test_each_curve_is_read_at_levels_of_its_own():
    x, y = np.array([[1.0, 2.0], [1.0, 3.0]]), np.array([[0.0, 4.0], [0.0, 4.0]])
    assert at_levels(x, y, [[1.5, 2.0], [1.5, 2.0]]).tolist() == [[2.0, 4.0], [1.0, 2.0]]


@given(CURVES, st.tuples(NUMBERS, NUMBERS))
def test_the_hypervolume_is_moocore_s_bit_for_bit(points, worst):
    oracle = moocore.Hypervolume(ref=worst, maximise=True)
    expected = [float(oracle(np.maximum(one, worst))) for one in np.array(points)]
    np.testing.assert_array_equal(hypervolume(points, worst), expected)
