"""Real processes, killed at nasty moments; what then reached the robot is in its black box."""

import json
import os
import shutil
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import pytest

from cpl.logs import read_run
from cpl.robot import Mode, RobotError, WatchdogConfig, WatchedBase, boottime, free_port
from cpl.robot.emulator.relay import Relay
from cpl.robot.packets import Order, decode_report, encode
from cpl.robot.ports import drain, receiver
from cpl.robot.processes import camera_library, here_is_camera_library, start_bridge
from cpl.robot.seal import make_key_file, new_key
from cpl.robot.watched import launch_watchdog
from cpl.robot.wire import decode_command

ZERO_WITHIN_S = 0.3
STAND_WITHIN_S = 1.5
ENDS = {
    "SIGKILL": ("policy", signal.SIGKILL),
    "SIGTERM": ("policy", signal.SIGTERM),
    "SIGHUP": ("policy", signal.SIGHUP),
    "SIGINT": ("policy", signal.SIGINT),
    "SIGSTOP": ("policy", signal.SIGSTOP),
    "watchdog": ("watchdog", signal.SIGKILL),
    "watchdog hangs": ("watchdog", signal.SIGSTOP),
    "second": ("second", signal.SIGKILL),
    "second hangs": ("second", signal.SIGSTOP),
}
PHASES = ("standing", "walking", "stopping")


def end_it(session, how, phase, inside, placement="laptop"):
    """Kill somebody in a phase; return after how long the robot was at zero, and stood."""
    running = session(placement, seconds=2.0)
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


def test_a_hung_watchdog_is_killed_and_its_second_stops_the_robot(session, inside):
    zero_s, stand_s, running = end_it(session, "watchdog hangs", "walking", inside)
    assert zero_s <= ZERO_WITHIN_S
    assert stand_s <= STAND_WITHIN_S
    assert running.wait_for("over")["outcome"] == "watchdog"
    running.process.wait(timeout=30)
    assert {running.state(whom) for whom in ("watchdog", "second", "emulator")} == {"gone"}


@pytest.mark.faults
@pytest.mark.parametrize("phase", PHASES)
@pytest.mark.parametrize("how", ENDS)
@pytest.mark.parametrize("placement", ["laptop", "robot"])
def test_every_exit_ends_in_zero_and_then_in_standing(session, inside, how, phase, placement):
    zero_s, stand_s, running = end_it(session, how, phase, inside, placement)
    # A second that is gone frightens nobody at once: its watchdog ends the run in good order.
    if not how.startswith("second"):
        assert zero_s <= ZERO_WITHIN_S
    if phase == "walking":
        assert stand_s <= STAND_WITHIN_S
    if how == "SIGINT" and phase == "walking":
        assert running.wait_for("over")["outcome"] == "operator"
        assert read_run(running.folder / "collect-00.mcap").recovery.whole


@pytest.mark.faults
@pytest.mark.parametrize("pause_s", [0.0, 0.1])
@pytest.mark.parametrize("first", ["policy", "watchdog"])
def test_policy_and_watchdog_killed_leave_a_second_that_stops_the_robot(session, first, pause_s):
    running = session(seconds=20.0)
    running.wait_for("walking")
    then = running.kill(first)
    time.sleep(pause_s)
    running.kill("watchdog" if first == "policy" else "policy")
    zero_s, stand_s = running.rests_after(then)
    assert zero_s <= ZERO_WITHIN_S
    assert stand_s <= STAND_WITHIN_S


@pytest.mark.faults
def test_watchdog_and_second_that_hang_leave_a_policy_that_stops_the_robot(session):
    running = session(seconds=20.0)
    running.wait_for("walking")
    then = running.kill("second", signal.SIGSTOP)
    running.kill("watchdog", signal.SIGSTOP)
    zero_s, _ = running.rests_after(then)
    assert zero_s <= 0.6  # it gives the second its time first
    assert running.wait_for("over")["outcome"] == "watchdog"
    running.process.wait(timeout=30)
    assert running.state("watchdog") == running.state("second") == "gone"


