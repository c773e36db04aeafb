"""The controller arrives, the printed one does not, and the literal nearest waypoint stalls."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cpl.quadruped.controller import (
    Limits,
    advance,
    arrived,
    saturate,
    velocity_command,
    wrap_angle,
)
from cpl.quadruped.paths import polyline, shape

angle = st.floats(-20, 20)
metre = st.floats(-5, 5)


def drive(command_of, pose, waypoint, seconds=4.0, dt=0.1):
    """Return the pose of an ideal robot that obeys body-frame commands."""
    x, y, yaw = pose
    for _ in range(round(seconds / dt)):
        v_x, v_y, rate = command_of((x, y, yaw), waypoint, 1.5)
        x += (np.cos(yaw) * v_x - np.sin(yaw) * v_y) * dt
        y += (np.sin(yaw) * v_x + np.cos(yaw) * v_y) * dt
        yaw += rate * dt
    return x, y, yaw


def printed_command(pose, waypoint, kp):
    """Section V-A, literally: wrong sign, world-frame components, no wrap."""
    return tuple(kp * (here - there) for here, there in zip(pose, waypoint, strict=True))


@pytest.mark.parametrize(
    ("pose", "waypoint", "expected"),
    [
        ((0, 0, 0), (1, 0, 0), (1.5, 0, 0)),
        ((0, 0, np.pi / 2), (1, 0, np.pi / 2), (0, -1.5, 0)),
        ((1, 1, np.pi), (0, 0, np.pi), (1.5, 1.5, 0)),
        # From 170 deg to -170 deg the short way is +20 deg, not -340 deg.
        ((0, 0, np.deg2rad(170)), (0, 0, np.deg2rad(-170)), (0, 0, 1.5 * np.deg2rad(20))),
    ],
)
def test_commands_by_hand(pose, waypoint, expected):
    np.testing.assert_allclose(velocity_command(pose, waypoint, 1.5), expected, atol=1e-12)


@given(metre, metre, angle, metre, metre, angle)
def test_the_corrected_controller_arrives_from_anywhere(x, y, yaw, x_i, y_i, yaw_i):
    end = drive(velocity_command, (x, y, yaw), (x_i, y_i, yaw_i), seconds=8.0)
    assert np.hypot(end[0] - x_i, end[1] - y_i) < 0.02
    assert abs(wrap_angle(end[2] - yaw_i)) < 0.01


@given(metre, metre, angle.filter(lambda a: abs(a) > 0.1))
def test_the_printed_controller_drives_away(x, y, yaw):
    start = (x, y, 0.0)
    end = drive(printed_command, start, (0.0, 0.0, 0.0), seconds=2.0)
    assert np.hypot(*end[:2]) >= np.hypot(x, y)
    # Even with the sign put right it needs the frame: the yaw error grows as well.
    assert abs(drive(printed_command, (0, 0, yaw), (0, 0, 0), seconds=1.0)[2]) > abs(yaw)


def test_the_literal_nearest_waypoint_stalls():
    path = polyline([(0, 0), (2, 0)], spacing_m=0.25)
    pose = (0.0, 0.0, 0.0)
    for _ in range(100):
        nearest = np.argmin(np.hypot(*(path.waypoints[:, :2] - pose[:2]).T))
        target = path.waypoints[nearest]
        v_x, v_y, _ = velocity_command(pose, target, 1.5)
        pose = (pose[0] + 0.1 * v_x, pose[1] + 0.1 * v_y, 0.0)
    assert pose == (0.0, 0.0, 0.0)


@given(st.tuples(*[st.floats(-50, 50)] * 3))
def test_saturation_keeps_the_direction_and_the_box(command):
    limits = Limits(v_x_mps=1.1, v_y_mps=0.7, yaw_rate_radps=2.0)
    v_x, v_y, rate = saturate(command, limits)
    assert abs(v_x) <= 1.1 + 1e-12
    assert abs(v_y) <= 0.7 + 1e-12
    assert abs(rate) <= 2.0
    assert v_x * command[1] == pytest.approx(v_y * command[0], abs=1e-9)
    assert v_x * command[0] >= 0


def test_advance_skips_what_is_near_and_never_goes_back():
    path = polyline([(0, 0), (2, 0)], spacing_m=0.25)
    assert advance(0, (0.0, 0.0, 0.0), path, radius_m=0.3) == 2
    assert advance(5, (0.0, 0.0, 0.0), path, radius_m=0.3) == 5
    assert advance(0, (0.0, 0.0, 0.0), path, radius_m=99.0) == len(path) - 1


def test_the_stop_rule_needs_both_the_place_and_the_share():
    path = shape("triangle")
    start = path.start  # also the last waypoint of a closed path
    assert not arrived(0, start, path)
    assert not arrived(int(0.75 * (len(path) - 1)) - 1, start, path)
    assert arrived(len(path) - 1, start, path)
    assert not arrived(len(path) - 1, (start[0] + 0.11, start[1], 0.0), path)


def test_limits_are_checked():
    with pytest.raises(ValueError, match=r"v_y_mps must be in \(0, inf\), got 0"):
        Limits(v_y_mps=0)
