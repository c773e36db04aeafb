"""What the pictures of the engine say, from small tables."""

import numpy as np
import pandas as pd

from cpl.figures import engine


def test_overlay_draws_both_engines_at_the_same_place():
    rows = [
        (name, step, vehicle, 100.0 + 10 * vehicle + 25.0 * step, 4.0 * vehicle)
        for name in ("a", "b")
        for step in (0, 1, 2)
        for vehicle in (0, 1)
    ]
    table = pd.DataFrame(rows, columns=["engine", "step", "vehicle", "x_m", "y_m"])
    figure = engine.overlay(table, thick="a", thin="b", speed_mps=25.0)
    along, across = figure.axes
    own = [line for line in along.lines if str(line.get_label()).endswith("own car")]
    assert [line.get_label() for line in own] == ["a, own car", "b, own car"]
    np.testing.assert_allclose([line.get_ydata() for line in own], 0.0)
    assert len(across.lines) == 4


def test_blind_draws_rates_with_their_intervals():
    figure = engine.blind([20, 30], [0.0, 0.9], [0.0, 0.8], [0.1, 1.0])
    (axes,) = figure.axes
    np.testing.assert_array_equal(axes.lines[0].get_ydata(), [0.0, 0.9])
    assert len(axes.collections) == 1
    assert axes.get_xlabel() == "speed held [m/s]"


def test_top_speeds_name_each_range_and_the_cap():
    figure = engine.top_speeds({"20 to 30": [25, 30], "20 to 50": [25, 40]}, unit_s=1, cap_mps=40)
    (axes,) = figure.axes
    assert [line.get_label() for line in axes.lines[:2]] == ["20 to 30", "20 to 50"]
    assert any("40 m/s" in text.get_text() for text in axes.texts)
