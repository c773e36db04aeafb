"""What the pictures of the look-ahead say."""

import pandas as pd
import pytest

from cpl.figures import gate

SUMS = {"episodes": 4, "crashes": 1, "steps": 100, "speed_sum": 2500.0, "scored": 80, "missed": 4}


def ride():
    """Two methods, two episodes of two decisions, the ego car and one more."""
    rows = []
    for method in ("constant", "quantile"):
        for episode, world in enumerate(("in", "noise")):
            for step in range(2):
                told = {
                    "method": method,
                    "episode": episode,
                    "world": world,
                    "step": step,
                    "margin_m": 3.0 + episode,
                    "error_m": 1.0,
                    "crashed": method == "constant" and episode == step == 1,
                    "speed_mps": 25.0,
                }
                rows += [{**told, "car": 0, "x_m": 0.0, "y_m": 4.0}]
                rows += [{**told, "car": 1, "x_m": 30.0, "y_m": 4.0 + 4.0 * step}]
    return pd.DataFrame(rows)


def test_margins_name_the_method_its_crashes_and_the_other_world():
    top, bottom = gate.margins(ride()).axes
    assert top.get_title(loc="left") == "a constant margin: 1 crashes"
    assert bottom.get_title(loc="left") == "the tracked quantile: 0 crashes"
    assert [text.get_text() for text in top.texts] == ["noise"]
    assert top.lines[1].get_ydata().tolist() == [3.0, 3.0, 4.0, 4.0]


def test_an_episode_says_how_it_ended_and_marks_the_own_lane():
    top, bottom = gate.episode(ride()).axes
    assert top.get_title(loc="left").startswith("a constant margin: crash after 2 s")
    assert bottom.get_title(loc="left").startswith("the tracked quantile: 2 s without a crash")
    grey, red = bottom.lines[:2]
    assert grey.get_xdata().tolist() == [1]
    assert red.get_xdata().tolist() == [0]


def test_the_frontier_joins_the_constants_and_names_the_others():
    constants = pd.DataFrame(
        {"value": [3.0, 6.0], "speed_mps": [28.0, 23.0], "crash_rate": [0.2, 0.1]}
    )
    others = pd.DataFrame({"method": ["quantile"], "speed_mps": [26.0], "crash_rate": [0.1]})
    (axes,) = gate.frontier(constants, others).axes
    assert axes.lines[0].get_xdata().tolist() == [23.0, 28.0]
    assert "quantile" in [text.get_text() for text in axes.texts]


def test_coverage_has_a_panel_a_log():
    rows = [
        {"log": log, "part": "p", "coverage": c, "low": c - 0.1, "high": c + 0.1, "nominal": 0.9}
        for log in ("road", "robot")
        for c in (0.9, 0.5)
    ]
    figure = gate.coverage(pd.DataFrame(rows))
    assert [axes.get_title(loc="left") for axes in figure.axes] == ["road", "robot"]


def test_rates_are_sums_over_sums():
    rows = pd.DataFrame([{"method": "a", **SUMS}, {"method": "a", **SUMS, "crashes": 3}])
    found = gate.rates(rows, "method").iloc[0]
    assert found["crash_rate"] == 0.5
    assert found["speed_mps"] == 25.0
    assert found["coverage"] == pytest.approx(0.95)
