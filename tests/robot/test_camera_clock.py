"""A pose is as old as its camera says; a camera whose clock cannot be believed says nothing."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from cpl.robot.camera_clock import CREEP, SET_S, CameraClock, hear

WAY_S = 0.004


def heard(*poses, clock=None):
    """Hear poses `(device time, how long each took)`; a second on one clock is one on the other."""
    clock = clock or CameraClock()
    for device_s, way_s in poses:
        clock = hear(clock, 7000 + device_s, 3 + device_s + way_s)
    return clock


def steady(seconds=1.0, since=0.0, way_s=WAY_S):
    return [(since + k / 200, way_s) for k in range(round(200 * seconds))]


def test_what_comes_as_fast_as_ever_is_not_late():
    clock = heard(*steady())
    assert clock.late_s == pytest.approx(0, abs=1e-4)
    assert clock.taken_s == pytest.approx(3 + 199 / 200 + WAY_S, abs=1e-4)
    assert clock.fault == ""


@pytest.mark.parametrize("wait_s", [0.1, 0.4, 1.0, 2.0])
def test_a_queue_that_fills_up_shows(wait_s):
    clock = heard(*steady())
    clock = heard(*steady(2.0, since=1.0, way_s=WAY_S + wait_s), clock=clock)
    assert clock.late_s == pytest.approx(wait_s, abs=2e-3)


def test_a_queue_that_fills_up_slowly_shows():
    poses = [(k / 200, WAY_S + 0.4 * k / 200) for k in range(200)]
    assert heard(*poses).late_s == pytest.approx(0.4, abs=5e-3)


def test_a_clock_that_runs_backwards_or_starts_anew_is_a_fault():
    assert heard((5.0, WAY_S), (4.9, WAY_S)).fault == "the camera's clock ran backwards"


def test_a_clock_that_drifts_or_is_set_is_a_fault():
    """A fast clock makes late poses look fresh: what it hides must not grow."""
    settled = heard(*steady()).settled()
    ahead = hear(settled, 7001 + 2.0, 4 + WAY_S)
    assert ahead.fault == "the camera's clock was set, or drifts"
    clock, fast = settled, 1.1
    for k in range(200):
        clock = hear(clock, 7001 + fast * k / 200, 4 + k / 200 + WAY_S)
        if clock.fault:
            break
    assert k / 200 * (fast - 1) <= SET_S + 1e-3
    assert clock.fault


def test_a_quartz_may_drift():
    clock = heard(*steady()).settled()
    for rate in (1 - CREEP / 2, 1 + CREEP / 2):
        late = clock
        for k in range(200 * 60):
            late = hear(late, 7001 + rate * k / 200, 4 + k / 200 + WAY_S)
        assert late.fault == ""
        assert late.late_s < 1e-3


@given(st.lists(st.tuples(st.floats(0, 1), st.floats(0, 3)), min_size=1, max_size=30))
def test_no_pose_is_younger_than_its_packet(steps):
    clock, device_s = CameraClock(), 0.0
    for step_s, way_s in steps:
        device_s += step_s
        clock = hear(clock, device_s, device_s + way_s)
        assert clock.late_s >= 0
        assert clock.taken_s <= device_s + way_s
