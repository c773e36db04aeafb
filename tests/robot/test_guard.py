"""What stands before the cable can only slow down, and what ends a run is latched."""

from math import inf, nan

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cpl.robot import (
    Envelope,
    GuardConfig,
    GuardState,
    Mode,
    RobotFacts,
    Stop,
    clamp,
    guard,
    within,
)

CONFIG = GuardConfig()
GO = (0.5, 0.1, 0.2)
anything = st.floats(allow_nan=True, allow_infinity=True)
commands = st.tuples(anything, anything, anything)
facts = st.builds(
    RobotFacts,
    t_s=anything,
    x_m=anything,
    y_m=st.floats(-4, 4),
    pose_valid=st.booleans(),
    pose_age_s=anything,
    command_age_s=anything,
    answer_age_s=anything,
    battery=st.integers(0, 100),
    mode=st.integers(0, 255),
    operator=st.booleans(),
    tripped=st.booleans(),
    pose_fault=st.booleans(),
    odometry=st.tuples(st.floats(-4, 4), anything),
)
in_time = st.builds(
    lambda each, t_s: [
        RobotFacts(**{**one.__dict__, "t_s": when}) for one, when in zip(each, t_s, strict=False)
    ],
    st.lists(facts, max_size=8),
    st.lists(st.floats(0, 3), min_size=8, max_size=8).map(sorted),
)


def play(changes, command=GO, config=CONFIG):
    """Return the rulings for changes of a good day, one a step of 0.1 s."""
    state, rulings = GuardState(), []
    for k, change in enumerate(changes):
        good = {"t_s": k / 10, "x_m": 0.0, "y_m": 0.0, "pose_valid": True}
        facts = good | change
        facts = {"odometry": (facts["x_m"], facts["y_m"])} | facts
        rulings.append(guard(state, RobotFacts(**facts), command, config))
        state = rulings[-1].state
    return rulings


@given(commands, st.floats(1e-3, 10), st.floats(1e-3, 10))
def test_a_clamped_velocity_is_inside_to_the_last_bit(command, v_max, yaw_max):
    envelope = Envelope(v_max_mps=v_max, yaw_rate_max_radps=yaw_max)
    sent = clamp(command, envelope)
    assert within(sent, envelope)
    for out, wanted in zip(sent, command, strict=True):
        assert out == 0.0 or 0.0 < out / wanted <= 1.0
    if within(command, envelope):
        assert sent == command


@settings(max_examples=40)
@given(st.lists(facts, max_size=8) | in_time, st.lists(commands, min_size=8, max_size=8))
def test_no_sequence_of_facts_and_commands_leaves_the_envelope_or_raises(events, wanted):
    state = GuardState()
    fenced = stopped = False
    for fact, command in zip(events, wanted, strict=False):
        ruling = guard(state, fact, command, CONFIG)
        state = ruling.state
        assert within(ruling.command, CONFIG.envelope)
        for out, asked in zip(ruling.command, command, strict=True):
            assert out == 0.0 or 0.0 < out / asked <= 1.0
        assert ruling.reason or ruling.command == command
        assert state.fenced >= fenced
        assert (state.stop is not None) >= stopped
        fenced, stopped = state.fenced, state.stop is not None
        if fenced or stopped:
            assert ruling.command == (0.0, 0.0, 0.0)
            assert ruling.outcome


@pytest.mark.parametrize(
    ("change", "outcome"),
    [
        ({"operator": True}, Stop.OPERATOR),
        ({"mode": Mode.DAMPED}, Stop.DAMPED),
        ({"tripped": True}, Stop.WATCHDOG),
        ({"battery": 19}, Stop.BATTERY),
        ({"answer_age_s": 1.1}, Stop.LINK),
        ({"answer_age_s": nan}, Stop.LINK),
        ({"t_s": 5.0}, Stop.CLOCK),
        ({"t_s": 0.05}, Stop.CLOCK),
        ({"t_s": nan}, Stop.CLOCK),
        ({"x_m": 3.1}, "geofence"),
        ({"odometry": (0.0, -3.1)}, "geofence"),
        ({"odometry": (0.4, 0.0)}, Stop.ODOMETRY),
        ({"odometry": (nan, 0.0)}, Stop.ODOMETRY),
        ({"pose_fault": True}, Stop.CAMERA),
    ],
)
def test_what_ends_a_run_is_named_and_latched(change, outcome):
    later = [{"t_s": 5.1}, {"t_s": 5.2}] if "t_s" in change else [{}, {}]
    rulings = play([{}, {}, change, *later])
    assert [each.reason for each in rulings[:2]] == ["", ""]
    assert [each.outcome for each in rulings[2:]] == [outcome] * 3
    assert all(each.command == (0.0, 0.0, 0.0) for each in rulings[2:])


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"answer_age_s": 0.4}, "no_answer"),
        ({"pose_age_s": 0.2}, "stale_pose"),
        ({"command_age_s": 0.4}, "watchdog"),
        ({"x_m": 1.0}, "pose_jump"),
    ],
)
def test_what_passes_makes_the_robot_wait(change, reason):
    rulings = play([{}, {}, change, *[{"x_m": change.get("x_m", 0.0)}] * 4])
    assert (rulings[2].reason, rulings[2].outcome) == (reason, "")
    assert rulings[2].command == (0.0, 0.0, 0.0)
    assert rulings[-1].reason == ""


def test_poses_that_stay_old_end_the_run():
    rulings = play([{}, *[{"pose_age_s": 0.2}] * 5])
    assert [each.reason for each in rulings] == ["", *["stale_pose"] * 3, "camera", "camera"]
    assert rulings[-1].outcome == "camera"


def test_an_odometry_that_is_old_is_not_compared():
    rulings = play([{}, {"answer_age_s": 0.4, "odometry": (0.9, 0.0)}, {}])
    assert [each.outcome for each in rulings] == ["", "", ""]


def test_a_fast_walk_is_no_jump():
    assert [r.reason for r in play([{"x_m": 0.15 * k} for k in range(6)])] == [""] * 6


def test_the_configuration_is_checked():
    with pytest.raises(ValueError, match="battery_min must be in"):
        GuardConfig(battery_min=101)
    with pytest.raises(ValueError, match="jump_m must be finite and above 0, not 0"):
        GuardConfig(jump_m=0)
    with pytest.raises(ValueError, match="v_max_mps must be finite and above 0, not inf"):
        Envelope(v_max_mps=inf)
