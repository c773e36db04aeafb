"""A run's figure draws what the run has, and says where it is from."""

import numpy as np
import pandas as pd
import pytest

from cpl.figures.logs import overview

TABLE = pd.DataFrame(
    {
        "t_s": np.arange(20) / 10,
        "x_m": np.arange(20) / 20,
        "y_m": 0.0,
        "v_x_mps": 0.5,
        "v_y_mps": 0.0,
        "slam_error": [0] * 15 + [1, 2, 3, 0, 0],
        "cmd_v_x_mps": 0.5,
        "cmd_v_y_mps": 0.0,
        "kp": 1.5,
        "l_hat": 0.3,
        "q": 0.2,
        "supervisor": [""] * 18 + ["geofence"] * 2,
        "true_x_m": np.arange(20) / 20,
        "true_y_m": 0.1,
    }
)


def labels(figure):
    return [text.get_text() for axes in figure.axes for text in axes.get_legend().get_texts()]


def test_everything_that_a_twin_logs_is_drawn():
    figure = overview(TABLE, label="simulated-kinematic, seed 3, run.mcap")
    assert [axes.get_ylabel() for axes in figure.axes] == [
        "y [m]", "speed [m/s]", "gain [1/s]", "score"]  # fmt: skip
    said = labels(figure)
    for label in ("true path", "SLAM error Speed (1)", "commanded", "supervisor (2)", "l_hat", "q"):
        assert label in said
    assert figure.get_supxlabel() == "data: simulated-kinematic, seed 3, run.mcap"
    assert figure.svg() == overview(TABLE, label="simulated-kinematic, seed 3, run.mcap").svg()


@pytest.mark.parametrize(
    ("columns", "panels"),
    [
        (["t_s", "x_m", "y_m"], ["y [m]"]),
        (["t_s", "x_m", "y_m", "v_x_mps", "v_y_mps"], ["y [m]", "speed [m/s]"]),
        (["t_s", "x_m", "y_m", "kp"], ["y [m]", "gain [1/s]"]),
    ],
)
def test_what_a_recording_lacks_is_left_out(columns, panels):
    figure = overview(TABLE[columns], label="real-T265-third-party")
    assert [axes.get_ylabel() for axes in figure.axes] == panels
    assert figure.svg().startswith("<?xml")


def test_one_row_is_drawn_too_and_predictions_nobody_made_are_not():
    figure = overview(TABLE.iloc[:1].assign(l_hat=np.nan), label="x")
    assert [axes.get_ylabel() for axes in figure.axes] == ["y [m]", "speed [m/s]", "gain [1/s]"]
    assert figure.svg().startswith("<?xml")
