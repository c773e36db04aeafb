"""47 features by hand, labels two steps ahead, and live features equal those from the log."""

import numpy as np
import pytest

from cpl.quadruped.features import FEATURES, History, dataset, labels, upcoming
from cpl.quadruped.paths import polyline

PATH = polyline([(0, 0), (1, 0)], spacing_m=0.25)


def test_there_are_47_named_features():
    assert len(FEATURES) == len(set(FEATURES)) == 47


def test_the_first_step_by_hand():
    history = History()
    history.observe((1.0, 2.0, 3.0), True)
    x = dict(zip(FEATURES, history.features(upcoming(PATH, 3)), strict=True))
    assert [x[f"{n}[t-{k}]"] for k in range(5) for n in ("x_m", "y_m", "yaw_rad")] == [1, 2, 3] * 5
    assert [x[f"slam_error[t-{k}]"] for k in range(5)] == [1, 0, 0, 0, 0]
    assert x["cmd_v_x[t-1]"] == 0
    assert [x[f"waypoint_x_m[i+{k}]"] for k in range(4)] == [0.75, 1.0, 1.0, 1.0]


def test_order_is_oldest_first():
    history = History()
    for t in range(7):
        history.observe((t, 10 + t, 0.0), t == 4)
        x = dict(zip(FEATURES, history.features(upcoming(PATH, 0)), strict=True))
        history.sent((0.1 * t, 0.0, 0.0))
    assert [x[f"x_m[t-{k}]"] for k in range(5)] == [6, 5, 4, 3, 2]
    assert [x[f"slam_error[t-{k}]"] for k in range(5)] == [0, 0, 1, 0, 0]
    # The command of step 6 was not known when the features of step 6 were made.
    np.testing.assert_allclose(
        [x[f"cmd_v_x[t-{k}]"] for k in range(1, 6)], [0.5, 0.4, 0.3, 0.2, 0.1]
    )


def test_labels_look_two_steps_ahead():
    assert labels([0, 0, 2, 0, 1]).tolist() == [1, 0, 1]
    assert labels([True]).size == 0


def test_features_from_the_log_are_the_live_ones():
    rng = np.random.default_rng(0)
    history, live, rows = History(), [], []
    for _ in range(12):
        pose, command = rng.normal(size=3), rng.normal(size=3)
        error, index = int(rng.integers(0, 4)), int(rng.integers(0, 5))
        history.observe(pose, error != 0)
        live.append(history.features(upcoming(PATH, index)))
        history.sent(command)
        names = ("x_m", "y_m", "yaw_rad", "cmd_v_x_mps", "cmd_v_y_mps", "cmd_yaw_rate_radps")
        row = dict(zip(names, [*pose, *command], strict=True))
        rows.append(row | {"slam_error": error, "waypoint_index": index})
    x, y = dataset(rows, PATH)
    np.testing.assert_array_equal(x, live[:-2])
    assert len(x) == len(y) == 10


def test_a_run_too_short_for_a_label_gives_none():
    x, y = dataset([], PATH)
    assert x.shape == (0, 47)
    assert y.shape == (0,)


def test_features_before_any_observation_are_refused():
    with pytest.raises(ValueError, match="at least one observe"):
        History().features(upcoming(PATH, 0))
