"""The live loop is the book's, and every fault in every phase leaves log and envelope whole."""

import resource
from contextlib import suppress
from dataclasses import replace
from math import nan

import numpy as np
import pytest

from cpl.logs import read_run
from cpl.quadruped import (
    COLUMNS,
    GAIN_RULES,
    GainLimits,
    Policy,
    PolicyConfig,
    RunConfig,
    SupervisorConfig,
    run,
)
from cpl.robot import (
    OUTCOMES,
    GuardConfig,
    Mode,
    RobotError,
    Timing,
    collection,
    drive,
    evaluation,
    halt,
    perform,
    prepare,
    replay,
    replayed,
)
from cpl.robot.emulator import FAULTS, Emulation, Fault, Ideal, rehearsal_world
from cpl.robot.session import POLICIES, RANGES

PLAN = replace(collection(1)[0], max_s=4.0)
PHASES = {"standing": (0.0, 0.6), "walking": (2.0, 3.5), "stopping": (4.15, 9.0)}
STOPS = {
    "battery": "battery", "damped": "damped", "outside": "geofence", "cut": "link",
}  # fmt: skip


def walk(lockstep, tmp_path, faults=(), plan=PLAN, **words):
    robot = lockstep(faults)
    robot.place(plan.course.start, plan.seed)
    return robot, perform(robot.robot, plan, tmp_path, **words)


def test_in_lock_step_with_the_twin_the_rows_are_those_of_the_books_own_loop(lockstep):
    """Same world, same seed: what differs is float32 on the cable, and the axes' last digits."""
    plan, limits = PLAN, GainLimits(kp_min=1.5, kp_max=1.5)
    policy = Policy(GAIN_RULES["constant"], limits, PolicyConfig())
    config = RunConfig(max_s=4.0)
    world = Ideal()
    expected = list(run(world, plan.course, policy, SupervisorConfig(), plan.seed, config))
    robot = lockstep()
    robot.place(plan.course.start, plan.seed)
    robot.robot.base.send(Mode.STAND)
    robot.emulation.go1.serve(0.0)
    robot.emulation.look(0.0)
    policy = Policy(GAIN_RULES["constant"], limits, PolicyConfig())
    timing = Timing(period_s=0.1)
    rows = list(drive(robot.robot, plan.course, policy, GuardConfig(), config, timing))
    assert len(rows) == len(expected) == len(timing.begun_s)
    for row, other in zip(rows, expected, strict=True):
        assert list(row) == list(COLUMNS)
        for name in COLUMNS:
            if isinstance(row[name], str):
                assert row[name] == other[name]
            else:
                assert row[name] == pytest.approx(other[name], abs=2e-5, nan_ok=True), name


def test_a_run_leaves_a_whole_log_that_replays_to_its_own_commands(lockstep, tmp_path, inside):
    robot, walked = walk(lockstep, tmp_path)
    assert walked.outcome == "timeout"
    assert walked.rows == 41
    log = read_run(walked.path)
    assert log.recovery.whole
    assert log.info.provenance == "simulated-kinematic"
    assert log.info.config["robot"]["base"] == "cpl.robot.wire"
    again = list(replay(log))
    assert len(again) == 41
    assert len(replayed(log, again)) == 0
    inside([each.velocity for each in robot.seen])
    assert robot.seen[-1].mode == Mode.STAND


def test_another_gain_would_be_noticed_by_the_replay(lockstep, tmp_path):
    _, walked = walk(lockstep, tmp_path)
    log = read_run(walked.path)
    log.info.config["kp_min"] = log.info.config["kp_max"] = 1.2
    assert len(replayed(log, list(replay(log)))) > 30


def test_a_log_is_never_overwritten(lockstep, tmp_path):
    walk(lockstep, tmp_path)
    with pytest.raises(FileExistsError):
        walk(lockstep, tmp_path)


def test_a_policy_that_predicts_needs_a_predictor(lockstep, tmp_path):
    with pytest.raises(ValueError, match="predictor must be given for policy 'paper'"):
        walk(lockstep, tmp_path, plan=evaluation(1)[0])


