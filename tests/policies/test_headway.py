"""The rule-of-thumb driver, by hand."""

import numpy as np
import pytest

from cpl.policies.headway import FASTER, LANE_LEFT, LANE_RIGHT, SLOWER, Headway

EGO = [1, 300.0, 4.0, 25.0, 0.0]  # second lane of four, 25 m/s: wants 1.5 s x 25 m/s + 5 m = 42.5 m


def car(dx, dy):
    return [1, dx, dy, -5.0, 0.0]


@pytest.mark.parametrize(
    ("cars", "action"),
    [
        ([], FASTER),
        ([car(43, 0)], FASTER),
        ([car(42, 0)], LANE_LEFT),
        ([car(20, 0), car(42, -4)], LANE_RIGHT),
        ([car(20, 0), car(-9, -4)], LANE_RIGHT),  # a car just behind in the left lane blocks it
        ([car(20, 0), car(42, -4), car(10, 4)], SLOWER),
        ([[0, 0, 0, 0, 0], [0, 0, 0, 0, 0]], FASTER),  # empty rows are no cars
    ],
)
def test_actions_by_hand(cars, action):
    drive = Headway(time_gap_s=1.5, lanes_count=4)
    assert drive(np.array([EGO, *cars])) == action


def test_the_outer_lanes_have_one_neighbour():
    drive = Headway(time_gap_s=1.5, lanes_count=2)
    right = [1, 300.0, 4.0, 25.0, 0.0]
    left = [1, 300.0, 0.0, 25.0, 0.0]
    assert drive([right, car(20, 0), car(20, -4)]) == SLOWER
    assert drive([left, car(20, 0)]) == LANE_RIGHT


@pytest.mark.parametrize("bad", [0.0, -1.0, np.nan, np.inf])
def test_refuses_a_time_gap_that_is_no_time(bad):
    with pytest.raises(ValueError, match="time_gap_s"):
        Headway(time_gap_s=bad, lanes_count=4)


def test_refuses_no_lanes_and_wrong_observations():
    with pytest.raises(ValueError, match="lanes_count"):
        Headway(time_gap_s=1.0, lanes_count=0)
    with pytest.raises(ValueError, match="observation"):
        Headway(time_gap_s=1.0, lanes_count=4)(np.zeros((3, 4)))
