"""Real processes, killed at nasty moments; what then reached the robot is in its black box."""

import json
import os
import signal
import subprocess
import sys
import time

import pytest

from cpl.logs import read_run
from cpl.robot import Mode, RobotError, WatchdogConfig, WatchedBase, free_port
from cpl.robot.emulator.relay import Relay
from cpl.robot.ports import drain, receiver
from cpl.robot.processes import camera_library, here_is_camera_library, start_bridge

ZERO_WITHIN_S = 0.3
STAND_WITHIN_S = 1.5
ENDS = {
    "SIGKILL": ("policy", signal.SIGKILL),
    "SIGTERM": ("policy", signal.SIGTERM),
    "SIGHUP": ("policy", signal.SIGHUP),
    "SIGINT": ("policy", signal.SIGINT),
    "SIGSTOP": ("policy", signal.SIGSTOP),
    "watchdog": ("watchdog", signal.SIGKILL),
}
PHASES = ("standing", "walking", "stopping")


def end_it(session, how, phase, inside):
    """Kill somebody in a phase; return after how long the robot was at zero, and stood."""
    running = session(seconds=2.0)
    running.wait_for(phase)
    whom, number = ENDS[how]
    then = running.kill(whom, number)
    zero_s, stand_s = running.rests_after(then)
    inside([each["v"] for each in running.box()])
    log = running.folder / "collect-00.mcap"
    if phase != "standing":
        assert len(read_run(log).table) >= 9
    return zero_s, stand_s, running


def test_a_killed_policy_leaves_a_robot_that_stands(session, inside):
    zero_s, stand_s, _ = end_it(session, "SIGKILL", "walking", inside)
    assert zero_s <= ZERO_WITHIN_S
    assert stand_s <= STAND_WITHIN_S


@pytest.mark.faults
@pytest.mark.parametrize("phase", PHASES)
@pytest.mark.parametrize("how", ENDS)
def test_every_exit_ends_in_zero_and_then_in_standing(session, inside, how, phase):
    zero_s, stand_s, running = end_it(session, how, phase, inside)
    assert zero_s <= ZERO_WITHIN_S
    if phase == "walking":
        assert stand_s <= STAND_WITHIN_S
    if how == "SIGINT" and phase == "walking":
        assert running.wait_for("over")["outcome"] == "operator"
        assert read_run(running.folder / "collect-00.mcap").recovery.whole


@pytest.mark.faults
def test_an_exception_ends_in_zero_and_then_in_standing(session, inside):
    running = session()
    running.wait_for("walking")
    then = time.monotonic()
    (running.folder / "raise").touch()
    zero_s, stand_s = running.rests_after(then)
    assert zero_s <= ZERO_WITHIN_S
    assert stand_s <= STAND_WITHIN_S
    assert running.process.wait(timeout=30) != 0
    assert "ZeroDivisionError" in running.process.stderr.read()
    assert read_run(running.folder / "collect-00.mcap").recovery.whole
    inside([each["v"] for each in running.box()])


@pytest.mark.faults
@pytest.mark.parametrize("placement", ["laptop", "robot"])
def test_a_cut_link_stops_the_robot_only_if_the_watchdog_is_on_its_side(session, inside, placement):
    running = session(placement, seconds=4.0)
    running.wait_for("walking")
    then = time.monotonic()
    (running.folder / "cut").touch()
    over = running.wait_for("over")
    inside([each["v"] for each in running.box()])
    box = running.box()
    if placement == "robot":
        assert over["outcome"] == "watchdog"
        moved = [each["t"] for each in box if any(each["v"])]
        assert max(moved) - then <= ZERO_WITHIN_S + 0.1  # the file is looked for ten times a second
        assert box[-1]["mode"] == Mode.STAND
    else:
        # Nothing on this side of the cut can reach the robot: it goes on with what it heard last.
        assert over["outcome"] == "link"
        assert any(box[-1]["v"])
        assert max(each["t"] for each in box) - then < 0.3


def test_a_watchdog_that_cannot_start_says_why():
    taken = receiver()
    config = WatchdogConfig(
        robot=("127.0.0.1", free_port()), local_port=taken.getsockname()[1], library="wire"
    )
    with pytest.raises(RobotError, match=r"the watchdog did not come up: watchdog: .*in use"):
        WatchedBase(config)
    taken.close()


