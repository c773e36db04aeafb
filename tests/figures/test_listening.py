"""Pictures of agents that hear a quantile: what is drawn is what was counted."""

import numpy as np
import pandas as pd

from cpl.figures import listening
from cpl.stats import Estimate


def test_support_draws_shares():
    rows = pd.DataFrame({"q_low": [0.0, 0.1, 0.0, 0.1], "decisions": [1, 3, 2, 2]})
    (panel,) = listening.support({"training": rows, "20-40": rows}).axes
    drawn = np.asarray(panel.get_lines()[0].get_ydata())
    assert drawn.tolist() == [3 / 8, 5 / 8]


def test_a_panel_for_each_input_and_a_line_for_each_agent():
    rows = pd.DataFrame({"at": [0, 1], "value": [0.1, 0.2], "low": [0.0, 0.1], "high": [0.3, 0.4]})
    figure = listening.responses({"q": {"rl": rows, "rl_1": rows}, "l_hat": {"rl": rows}}, what="x")
    assert [len(panel.get_lines()) for panel in figure.axes] == [2, 1]


def test_every_difference_has_its_interval_and_zero_is_in_the_picture():
    narrow = Estimate(value=0.2, low=0.1, high=0.3, n=4)
    endless = Estimate(value=0.1, low=-np.inf, high=np.inf, n=1)
    figure = listening.beside(
        {"here": {"a": narrow, "b": endless}, "there": {"a": narrow}}, what="x"
    )
    (panel,) = figure.axes
    low, high = panel.get_xlim()
    assert low < 0 < 0.3 < high
    assert [tick.get_text() for tick in panel.get_yticklabels()] == ["here", "there"]
    assert "svg" in figure.svg()


def test_the_front_names_agents_and_draws_rivals():
    rows = pd.DataFrame(
        {"method": ["a", "b"], "step_speed_mps": [20, 30], "crash_rate": [0.1, 0.5]}
    )
    (panel,) = listening.front({"coin": rows}, rows.iloc[:1], rows.iloc[1:]).axes
    assert {text.get_text() for text in panel.texts} == {"a", "b"}
    low, high = panel.get_ylim()
    assert low > high  # better is higher
