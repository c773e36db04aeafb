"""What the pictures of many walks say, and what they say when there is nothing to draw."""

import pandas as pd

from cpl.figures import walks

LABEL = "simulated-kinematic; 4 runs"


def texts(figure):
    """Return all texts of a figure's first panel."""
    return [text.get_text() for text in figure.axes[0].texts]


def test_failures_have_a_panel_for_each_kind_of_motion():
    bins = {"middle": 0.5, "value": 0.1, "low": 0.05, "high": 0.2, "n": 40}
    shares = pd.DataFrame([{"motion": "speed"} | bins, {"motion": "turn"} | bins])
    figure = walks.failures(shares, label=LABEL)
    assert [axes.get_xlabel() for axes in figure.axes] == ["speed", "turn"]
    assert figure.get_supxlabel() == f"data: {LABEL}"


def test_the_printed_rule_speeds_up_where_the_corrected_one_slows_down():
    printed, corrected = walks.decisions().axes
    assert [text.get_text() for text in printed.texts] == ["faster", "slower", "faster"]
    assert [text.get_text() for text in corrected.texts] == ["faster", "slower", "slower"]


def test_differences_are_drawn_by_cell():
    rows = [
        {
            "shape": "triangle",
            "range": "in",
            "repeat": k,
            "policy": policy,
            "m": k + (policy == "paper"),
        }
        for k in range(3)
        for policy in ("paper", "no_quantile")
    ]
    (axes,) = walks.differences(pd.DataFrame(rows), "m", unit="m [m]", label=LABEL).axes
    assert [label.get_text() for label in axes.get_yticklabels()] == ["triangle, in"]
    assert axes.lines[1].get_xdata().tolist() == [1.0, 1.0, 1.0]


def test_coverage_is_drawn_beside_its_bound():
    windows = pd.DataFrame(
        {"run": ["a", "a"], "window": [0, 1], "coverage": [0.7, 0.8], "guaranteed": [0.4, 0.5]}
    )
    (axes,) = walks.window_coverage(windows, alpha=0.2, label=LABEL).axes
    assert [line.get_label() for line in axes.lines[:2]] == [
        "median run",
        "least guarantee",
    ]


def test_empty_pictures_say_why():
    scored = pd.DataFrame(
        {"shape": [""], "range": [""], "repeat": [-1], "policy": [""], "m": [1.0]}
    )
    assert "no pairs" in texts(walks.differences(scored, "m", unit="m", label=LABEL))[0]
    windows = pd.DataFrame({"run": [], "window": [], "coverage": [], "guaranteed": []})
    assert "no predictions" in texts(walks.window_coverage(windows, alpha=0.2, label=LABEL))[0]
