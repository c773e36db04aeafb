"""The drift of an estimate: known by construction, whatever frame the truth is told in."""

import math

import numpy as np
import pandas as pd
import pytest

from cpl.logs import LogError, read_run
from cpl.logs.drift import of_feet, of_file, with_truth, without_truth
from tests.logs.samples import Pose, tum, walk

SPAN = {"horizon_s": 1.0, "step_s": 0.1}


def run_of(path, poses):
    path.write_bytes(tum(poses))
    return read_run(path, silent="unstated", strict=True)


def moved(poses, *, turn=0.0, dx=0.0):
    """The same motion, told in a world that is turned and shifted."""
    c, s = math.cos(turn), math.sin(turn)
    return [
        Pose(p.stamp_ns, c * p.x - s * p.y + dx, s * p.x + c * p.y, p.z, p.yaw + turn)
        for p in poses
    ]


@pytest.fixture
def truth(tmp_path):
    return run_of(tmp_path / "truth.txt", walk(400))


def test_an_estimate_that_is_right_does_not_drift_wherever_its_world_lies(tmp_path, truth):
    estimate = run_of(tmp_path / "a.txt", moved(walk(400), turn=1.0, dx=5.0))
    for same_body in (True, False):
        table = with_truth(estimate, truth, same_body=same_body, **SPAN)
        assert table["drift_m"].max() < 1e-6
    assert table["speed_mps"].to_numpy() == pytest.approx(0.5, abs=1e-3)
    assert table["turn_radps"].to_numpy() == pytest.approx(0.25, abs=1e-3)
    assert len(table) == 200 - 2 * 10


def test_a_scale_that_is_off_by_a_tenth_drifts_by_a_tenth_of_the_way(tmp_path, truth):
    poses = [Pose(p.stamp_ns, 1.1 * p.x, 1.1 * p.y, p.z, p.yaw) for p in walk(400)]
    table = with_truth(run_of(tmp_path / "a.txt", poses), truth, **SPAN)
    way = 2 * 2 * math.sin(0.125)  # a chord of a second on a circle of 2 m
    assert table["drift_m"].to_numpy() == pytest.approx(0.1 * way, abs=1e-4)


def test_a_jump_drifts_once_for_as_long_as_it_lies_within_the_horizon(tmp_path, truth):
    poses = [Pose(p.stamp_ns, p.x + 0.5 * (k >= 200), p.y, p.z, p.yaw)
             for k, p in enumerate(walk(400))]  # fmt: skip
    table = with_truth(run_of(tmp_path / "a.txt", poses), truth, **SPAN)
    hit = table["drift_m"] > 0.4
    assert hit.sum() == 10
    assert table.loc[hit, "t_s"].max() < 10.0  # what comes after it knows nothing of it


def test_a_gap_is_not_bridged(tmp_path, truth):
    poses = [p for k, p in enumerate(walk(400)) if not 100 <= k < 160]
    table = with_truth(run_of(tmp_path / "a.txt", poses), truth, **SPAN)
    assert not table["t_s"].between(4.0, 7.8).any()
    assert table["drift_m"].max() < 1e-6


def test_without_a_truth_a_circle_is_left_by_going_straight_on(tmp_path):
    table = without_truth(run_of(tmp_path / "a.txt", walk(400)), **SPAN)
    # Straight on for a second from the chord of the last step: 0.5 m against an arc of 0.25 rad.
    assert table["drift_m"].to_numpy() == pytest.approx(0.069, abs=0.003)


def test_feet_that_stand_show_no_drift_and_one_that_slides_shows_how_far():
    times = np.arange(0, 10, 0.1)
    rows = [
        {"timestamp_s": t, "foot_index": foot, "body_x": 0.3 * foot - 0.2 * t + slide,
         "body_y": 0.0, "body_z": -0.5}
        for k, t in enumerate(times)
        for foot, slide in ((0, 0.0), (1, 0.02 * (k >= 60)))
    ]  # fmt: skip
    table = of_feet(pd.DataFrame(rows), **SPAN)
    hit = table["drift_m"] > 0.01
    assert table.loc[hit, "drift_m"].to_numpy() == pytest.approx(0.02, abs=5e-3)
    assert table.loc[~hit, "drift_m"].max() < 1e-6 + 0.01
    assert table["speed_mps"].median() == pytest.approx(0.2, rel=0.02)
    with pytest.raises(ValueError, match="got no body_z"):
        of_feet(pd.DataFrame(rows).drop(columns="body_z"), **SPAN)


def test_a_file_of_ones_own_needs_nothing_but_its_name(tmp_path):
    path = tmp_path / "my.tum"
    path.write_bytes(tum(walk(600)))
    found = of_file(str(path), "as shipped")
    assert found.horizon_s == 1.0
    assert "no truth is given" in found.measured
    assert found.run.info.provenance == "unstated"
    assert len(found.table) > 200
    with_it = of_file(str(path), str(path))
    assert with_it.table["drift_m"].max() < 1e-6
    with pytest.raises(LogError):
        of_file(str(tmp_path), "none")


def test_the_shipped_camera_is_held_against_the_motion_capture_in_its_bag():
    found = of_file("data/logs/real-t265/test.bag", "as shipped")
    assert 0.05 < found.horizon_s < 0.06
    assert 0 < found.table["drift_m"].median() < 0.005
    assert found.run.info.provenance == "real-T265-third-party"


@pytest.mark.parametrize(
    ("span", "says"),
    [
        ({"horizon_s": 0.0, "step_s": 0.1}, "horizon_s must be finite and above 0"),
        ({"horizon_s": 1.0, "step_s": math.nan}, "step_s must be finite"),
        ({"horizon_s": 0.01, "step_s": 0.1}, "at least one step"),
        ({"horizon_s": 30.0, "step_s": 0.1}, "must last two horizons"),
    ],
)
def test_what_cannot_be_asked_is_refused(truth, span, says):
    with pytest.raises(ValueError, match=says):
        without_truth(truth, **span)