def test_the_gait_does_not_start_again_by_itself(lockstep):
    """As reported of the Go1: after mode 0 a slow command is not enough."""
    robot = lockstep()
    robot.place((0.0, 0.0, 0.0), 0)
    base, go1 = robot.robot.base, robot.emulation.go1
    for mode, command, moves in (
        (Mode.IDLE, 0.0, False), (Mode.WALK, 0.1, False), (Mode.WALK, 0.2, True),
        (Mode.WALK, 0.1, True), (Mode.STAND, 0.0, False), (Mode.WALK, 0.1, True),
    ):  # fmt: skip
        base.send(mode, (command, 0.0, 0.0))
        go1.serve(0.0)
        assert (go1.drive != (0.0, 0.0, 0.0)) == moves


def test_the_robot_obeys_one_sender_at_a_time(lockstep):
    robot, other = lockstep(), lockstep()
    address = robot.emulation.go1.address
    robot.robot.base.send(Mode.WALK, (0.5, 0.0, 0.0))
    robot.emulation.go1.serve(0.0)
    with other.emulation._socket as stranger:
        stranger.sendto(b"hello", address)
        robot.emulation.go1.serve(0.1)
    assert robot.emulation.go1.refused == {"stranger": 1}


# Every fault of cable, camera and robot, and those of the computer, which are below.
LOCAL = (
    "operator", "clock_forward", "clock_back", "slow_policy", "exception", "no_number",
    "disk_full",
)  # fmt: skip
CELLS = [(fault, phase) for fault in (*FAULTS, *LOCAL) for phase in PHASES]
QUICK = {"cut", "frozen", "battery", "clock_back", "exception", "disk_full"}


def cell_id(cell):
    return "-".join(cell)


def judge(robot, path, fault, phase, inside):
    """Whatever happened: envelope kept, zero at the end where the robot could hear, log intact."""
    inside([each.velocity for each in robot.seen])
    reached = [each for each in robot.seen if each.t_s > 1.0]
    # With the cable cut nothing reaches the robot: it is the watchdog's place that matters then.
    if reached and phase != "stopping" and fault != "cut":
        assert reached[-1].velocity == (0.0, 0.0, 0.0)
    if path.exists():
        log = read_run(path)
        assert len(log.table) > 0
        return log
    assert phase == "standing"
    return None


def cause(robot, fault, start, stop):
    """Return what a policy of the given kind predicts, and who is the operator."""
    clock = robot.clock

    def now():
        return start <= clock.true_s < stop

    skew = {"clock_forward": 5.0, "clock_back": -5.0}.get(fault, 0.0)
    if skew:
        step = robot.clock._step

        def jump(t_s):
            clock.skew_s = skew if start <= t_s < stop else clock.skew_s
            step(t_s)

        robot.clock._step = jump

    def predict(features):
        assert features.shape == (47,)
        if fault == "slow_policy" and now():
            clock.skew_s += 0.5
        if fault == "exception" and now():
            raise ZeroDivisionError("for a test")
        return nan if fault == "no_number" and now() else 0.3

    robot.robot.operator = lambda: fault == "operator" and now()
    return predict


def run_cell(lockstep, tmp_path, inside, fault, phase):
    start, stop = PHASES[phase]
    planned = [Fault(name=fault, start_s=start, stop_s=stop)] if fault in FAULTS else []
    robot = lockstep(planned)
    plan = replace(evaluation(1)[0], max_s=4.0)
    predict = cause(robot, fault, start, stop)
    robot.place(plan.course.start, 1)
    path, outcome = tmp_path / f"{plan.name}.mcap", "raised"
    with suppress(RobotError, ZeroDivisionError):
        outcome = perform(robot.robot, plan, tmp_path, predictor=predict).outcome
    return outcome, judge(robot, path, fault, phase, inside), robot


@pytest.mark.parametrize("cell", [c for c in CELLS if c[0] in QUICK - {"disk_full"}], ids=cell_id)
def test_faults_in_every_phase(lockstep, tmp_path, inside, cell):
    outcome, log, _ = run_cell(lockstep, tmp_path, inside, *cell)
    fault, phase = cell
    assert outcome == "raised" or outcome in OUTCOMES
    if phase == "walking":
        assert log is not None
        assert outcome == {"clock_back": "clock", "exception": "raised"}.get(
            fault, STOPS.get(fault, "timeout")
        )