@pytest.mark.faults
def test_orders_that_waited_while_the_watchdog_hung_are_none(session):
    """Orders queue up in its socket, the policy is killed, the watchdog goes on."""
    running = session(seconds=20.0)
    running.wait_for("walking")
    running.kill("second", signal.SIGSTOP)  # or it would have killed the watchdog by then
    running.kill("watchdog", signal.SIGSTOP)
    time.sleep(0.15)
    running.kill("policy", signal.SIGKILL)
    time.sleep(2.0)
    then = running.kill("watchdog", signal.SIGCONT)
    time.sleep(1.0)
    assert [each for each in running.box() if each["t"] > then and any(each["v"])] == []
    assert running.box()[-1]["mode"] == Mode.STAND


@pytest.mark.faults
def test_a_computer_that_slept_wakes_up_to_a_robot_that_is_told_zero(session):
    """All of its processes stop and go on, as in suspend; the robot's own computer does not."""
    running = session(seconds=20.0)
    running.wait_for("walking")
    for number in (signal.SIGSTOP, signal.SIGCONT):
        for whom in ("policy", "watchdog", "second"):
            then = running.kill(whom, number)
        time.sleep(3.0 if number == signal.SIGSTOP else 0.0)
    zero_s, _ = running.rests_after(then)
    assert zero_s <= ZERO_WITHIN_S
    assert running.wait_for("over")["outcome"] in ("clock", "watchdog")


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
        assert over["outcome"] in ("link", "watchdog")
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
    from cpl.robot.bridge import Pose, Stamp, Warned, decode, encode

    localizer_port, key, stamp = receiver(), new_key(), Stamp(1, 3, 0.5)
    bridge, feed = start_bridge(tmp_path, localizer_port.getsockname(), python, key, software=True)
    heard, stamps = [], set()
    sent = Pose(1, 0.5, (0.1, 0.2, -0.3), (0.0, 0.6, 0.0, 0.8), (0.4, 0.0, 0.1), (0.0, 0.5, 0.0), 2)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as out:
        end = time.monotonic() + 20
        while len({type(each) for each in heard}) < 2 and time.monotonic() < end:
            out.sendto(encode(sent, stamp, key), feed)
            out.sendto(encode(Warned(2, 0.5, 2), stamp, key), feed)
            out.sendto(encode(sent, stamp, new_key()), feed)
            out.sendto(b"junk", feed)
            time.sleep(0.05)
            for packet, said in (decode(data, key) for data in drain(localizer_port)):
                heard.append(packet)
                stamps.add((said.run, said.start))
    bridge.stop()
    localizer_port.close()
    poses = [each for each in heard if isinstance(each, Pose)]
    assert {each.code for each in heard if isinstance(each, Warned)} == {2}
    for name in ("position", "quaternion", "velocity", "angular_velocity"):
        assert getattr(poses[0], name) == pytest.approx(getattr(sent, name), abs=1e-6)
    assert poses[0].confidence == 2
    assert poses[0].t_s == pytest.approx(0.5)
    assert len({run for run, _ in stamps}) == 1
    assert max(start for _, start in stamps) == 3
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


@pytest.fixture
def watchdog(tmp_path):
    """A watchdog in a process of its own, its robot, and whoever speaks to it."""
    robot, here, key = receiver(), receiver(), new_key()
    listen = ("127.0.0.1", free_port())
    config = WatchdogConfig(robot=robot.getsockname(), library="wire", key=key)
    process = launch_watchdog(config, listen, tmp_path / "stats.json")
    yield robot, here, key, listen, process
    process.terminate()
    assert process.wait(timeout=10) == 0
    for each in (robot, here, process.stderr):
        each.close()


def greet(here, key, listen, hello=5):
    """Greet until there is a report; return it."""
    greeting = Order(run=0, hello=hello, number=1, heard_s=0.0, mode=Mode.IDLE)
    end = time.monotonic() + 30
    while time.monotonic() < end:
        here.sendto(encode(greeting, key), listen)
        time.sleep(0.05)
        for data in drain(here):
            return decode_report(data, key)
    raise AssertionError("no report")


