"""The live loop is the book's, and every fault in every phase leaves log and envelope whole."""

import resource
from dataclasses import replace
from math import isnan

import numpy as np
import pandas as pd
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
    shape,
)
from cpl.robot import (
    OUTCOMES,
    GuardConfig,
    Mode,
    RobotError,
    Timing,
    collection,
    drill,
    drive,
    evaluation,
    halt,
    perform,
    prepare,
    replay,
    replayed,
)
from cpl.robot.drill import PLACEMENTS, WHAT, suffer
from cpl.robot.emulator import FAULTS, STRANGERS, Emulation, Fault, Ideal, rehearsal_world
from cpl.robot.session import POLICIES, RANGES, numbered

PLAN = replace(collection(1)[0], max_s=4.0)
PHASES = ("standing", "walking", "stopping")


def walk(lockstep, tmp_path, faults=(), plan=PLAN, placement="none"):
    robot = lockstep(faults, placement=placement)
    robot.place(plan.course.start, plan.seed)
    return robot, perform(robot.robot, plan, tmp_path)


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


def test_a_second_run_into_a_folder_refuses_before_anything_moves(lockstep, tmp_path):
    _, walked = walk(lockstep, tmp_path)
    before = walked.path.read_bytes()
    robot = lockstep()
    robot.place(PLAN.course.start, 1)
    with pytest.raises(FileExistsError, match=r"it stays; free is collect-00\.2"):
        perform(robot.robot, PLAN, tmp_path)
    assert robot.seen == []
    assert walked.path.read_bytes() == before
    again = numbered(tmp_path, PLAN)
    assert again.name == "collect-00.2"
    perform(robot.robot, again, tmp_path)
    assert numbered(tmp_path, PLAN).name == "collect-00.3"
    assert [path.name for path in sorted(tmp_path.iterdir())] == [
        "collect-00.2.mcap", "collect-00.mcap"
    ]  # fmt: skip


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


STOPS = {
    "battery": "battery", "damped": "damped", "outside": "geofence", "cut": "watchdog",
    "corrupted": "watchdog",
    "firmware": "watchdog", "babble": "watchdog", "jump": "odometry", "camera_moved": "odometry",
    "odometry_drifts": "odometry", "odometry_frozen": "odometry", "frozen": "camera",
    "lost": "camera", "camera_late": "camera", "camera_queue": "camera", "camera_drags": "camera",
    "camera_fast": "camera", "camera_set": "camera", "camera_replugged": "camera",
    "camera_corrupted": "camera", "operator": "operator", "clock_forward": "clock",
    "clock_back": "clock", "slow_policy": "watchdog", "hung": "watchdog", "suspended": "watchdog",
    "exception": "raised", "disk_full": "raised",
}  # fmt: skip
"""What a fault in the middle of a run ends it with, the watchdog on the laptop."""
GATED = {"odometry_drifts", "odometry_frozen", "failed", "camera_drags", "camera_fast"}
"""Faults that a distance bounds and not a time: nothing is late or missing when they begin."""
CELLS = [(fault, phase, place) for fault in WHAT for phase in drill.PHASES for place in PLACEMENTS]
QUICK = ["cut", "camera_queue", "camera_replugged", "suspended", "exception", "orders_replayed"]


def judge(cell):
    """Whatever happened: envelope kept, a robot at rest, a log that is whole."""
    assert cell.fastest_mps <= GuardConfig().envelope.v_max_mps
    # A cable that is cut for good is what no program on this side of it can help.
    assert cell.rests or (cell.fault, cell.phase, cell.placement) == ("cut", "stopping", "laptop")
    assert cell.outcome in (*OUTCOMES, "refused", "raised")
    assert cell.log == ("whole" if cell.outcome in OUTCOMES else cell.log)
    assert cell.log != "none" or cell.phase == "standing"
    if cell.phase != "walking":
        return
    if cell.placement == "laptop":
        assert cell.outcome == STOPS.get(cell.fault, "timeout")
    if not isnan(cell.zero_s) and cell.fault not in GATED | {"dropped"}:
        assert cell.zero_s <= cell.blind_s + 0.3
    if cell.fault in GATED - {"failed"}:
        assert cell.moved_m <= 1.1


@pytest.mark.parametrize("placement", PLACEMENTS)
@pytest.mark.parametrize("fault", QUICK)
def test_faults_in_the_middle_of_a_run(fault, placement):
    judge(suffer(fault, "walking", placement))


@pytest.mark.faults
@pytest.mark.parametrize("cell", CELLS, ids="-".join)
def test_the_whole_fault_matrix(cell):
    judge(suffer(*cell))


def test_a_stranger_without_the_key_changes_nothing(lockstep, tmp_path):
    """Forged, replayed and flooded orders, and forged poses: the run is the one without them."""

    def rows(names, folder):
        planned = [Fault(name=name, start_s=0.5, stop_s=9.0) for name in names]
        _, walked = walk(lockstep, tmp_path / folder, planned, placement="robot")
        assert walked.outcome == "timeout"
        return read_run(walked.path).table

    pd.testing.assert_frame_equal(rows([], "alone"), rows(STRANGERS, "hurt"))


def test_poses_that_are_late_from_the_start_show_in_the_odometry(lockstep, tmp_path):
    """A way that is always a second too long has no fastest to be compared with."""
    late = Fault(name="camera_queue", start_s=-1.0)
    robot = lockstep([late], placement="laptop")
    robot.place(PLAN.course.start, 1)
    robot.clock.wait(2.0)
    walked = perform(robot.robot, PLAN, tmp_path)
    assert walked.outcome == "odometry"
    table = read_run(walked.path).table
    x, y = table["true_x_m"], table["true_y_m"]
    assert np.hypot(x - x[0], y - y[0]).max() <= 0.6


@pytest.mark.parametrize("replug_s", [2.0, 3.0, 5.0, 7.0])
@pytest.mark.parametrize("name", ["camera_moved", "camera_replugged"])
@pytest.mark.parametrize("course", ["rectangle", "hexagon"])
def test_a_camera_with_another_origin_never_ends_in_arrived(
    lockstep, tmp_path, name, course, replug_s
):
    """Plugged in again for 0.3 s, with or without a bridge that says so."""
    plan = replace(PLAN, course=shape(course), max_s=25.0)
    faults = [Fault(name="lost", start_s=replug_s, stop_s=replug_s + 0.1),
              Fault(name=name, start_s=replug_s)]  # fmt: skip
    _, walked = walk(lockstep, tmp_path, faults, plan)
    assert walked.outcome in ("camera", "odometry")
    assert read_run(walked.path).table[["true_x_m", "true_y_m"]].abs().max().max() <= 3.0


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

    hall = book.KINEMATIC.lab(book.LIGHT, book.RICHNESS, book.EXPOSURE_S, 0)
    assert rehearsal_world().config == hall.config
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
    emulation = Emulation(Ideal(), ("127.0.0.1", 9), key=bytes(32))
    with pytest.raises(ValueError, match="place must be called before step"):
        emulation.look(0.0)
    emulation.close()
    assert len(WHAT) >= 30
    assert len(FAULTS) < len(WHAT)
