"""What the pictures of the road say, from small tables."""

import numpy as np
import pandas as pd
import pytest

from cpl.figures import road


def cars(*rows):
    names = ["vehicle", "x_m", "y_m", "heading_rad", "crashed"]
    return pd.DataFrame(rows, columns=names)


def test_moments_put_the_own_car_at_zero_and_leave_out_what_is_far_away():
    frame = cars(
        (0, 500.0, 4.0, 0.0, False), (1, 520.0, 0.0, 0.1, True), (2, 700.0, 0.0, 0.0, False)
    )
    figure = road.moments({"now": frame, "later": frame}, lanes_count=3)
    upper, lower = figure.axes
    assert upper.get_title(loc="left") == "now"
    assert lower.get_xlabel() == "distance along the road from the own car [m]"
    boxes = upper.patches
    assert len(boxes) == 2
    centres = [b.get_extents().transformed(upper.transData.inverted()) for b in boxes]
    assert [round((c.x0 + c.x1) / 2) for c in centres] == [0, 20]
    assert [b.get_hatch() for b in boxes] == [None, "///"]


def test_moments_refuse_a_road_without_an_own_car():
    with pytest.raises(ValueError, match="vehicle 0"):
        road.moments({"now": cars((1, 520.0, 0.0, 0.0, False))}, lanes_count=3)


def test_forecasts_mark_what_lay_outside_the_band():
    figure = road.forecasts([0, 1, 2], [0.5, 0.9, 0.2], [0.5, 0.5, 0.4], [0.1, 0.3, 0.2], shift=1.5)
    upper, lower = figure.axes
    marks = {line.get_label(): line.get_ydata() for line in upper.lines}
    np.testing.assert_array_equal(marks["happened, missed"], [0.9])
    np.testing.assert_array_equal(marks["happened, covered"], [0.5, 0.2])
    assert lower.get_ylabel() == "threshold q"


def test_rides_that_stop_early_end_in_a_cross():
    figure = road.rides({"20 to 30": [[25, 30, 30], [25, 12]]}, unit_s=1.0, cap_mps=40.0)
    (axes,) = figure.axes
    crosses = [line for line in axes.lines if line.get_marker() == "x"]
    assert [tuple(c.get_xydata()[0]) for c in crosses] == [(2.0, 12.0)]