def asked(robot):
    return [decode_command(data) for data in drain(robot)]


def test_a_watchdog_obeys_one_policy_with_the_key_and_nobody_else(watchdog, tmp_path):
    robot, here, key, listen, process = watchdog
    report = greet(here, key, listen)
    words = Path(f"/proc/{process.pid}/cmdline").read_text().split("\0")
    environment = Path(f"/proc/{report.pid}/environ").read_text()
    assert not any(key.hex() in text for text in (*words, environment))
    assert {each.mode for each in asked(robot)} == {Mode.IDLE}  # nothing was asked for yet

    def order(number, key=key, speed=0.5, run=report.run, heard_s=None, hello=5):
        heard_s = boottime() if heard_s is None else heard_s
        return encode(
            Order(run=run, hello=hello, number=number, heard_s=heard_s,
                  mode=Mode.WALK if speed else Mode.STAND, command=(speed, 0.0, 0.0)),
            key,
        )  # fmt: skip

    stand = order(10, speed=0.0)
    here.sendto(stand, listen)
    time.sleep(0.1)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
        for data in (
            b"", b"CPLO", bytes(100), order(11, new_key()), order(12), stand,
            encode(Order(run=0, hello=9, number=1, heard_s=0.0, mode=Mode.IDLE), key),
        ):  # fmt: skip
            stranger.sendto(data, listen)
        for data in (order(9), order(13, run=report.run + 1), order(14, heard_s=boottime() - 1),
                     order(15, heard_s=boottime() + 1), order(16, hello=6)):  # fmt: skip
            here.sendto(data, listen)
        time.sleep(0.3)
        stranger.setblocking(False)
        with pytest.raises(BlockingIOError):
            stranger.recv(1000)
    assert {each.mode for each in asked(robot)} <= {Mode.IDLE, Mode.STAND}
    told = [decode_report(data, key) for data in drain(here)]
    assert told[-1].obeyed == 10
    assert (told[-1].run, told[-1].hello) == (report.run, 5)
    here.sendto(order(17), listen)
    time.sleep(0.1)
    # Its robot never answers, so even a good order moves nothing.
    assert {each.velocity for each in asked(robot)} == {(0.0, 0.0, 0.0)}


def test_a_watchdog_counts_its_stream(watchdog, tmp_path):
    _, here, key, listen, process = watchdog
    greet(here, key, listen)
    process.terminate()
    process.wait(timeout=10)
    assert json.loads((tmp_path / "stats.json").read_text())["datagrams"] > 50


@pytest.mark.parametrize("trouble", ["no key", "others may read it", "none"])
def test_a_watchdog_without_a_key_of_its_own_does_not_begin(tmp_path, trouble):
    path = tmp_path / "run.key"
    make_key_file(path)
    if trouble == "others may read it":
        path.chmod(0o644)
    words = [sys.executable, "-m", "cpl.robot", "--robot", "127.0.0.1:9"]
    words += ["--listen", f"127.0.0.1:{free_port()}", "--library", "wire"]
    words += [] if trouble == "no key" else ["--key-file", str(path)]
    process = subprocess.Popen(
        words, stdin=subprocess.DEVNULL, stderr=subprocess.PIPE, start_new_session=True
    )
    if trouble == "none":
        time.sleep(2.0)
        assert process.poll() is None
        process.terminate()
    _, said = process.communicate(timeout=30)
    if trouble == "none":
        assert process.returncode in (0, -signal.SIGTERM)  # the second while it still starts
    else:
        assert process.returncode == 1
        wanted = "a key must be a line" if trouble == "no key" else "for you alone (chmod 600"
        assert wanted in said.decode()


