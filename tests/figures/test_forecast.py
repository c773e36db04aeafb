"""What the pictures of the forecast say, from small numbers."""

import numpy as np
import pandas as pd
import pytest

from cpl.figures import forecast


def test_curves_end_where_training_ended():
    figure = forecast.curves({"a": [3.0, 2.0], "b": [3.0]}, reference=4.0, name="persistence")
    (axes,) = figure.axes
    named = {line.get_label(): line.get_xydata() for line in axes.lines}
    np.testing.assert_array_equal(named["a"], [[1, 3.0], [2, 2.0]])
    assert axes.get_yscale() == "log"
    assert "persistence" in [text.get_text() for text in axes.texts]


def test_dots_have_a_row_a_subject_and_a_marker_a_condition():
    rows = {"hau": {"in": (0.9, 0.88, 0.92), "out": (0.5, 0.4, 0.6)}, "none": {"in": (0.1, 0, 1)}}
    figure = forecast.dots(rows, xlabel="coverage", at=0.9, name="nominal", limits=(0, 1))
    (axes,) = figure.axes
    assert [label.get_text() for label in axes.get_yticklabels()] == ["hau", "none"]
    spans = [line.get_xdata() for line in axes.lines if len(line.get_xdata()) == 2]
    assert [0.4, 0.6] in [list(span) for span in spans]
    labels = [text.get_text() for text in axes.get_legend().get_texts()]
    assert labels == ["in", "out", "nominal"]
    markers = {line.get_marker() for line in axes.lines if line.get_label() in ("in", "out")}
    assert len(markers) == 2


def test_a_ride_marks_its_misses_and_counts_them_in_windows():
    truth, guess = [0.5, 0.9, 0.5, 0.5], [0.5, 0.5, 0.5, 0.5]
    figure = forecast.ride([4, 5, 6, 7], truth, guess, [0.2] * 4, window=2, target=0.9)
    upper, lower = figure.axes
    marks = {line.get_label(): line.get_xydata() for line in upper.lines}
    np.testing.assert_array_equal(marks["missed"], [[5, 0.9]])
    (dotted,) = [line for line in lower.lines if line.get_marker() == "o"]
    np.testing.assert_allclose(dotted.get_xydata(), [[5, 0.5], [6, 0.5], [7, 1.0]])
    assert lower.get_ylabel() == "coverage, last 2"


def test_around_puts_the_event_at_zero():
    series = {"q": ([-1, 0], [0.1, 0.2]), "l_hat": ([-1, 0], [0.3, 0.4])}
    figure = forecast.around(series, ([-1, 0], [30.0, 31.0]), event="crash")
    upper, lower = figure.axes
    assert [line.get_label() for line in upper.lines][:2] == ["q", "l_hat"]
    assert lower.get_xlabel() == "seconds from crash [s]"
    assert upper.lines[-1].get_xdata()[0] == pytest.approx(0.0)


def test_profiles_start_at_zero():
    figure = forecast.profiles({"in": ([4, 5], [0.1, 0.2])}, ylabel="mean of q")
    (axes,) = figure.axes
    assert axes.get_ylim()[0] == 0
    assert figure.summary() == "Figure: mean of q against time in the episode [s]"


def test_intervals_treat_a_pair_as_one_number():
    rows = pd.DataFrame(
        {
            "pair": [0, 1, 0, 1],
            "policy": ["a", "a", "b", "b"],
            "value": [1.0, 9.0, 5.0, np.nan],
            "n": [10, 30, 1, 1],
        }
    )
    found = forecast.intervals(rows[rows["policy"] == "a"], "policy", sums=True).iloc[0]
    assert found["value"] == pytest.approx(0.2)
    assert found["low"] < 0.1 < 0.3 < found["high"]
    with pytest.raises(ValueError, match="sample"):
        forecast.intervals(rows, "policy")  # one number has no interval