def test_a_relay_carries_both_ways_and_can_be_cut():
    far, near = receiver(), receiver()
    relay = Relay(far.getsockname())

    def hear(where):
        end = time.monotonic() + 3
        while time.monotonic() < end:
            for data in drain(where):
                return data
            time.sleep(0.005)
        return None

    near.sendto(b"there", relay.address)
    far_heard, sender = None, None
    end = time.monotonic() + 3
    while far_heard is None and time.monotonic() < end:
        try:
            far_heard, sender = far.recvfrom(100)
        except BlockingIOError:
            time.sleep(0.005)
    assert far_heard == b"there"
    far.sendto(b"back", sender)
    assert hear(near) == b"back"
    relay.suffer("cut", 30.0)
    near.sendto(b"lost", relay.address)
    time.sleep(0.1)
    assert list(drain(far)) == []
    for each in (relay, far, near):
        each.close()


def camera_pythons():
    """Interpreters with a pyrealsense2: this one, and the one that a real T265 needs."""
    found = [sys.executable] if here_is_camera_library() else []
    try:
        camera_library("python3.10")
    except RobotError:
        return found
    return [*found, "python3.10"]


@pytest.mark.parametrize("python", camera_pythons())
def test_poses_and_warnings_pass_through_the_vendors_library(tmp_path, python):
    """The bridge as it would run beside a camera, with the library's software device for one."""
    import socket

    from cpl.robot.bridge import Pose, Warned, encode_pose, encode_warning

    localizer_port = receiver()
    bridge, feed = start_bridge(tmp_path, localizer_port.getsockname(), python, software=True)
    from cpl.robot.bridge import decode

    heard = []
    sent = Pose(1, 0.5, (0.1, 0.2, -0.3), (0.0, 0.6, 0.0, 0.8), (0.4, 0.0, 0.1), (0.0, 0.5, 0.0), 2)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as out:
        end = time.monotonic() + 20
        while len({type(each) for each in heard}) < 2 and time.monotonic() < end:
            out.sendto(encode_pose(sent), feed)
            out.sendto(encode_warning(Warned(2, 0.5, 2)), feed)
            out.sendto(b"junk", feed)
            time.sleep(0.05)
            heard += [decode(data) for data in drain(localizer_port)]
    bridge.stop()
    localizer_port.close()
    poses = [each for each in heard if isinstance(each, Pose)]
    assert {each.code for each in heard if isinstance(each, Warned)} == {2}
    for name in ("position", "quaternion", "velocity", "angular_velocity"):
        assert getattr(poses[0], name) == pytest.approx(getattr(sent, name), abs=1e-6)
    assert poses[0].confidence == 2
    numbers = [each.number for each in heard]
    assert numbers == sorted(set(numbers))


def test_a_bridge_without_the_library_says_what_to_install(tmp_path):
    """A Python without packages, as a freshly installed one is."""
    from cpl.robot import bridge

    done = subprocess.run(
        [sys.executable, "-S", "-E", bridge.__file__, "--to", "127.0.0.1:9"],
        capture_output=True,
        text=True,
        check=False,
        cwd=tmp_path,
        env={"PATH": os.environ["PATH"]},
    )
    assert done.returncode == 1
    assert "Python 3.10 and `pip install pyrealsense2==2.53.1.4623`" in done.stderr


def test_a_watchdog_takes_no_orders_without_its_token(tmp_path):
    """Noise, strangers and late orders at the watchdog's port change nothing."""
    import socket

    from cpl.robot.packets import Order, decode_report, encode
    from cpl.robot.watched import launch_watchdog

    robot, here = receiver(), receiver()
    listen = ("127.0.0.1", free_port())
    config = WatchdogConfig(robot=robot.getsockname(), library="wire", token=42)
    process = launch_watchdog(config, listen, tmp_path / "stats.json")

    def order(token, number, mode=Mode.STAND, speed=0.0):
        return encode(Order(token=token, number=number, mode=mode, command=(speed, 0.0, 0.0)))

    reports = []
    end = time.monotonic() + 30
    while not reports and time.monotonic() < end:
        here.sendto(order(42, 10), listen)
        time.sleep(0.05)
        reports = [decode_report(data) for data in drain(here)]
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
        for data in (b"", b"CPLO", bytes(100), order(7, 11, Mode.WALK, 0.5),
                     order(42, 9, Mode.WALK, 0.5)):  # fmt: skip
            stranger.sendto(data, listen)
    time.sleep(0.3)
    from cpl.robot.wire import decode_command

    asked = [decode_command(data) for data in drain(robot)]
    assert {each.mode for each in asked} == {Mode.STAND}
    assert decode_report(list(drain(here))[-1]).obeyed == 10
    process.terminate()
    assert process.wait(timeout=10) == 0
    stats = json.loads((tmp_path / "stats.json").read_text())
    assert stats["datagrams"] > 50
    for each in (robot, here):
        each.close()
    process.stderr.close()
