"""The pre-flight list stops at the first item that fails, and says what to do."""

import pytest

from cpl.optional import Library
from cpl.quadruped import polyline
from cpl.robot import GuardConfig, RobotError, collection
from cpl.robot.checklist import QUESTIONS, before, connected
from cpl.robot.clock import Timing, histogram, urgent
from cpl.robot.drill import WHAT, WHAT_TO_DO, drill
from cpl.robot.emulator import Fault
from cpl.robot.processes import camera_library
from cpl.robot.rehearsal import Rehearsal, accelerated, train_on
from cpl.robot.view import View, panel

COURSE = collection(1)[0].course
ROW = {
    "t_s": 1.25, "x_m": 0.5, "y_m": -1.0, "yaw_rad": 1.6, "kp": 1.65, "l_hat": 0.25, "q": 0.1,
    "confidence": 3, "waypoint_index": 4, "cmd_v_x_mps": 0.3, "cmd_v_y_mps": 0.4,
    "cmd_yaw_rate_radps": -0.2, "slam_error": 2, "supervisor": "speed_clamp", "outcome": "arrived",
}  # fmt: skip


def said(items):
    return {item.name: item for item in items}


def test_this_computer_without_the_vendors_library(tmp_path, monkeypatch):
    absent = Library("unitree_legged_sdk", "absent")
    monkeypatch.setattr("cpl.robot.checklist.look", lambda name: absent)
    rehearsal = said(before(tmp_path / "new", hardware=False, library="wire"))
    assert rehearsal["the robot's library"].ok
    assert "cpl.robot.wire" in rehearsal["the robot's library"].said
    hardware = list(before(tmp_path, hardware=True))
    assert [item.ok for item in hardware] == [False]
    assert "pip install -e '.[go1]'" in str(hardware[0])


def test_a_camera_python_that_is_not_there_ends_the_list(tmp_path):
    items = list(before(tmp_path, hardware=False, library="wire", camera_python="python9.9"))
    assert [item.ok for item in items] == [True, False]
    assert "there is no python9.9" in items[-1].said
    with pytest.raises(RobotError, match="the T265 needs Python 3"):
        camera_library("python9.9")


@pytest.mark.parametrize(
    ("fault", "item", "words"),
    [
        ("cut", "robot and camera answer", "has not answered"),
        ("battery", "battery", "5 %, 40 % needed"),
        ("storm", "the tracker at rest", "SLAM errors"),
    ],
)
def test_a_robot_that_is_not_well_is_refused(lockstep, monkeypatch, fault, item, words):
    monkeypatch.setattr("cpl.robot.checklist.POSES_HZ", 5.0)  # in lock-step there are ten
    robot = lockstep([Fault(name=fault)])
    robot.place(COURSE.start, 1)
    items = list(connected(robot.robot, COURSE, GuardConfig()))
    assert [each.ok for each in items[:-1]] == [True] * (len(items) - 1)
    assert (items[-1].name, items[-1].ok) == (item, False)
    assert words in items[-1].said


def test_a_path_too_near_to_the_fence_is_refused(lockstep, monkeypatch):
    monkeypatch.setattr("cpl.robot.checklist.POSES_HZ", 5.0)
    wide = polyline([(0, 0), (2.6, 0)])
    robot = lockstep()
    robot.place(wide.start, 1)
    items = said(connected(robot.robot, wide, GuardConfig()))
    assert not items["the fence"].ok
    assert all(item.ok for name, item in items.items() if name != "the fence")


def test_the_questions_are_for_people():
    assert len(QUESTIONS) == 4
    assert all(question.endswith("?") for question in QUESTIONS)


def test_every_fault_has_something_to_do_and_stays_inside():
    assert set(WHAT_TO_DO) == set(WHAT)
    table = drill(["cut", "jump", "duplicated"])
    assert table["outcome"].tolist() == ["watchdog", "odometry", "timeout"]
    assert (table["fastest_mps"] <= 1.0).all()
    assert table["zero_s"].isna().tolist() == [False, False, True]


def test_the_panel_shows_what_is_asked_for():
    lines = "\n".join(panel(ROW, COURSE, (1.2, 1.8), 77))
    for words in (
        "battery 77 %", "kp", "l_hat 0.25", "q     0.10", "gain  1.65", "x +0.50 m  y -1.00 m",
        "speed_clamp, SLAM error Speed, over: arrived", "0.50 m/s",
    ):  # fmt: skip
        assert words in lines or words == "kp"
    assert "^" in lines


def test_a_pipe_gets_a_line_a_second_and_a_terminal_a_panel_drawn_over_itself():
    import io

    class Terminal(io.StringIO):
        def isatty(self):
            return True

    rows = [ROW | {"t_s": k / 10, "outcome": ""} for k in range(21)]
    pipe, terminal = io.StringIO(), Terminal()
    for out in (pipe, terminal):
        view = View(COURSE, (1.5, 1.5), lambda: 50, out)
        for row in rows:
            view(row)
    assert len(pipe.getvalue().splitlines()) == 3
    assert terminal.getvalue().count("\x1b[24A") == 20


def test_a_histogram_ends_with_what_there_was():
    assert (
        histogram([0.0001, 0.003], (1, 5, 10), width=2).splitlines()[-1] == "     < 5 ms       1 ##"
    )
    told = Timing(period_s=0.1, begun_s=[0.0, 0.1, 0.25]).told()
    assert told["period_error_max_ms"] == 50.0
    with urgent() as granted:
        assert granted in (True, False)


def test_a_small_collection_trains_a_predictor(tmp_path, monkeypatch):
    """In this process and in eyes that never err, so that it takes no time: with SLAM errors."""
    from cpl.quadruped import decode_predictor
    from cpl.robot import rehearsal
    from cpl.robot.emulator import Ideal

    class Storm(Ideal):
        def step(self, command):
            from dataclasses import replace

            seen = super().step(command)
            return replace(seen, slam_error=2 if abs(command[2]) > 0.5 else 0)

    monkeypatch.setattr(rehearsal, "_world", Storm)
    few = Rehearsal(trajectories=2, library="wire", workers=1)
    made = list(accelerated(collection(2), tmp_path / "collect", few, None))
    assert [walked.outcome for walked in made] == ["arrived"] * 2
    rows, positive = train_on(tmp_path / "collect", tmp_path / "net.safetensors")
    assert rows == sum(walked.rows - 2 for walked in made)
    assert 0 < positive < 1
    _, about = decode_predictor((tmp_path / "net.safetensors").read_bytes())
    assert about["logs"] == ["collect-00.mcap", "collect-01.mcap"]
    with pytest.raises(ValueError, match="folder must hold logs, not none"):
        train_on(tmp_path / "nothing", tmp_path / "net2.safetensors")
