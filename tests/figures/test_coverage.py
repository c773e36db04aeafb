"""Coverage figures: right axes, right labels, the data that were handed in."""

import numpy as np
import pytest

from cpl.figures import coverage


def test_law_draws_a_density_and_the_target():
    grid = np.linspace(0.8, 1.0, 5)
    (axes,) = coverage.law([0.9, 0.91, 0.89], grid=grid, density=[0, 5, 10, 5, 0], target=0.9).axes
    area = sum(bar.get_width() * bar.get_height() for bar in axes.patches)
    assert area == pytest.approx(1)
    assert axes.lines[-1].get_xdata()[0] == 0.9


def test_two_coverages_average_over_the_window_only():
    (axes,) = coverage.two_coverages([1, 1, 0, 0], [1, 1, 1, 0], window=2, shift=2, target=0.9).axes
    frozen, tracked = axes.lines[:2]
    assert frozen.get_ydata() == pytest.approx([1, 0.5, 0])
    assert tracked.get_ydata() == pytest.approx([1, 1, 0.5])
    assert list(tracked.get_xdata()) == [2, 3, 4]


def test_danger_marks_dangerous_steps_and_errors_apart():
    axes, strip = coverage.danger([0.1, 0.9, 0.3], [0.2, 0.2, 0.2], [False, True, False]).axes
    dangerous = next(one for one in axes.lines if one.get_label() == "dangerous")
    assert dangerous.get_xydata().tolist() == [[1, 0.9]]
    errors, dangers = strip.collections
    assert [len(errors.get_positions()), len(dangers.get_positions())] == [2, 1]


def test_rates_shows_every_group_with_its_interval():
    groups = {"all": (0.1, 0.08, 0.12), "danger": (1.0, 0.9, 1.0)}
    (axes,) = coverage.rates(groups, alpha=0.1).axes
    assert [t.get_text() for t in axes.get_yticklabels()] == ["all", "danger"]
    assert list(axes.lines[0].get_xdata()) == [0.08, 0.12]
    assert [t.get_text() for t in axes.texts] == ["0.100", "1.000"]


def test_window_law_puts_measured_beside_expected():
    (axes,) = coverage.window_law([0.0, 0.4, 0.6], [0.01, 0.18, 0.81]).axes
    heights = [[bar.get_height() for bar in group] for group in axes.containers]
    assert heights == [[0.0, 0.4, 0.6], [0.01, 0.18, 0.81]]