@pytest.mark.faults
@pytest.mark.parametrize("cell", [c for c in CELLS if c[0] != "disk_full"], ids=cell_id)
def test_the_whole_fault_matrix(lockstep, tmp_path, inside, cell):
    outcome, log, robot = run_cell(lockstep, tmp_path, inside, *cell)
    fault, phase = cell
    assert outcome == "raised" or outcome in OUTCOMES
    if log is not None and outcome != "raised":
        assert log.recovery.whole
        assert log.table["outcome"].iloc[-1] == outcome
    if phase == "walking" and fault in STOPS:
        assert outcome == STOPS[fault]
    if phase == "walking" and fault in ("frozen", "lost", "camera_late", "failed"):
        assert {"stale_pose", "slam_lost"} & set(log.table["supervisor"])
    if phase == "walking" and fault == "jump":
        assert "pose_jump" in set(log.table["supervisor"])
    if phase == "walking" and fault in ("corrupted", "babble", "firmware"):
        assert robot.robot.base.refused + sum(robot.emulation.go1.refused.values()) > 0


@pytest.mark.parametrize("phase", PHASES)
def test_a_full_disk_costs_the_run_but_not_what_was_written(lockstep, tmp_path, inside, phase):
    """The limit is the operating system's own: the file may not grow beyond it."""
    robot = lockstep()
    robot.place(PLAN.course.start, 1)
    room = {"standing": 100, "walking": 20_000, "stopping": 60_000}[phase]
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (room, before[1]))
    try:
        with pytest.raises(OSError, match="File too large"):
            perform(robot.robot, replace(PLAN, max_s=20.0), tmp_path)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    inside([each.velocity for each in robot.seen])
    assert robot.seen[-1].mode == Mode.STAND
    path = tmp_path / f"{PLAN.name}.mcap"
    if phase != "standing":
        log = read_run(path)
        assert len(log.table) > 5
        assert not log.recovery.whole


@pytest.mark.parametrize(
    ("fault", "message"),
    [
        ("cut", "the robot has not answered in 1 s: look at address, cable and power"),
        ("firmware", "its firmware speaks another protocol"),
        ("babble", "its firmware speaks another protocol|has not answered"),
        ("damped", "the robot is damped by its remote"),
        ("lost", "the camera has sent no pose in 1 s: is the bridge running"),
        ("failed", "the camera's tracker has failed"),
        ("frozen", "the camera's pose has not changed for"),
    ],
)
def test_what_is_not_ready_is_said_clearly(lockstep, fault, message):
    robot = lockstep([Fault(name=fault)])
    robot.place(PLAN.course.start, 1)
    with pytest.raises(RobotError, match=message):
        prepare(robot.robot, PLAN.course, 1.0)


def test_halting_means_zero_and_then_standing(lockstep):
    robot = lockstep()
    robot.place(PLAN.course.start, 1)
    robot.robot.base.send(Mode.WALK, (0.5, 0.0, 0.0))
    halt(robot.robot)
    assert [each.mode for each in robot.seen[-5:]] == [Mode.WALK] * 3 + [Mode.STAND] * 2
    assert all(each.velocity == (0.0, 0.0, 0.0) for each in robot.seen[-5:])


def test_the_rehearsed_hall_and_ranges_are_those_of_the_book():
    from cpl.experiments.quadruped import lab as book

    assert (
        rehearsal_world().config == book.lab(book.LIGHT, book.RICHNESS, book.EXPOSURE_S, 0).config
    )
    assert RANGES == book.RANGES
    assert set(POLICIES) < set(book.POLICIES)
    plan = collection(2)[1]
    np.testing.assert_array_equal(plan.course.waypoints, book.training_path(0, 1, 4).waypoints)
    assert plan.seed == book.run_seed(0, "collect", 1)
    assert evaluation(1)[0].seed == book.run_seed(0, "eval", "triangle", 0)


def test_plans_and_faults_are_checked():
    with pytest.raises(ValueError, match="policy must be one of"):
        replace(PLAN, policy="fast")
    with pytest.raises(ValueError, match="trajectories must be at least 1, not 0"):
        collection(0)
    with pytest.raises(ValueError, match="repeats must be at least 1, not 0"):
        evaluation(0)
    with pytest.raises(ValueError, match="name must be one of dropped, late"):
        Fault(name="rain")
    with pytest.raises(ValueError, match="start_s must be before stop_s"):
        Fault(name="cut", start_s=2.0, stop_s=1.0)
    emulation = Emulation(Ideal(), ("127.0.0.1", 9))
    with pytest.raises(ValueError, match="place must be called before step"):
        emulation.look(0.0)
    emulation.close()
    assert len(FAULTS) + len(LOCAL) >= 12
