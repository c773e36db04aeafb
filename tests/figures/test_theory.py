"""Tracker and bound figures: right axes, right labels, the data that were handed in."""

import numpy as np
import pytest

from cpl.figures import theory


def labels(axes):
    """Names in the legend and direct labels."""
    legend = axes.get_legend()
    named = [t.get_text() for t in legend.get_texts()] if legend else []
    return named + [t.get_text() for t in axes.texts]


def line(axes, name):
    """Data of the line with this label."""
    return next(one for one in axes.lines if one.get_label() == name).get_xydata()


def test_tracked_tells_errors_from_covered_scores_and_counts_a_tie_as_covered():
    (axes,) = theory.tracked([0.0, 0.5, 0.4], [0.0, 0.0, 0.4], shift=1).axes
    assert line(axes, "error").tolist() == [[1, 0.5]]
    assert line(axes, "covered score").tolist() == [[0, 0.0], [2, 0.4]]
    assert line(axes, "q, the threshold")[:, 1].tolist() == [0.0, 0.0, 0.4]
    assert "after the shift" in labels(axes)
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("time step t", "score")


def test_thresholds_name_every_path_and_the_level():
    (axes,) = theory.thresholds(
        {"slow": [0, 1, 2], "fast": [0, 2, 4]}, level_at=3.0, level_name="the score"
    ).axes
    assert labels(axes) == ["slow", "fast", "the score"]
    assert line(axes, "fast")[:, 1].tolist() == [0, 2, 4]


def test_error_rates_are_running_means_on_a_logarithmic_axis():
    (axes,) = theory.error_rates({"rule": [1, 0, 1, 0]}, alpha=0.1).axes
    assert line(axes, "rule")[:, 1] == pytest.approx([1, 1 / 2, 2 / 3, 1 / 2])
    assert axes.get_xscale() == "log"
    assert "target alpha" in labels(axes)


def test_band_draws_both_walls():
    (axes,) = theory.band([0, 1, 1], [0, -0.01, 0.08], low=-0.01, high=1.09).axes
    levels = [one.get_ydata()[0] for one in axes.lines[:2]]
    assert levels == [1.09, -0.01]
    assert line(axes, "error")[:, 0].tolist() == [2, 3]  # steps count from 1, as in the theorem


def test_worst_case_shades_the_windows_without_a_promise_only_if_there_are_any():
    windows = [5, 10, 20]
    rates = {"exact": [1, 0.9, 0.6], "least": [0, 0, 0.05], "attained": [1, 0.9, 0.6]}
    (axes,) = theory.worst_case(windows, printed=[2.3, 1.2, 0.65], **rates, alpha=0.1).axes
    assert "no promise" in labels(axes)
    assert line(axes, "adversary, measured")[:, 1].tolist() == [1, 0.9, 0.6]
    (axes,) = theory.worst_case(windows, printed=[0.9, 0.8, 0.65], **rates, alpha=0.1).axes
    assert "no promise" not in labels(axes)


def test_delays_has_one_line_a_delay():
    (axes,) = theory.delays([1, 2], {1: [1, 0.5], 3: [1, 1]}, alpha=0.1).axes
    assert labels(axes) == ["delay h = 1", "delay h = 3", "target alpha"]


def test_episodes_marks_where_an_episode_begins():
    reset, carried = theory.episodes(np.zeros(7), np.arange(7), length=3).axes
    assert [reset.get_title(loc="left"), carried.get_title(loc="left")] == [
        "q is reset",
        "q is carried over",
    ]
    starts = [one.get_xdata()[0] for one in carried.lines[1:]]
    assert starts == [3, 6]


def test_integral_draws_the_bound_at_every_step():
    (axes,) = theory.integral({"no lag": [0.9, 0.8]}, upper=[0.9, 1.8], lower=-0.1).axes
    assert line(axes, "bound")[:, 1].tolist() == [0.9, 1.8]
    assert labels(axes) == ["no lag", "bound"]
