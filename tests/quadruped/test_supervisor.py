"""The supervisor can only make the robot slower, and says why."""

from math import hypot, inf, nan

import pytest
from hypothesis import given
from hypothesis import strategies as st

from cpl.quadruped.supervisor import Facts, Reason, SupervisorConfig, SupervisorState, supervise

CONFIG = SupervisorConfig()
GO = (0.5, 0.1, 0.2)

anything = st.floats(allow_nan=True, allow_infinity=True)
commands = st.tuples(anything, anything, anything)


@st.composite
def facts_in_time(draw):
    """Return facts of a run: time never runs backwards, everything else may be anything."""
    times = sorted(draw(st.lists(st.floats(0, 60), min_size=1, max_size=12)))
    return [
        Facts(
            t_s=t,
            x_m=draw(anything),
            y_m=draw(st.floats(-4, 4)),
            pose_valid=draw(st.booleans()),
            pose_age_s=draw(st.floats(0, 1)),
            command_age_s=draw(anything),
        )
        for t in times
    ]


def play(events, command=GO, config=CONFIG, step_s=0.1):
    """Return the verdicts for a list of `Facts` changes, one a step."""
    state, verdicts = SupervisorState(), []
    for k, changes in enumerate(events):
        facts = Facts(**{"t_s": k * step_s, "x_m": 0.0, "y_m": 0.0, "pose_valid": True} | changes)
        verdicts.append(supervise(state, facts, command, config))
        state = verdicts[-1].state
    return verdicts


@given(facts_in_time(), commands)
def test_it_can_only_make_the_robot_slower(facts, command):
    state = SupervisorState()
    for fact in facts:
        verdict = supervise(state, fact, command, CONFIG)
        state = verdict.state
        sent = verdict.command
        assert hypot(*sent[:2]) <= CONFIG.v_max_mps * (1 + 1e-12)
        assert abs(sent[2]) <= CONFIG.yaw_rate_max_radps * (1 + 1e-12)
        for out, wanted in zip(sent, command, strict=True):
            assert out == 0.0 or 0.0 < out / wanted <= 1.0
        assert (verdict.reason is None) == (sent == command)


@given(facts_in_time())
def test_a_tripped_fence_stays_tripped(facts):
    state, tripped = SupervisorState(), False
    for fact in facts:
        verdict = supervise(state, fact, GO, CONFIG)
        state = verdict.state
        assert state.fence_tripped >= tripped
        if tripped:
            assert verdict.command == (0.0, 0.0, 0.0)
        tripped = state.fence_tripped


@given(st.tuples(*[st.floats(-5, 5)] * 3))
def test_on_a_good_day_slow_commands_pass_unchanged(command):
    (verdict,) = play([{}], command)
    speed = hypot(*command[:2])
    if speed <= CONFIG.v_max_mps and abs(command[2]) <= CONFIG.yaw_rate_max_radps:
        assert (verdict.command, verdict.reason) == (command, None)
    else:
        assert verdict.reason is Reason.SPEED_CLAMP


def test_one_slam_error_is_not_slam_lost():
    reasons = [v.reason for v in play([{}, {"pose_valid": False}, {}, {"pose_valid": False}])]
    assert reasons == [None, None, None, None]


def test_slam_lost_stops_and_is_released_after_valid_poses():
    events = [{}] + [{"pose_valid": False}] * 6 + [{}] * 5
    reasons = [v.reason for v in play(events)]
    assert reasons[:5] == [None] * 5  # 0.4 s without a valid pose
    assert reasons[5:7] == [Reason.SLAM_LOST] * 2  # 0.5 s and 0.6 s
    assert reasons[7:10] == [Reason.RECOVERING] * 3  # valid for 0, 0.1, 0.2 s
    assert reasons[10:] == [None, None]


def test_a_robot_that_never_had_a_pose_is_stopped_after_the_same_time():
    reasons = [v.reason for v in play([{"pose_valid": False}] * 7)]
    assert reasons == [None] * 5 + [Reason.SLAM_LOST] * 2


@pytest.mark.parametrize(
    ("changes", "command", "reason"),
    [
        ({}, (nan, 0.0, 0.0), Reason.BAD_COMMAND),
        ({}, (inf, 0.0, 0.0), Reason.BAD_COMMAND),
        ({"command_age_s": 0.31}, GO, Reason.WATCHDOG),
        ({"command_age_s": nan}, GO, Reason.WATCHDOG),
        ({"x_m": 3.01}, GO, Reason.GEOFENCE),
        ({"y_m": -3.01}, GO, Reason.GEOFENCE),
        ({"pose_age_s": 0.26}, GO, Reason.STALE_POSE),
        ({"x_m": nan}, GO, Reason.STALE_POSE),
    ],
)
def test_each_stop_has_its_reason(changes, command, reason):
    (verdict,) = play([changes], command)
    assert (verdict.command, verdict.reason) == ((0.0, 0.0, 0.0), reason)


def test_time_must_not_run_backwards():
    state = play([{}, {}])[-1].state
    with pytest.raises(ValueError, match=r"t_s must .* not 0.05 after 0.1"):
        supervise(state, Facts(t_s=0.05, x_m=0.0, y_m=0.0, pose_valid=True), GO, CONFIG)


def test_the_configuration_is_checked():
    with pytest.raises(ValueError, match=r"v_max_mps must be in \(0, inf\), got inf"):
        SupervisorConfig(v_max_mps=inf)