NAMESPACES = """
import socket, subprocess, sys, time
from cpl.robot import Mode, WatchdogConfig, WatchedBase
away_s = float(sys.argv[1])
base = WatchedBase(WatchdogConfig(robot=("10.99.0.2", 8082), local_port=8080, library="wire"))
begun, done = time.monotonic(), 0
tripped = ""
while time.monotonic() - begun < 3.5:
    state = base.state()
    tripped = tripped or (state.tripped if state else "")
    base.send(Mode.WALK, (0.5, 0.0, 0.0))
    for k, at in enumerate((1.0, 1.0 + away_s)):
        if done == k and time.monotonic() - begun > at:
            subprocess.run(["ip", "link", "set", "cplA", "down" if k == 0 else "up"], check=True)
            print(("down", "up")[k], time.monotonic(), flush=True)
            done += 1
    time.sleep(0.1)
print("tripped", repr(tripped), flush=True)
base.close()
"""

ROBOT = """
import json, socket, time
from cpl.robot.wire import HighState, decode_command, encode_state
here = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
here.bind(("10.99.0.2", 8082)); here.settimeout(0.05)
end = time.monotonic() + 90
while time.monotonic() < end:
    try:
        data, sender = here.recvfrom(2000)
    except TimeoutError:
        continue
    command = decode_command(data)
    print(json.dumps([time.monotonic(), command.mode, *command.velocity]), flush=True)
    state = HighState(mode=command.mode, battery=80, velocity=(0, 0, 0), odometry=(0, 0, 0))
    try:
        here.sendto(encode_state(state), sender)
    except OSError:
        pass
"""


@pytest.fixture
def cable():
    """Two computers with a cable between them: network namespaces, which need root."""
    if os.geteuid() != 0 or shutil.which("ip") is None:
        pytest.skip("needs root and iproute2")

    def ip(*words):
        subprocess.run(["ip", *words], check=True, capture_output=True)

    ip("netns", "add", "cplA")
    ip("netns", "add", "cplB")
    ip("link", "add", "cplA", "netns", "cplA", "type", "veth", "peer", "name", "cplB",
       "netns", "cplB")  # fmt: skip
    for name, number in (("cplA", 1), ("cplB", 2)):
        ip("-n", name, "addr", "add", f"10.99.0.{number}/24", "dev", name)
        for link in (name, "lo"):
            ip("-n", name, "link", "set", link, "up")
    yield
    for name in ("cplA", "cplB"):
        ip("netns", "del", name)


@pytest.mark.faults
@pytest.mark.parametrize("away_s", [0.3, 0.6, 1.5])
def test_a_link_that_goes_and_comes_is_no_end_of_the_watchdog(cable, tmp_path, away_s):
    """The operating system says "network is unreachable" for as long."""

    def start(name, code, *words, out=subprocess.PIPE):
        return subprocess.Popen(
            ["ip", "netns", "exec", name, sys.executable, "-c", code, *words],
            stdout=out,
            text=True,
        )

    box = tmp_path / "box.jsonl"  # a pipe that nobody reads would hold the robot up
    with box.open("w") as out:
        robot = start("cplB", ROBOT, out=out)
    time.sleep(1.5)
    policy = start("cplA", NAMESPACES, str(away_s))
    said = [line.split() for line in policy.communicate(timeout=60)[0].splitlines()]
    robot.terminate()
    robot.wait(timeout=60)
    heard = [json.loads(line) for line in box.read_text().splitlines() if line.endswith("]")]
    up = next(float(words[1]) for words in said if words[0] == "up")
    before = max(each[0] for each in heard if each[0] < up)
    back = [each for each in heard if each[0] > up]
    assert back, "the link never came back"
    # The link is back when the kernel has found its neighbour again, not when it is switched on.
    gap_s = back[0][0] - before
    zero = next(each[0] for each in back if each[2:] == [0.0, 0.0, 0.0])
    if gap_s > 0.3:
        assert zero - back[0][0] <= ZERO_WITHIN_S
    if gap_s > 1.5:
        assert " ".join(said[-1][1:]) == "'the robot does not answer'"
    assert heard[-1][1:] == [Mode.STAND, 0.0, 0.0, 0.0]
