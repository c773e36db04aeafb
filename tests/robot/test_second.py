"""A second makes of silence what it is, and stops the robot when its watchdog cannot."""

import os
import signal
import socket
import threading
import time

import pytest

from cpl.robot import RobotError, boottime, free_port
from cpl.robot.emulator import Endpoint
from cpl.robot.interfaces import ZERO, Mode
from cpl.robot.ports import receiver
from cpl.robot.second import (
    PATIENCE_S,
    TOOK_OVER,
    Beat,
    Line,
    Pulse,
    Seen,
    judge,
    stand_by,
    take_over,
)


@pytest.mark.parametrize(
    ("pulse", "now", "seen"),
    [
        (Pulse(), 9.0, Seen.WELL),  # it has not begun yet
        (Pulse(closed=True), 9.0, Seen.FAILED),
        (Pulse(heard_s=1.0), 0.99 + PATIENCE_S, Seen.WELL),
        (Pulse(heard_s=1.0), 1.01 + PATIENCE_S, Seen.GONE),
        (Pulse(heard_s=1.0, closed=True), 1.0, Seen.GONE),
        (Pulse(heard_s=1.0, closed=True, leaving=True), 9.0, Seen.LEFT),
        (Pulse(heard_s=1.0, leaving=True), 9.0, Seen.GONE),  # it said so, and hangs
    ],
)
def test_a_silent_watchdog_is_gone_and_one_that_left_is_not(pulse, now, seen):
    assert judge(pulse, now) is seen


def test_a_line_tells_and_hears_and_notices_its_end():
    ours, theirs = map(Line, socket.socketpair())
    assert ours.pulse == Pulse()
    theirs.here = Beat.IDLE
    theirs.beat(1.0)
    ours.beat(1.0)
    assert (ours.pulse.heard_s, ours.pulse.idle) == (1.0, True)
    theirs.here = Beat.HERE
    theirs.beat(2.0)
    ours.beat(2.0)
    assert not ours.pulse.idle
    ours.tell(Beat.END)
    theirs.read(2.1)
    assert theirs.told_to_end
    theirs.tell(Beat.LEAVING)
    theirs._end.close()
    ours.read(3.0)
    assert (ours.pulse.leaving, ours.pulse.closed) == (True, True)
    ours.tell(Beat.HERE)  # to nobody, which is no error
    ours._end.close()


@pytest.fixture
def robot():
    """An endpoint that is served by a thread."""
    made, over = Endpoint(), threading.Event()

    def serve():
        while not over.wait(0.001):
            made.serve(boottime())

    thread = threading.Thread(target=serve)
    thread.start()
    yield made
    over.set()
    thread.join()
    made.close()


def watched(robot, child):
    """Fork a watchdog that does what `child` does; return its second's verdict and status."""
    ours, theirs = socket.socketpair()
    port = free_port()
    pid = os.fork()
    if pid == 0:
        ours.close()
        child(Line(theirs))
        os._exit(7)
    theirs.close()
    line = Line(ours)
    status = stand_by(line, pid, robot.address, port)
    ours.close()
    return status, pid


def test_a_watchdog_that_leaves_in_good_order_is_not_replaced(robot):
    def child(line):
        line.beat(boottime())
        line.tell(Beat.LEAVING)

    status, _ = watched(robot, child)
    assert status == 0
    assert robot.seen == []


def test_a_watchdog_that_never_began_gives_its_status(robot):
    status, _ = watched(robot, lambda line: None)
    assert status == 7
    assert robot.seen == []


def test_a_hung_watchdog_is_killed_and_replaced(robot):
    def child(line):
        line.beat(boottime())
        os.kill(os.getpid(), signal.SIGSTOP)

    begun = time.monotonic()
    status, pid = watched(robot, child)
    assert status == TOOK_OVER
    assert time.monotonic() - begun > PATIENCE_S
    assert all(each.velocity == ZERO for each in robot.seen)
    assert [robot.seen[0].mode, robot.seen[-1].mode] == [Mode.WALK, Mode.STAND]
    with pytest.raises(ProcessLookupError):
        os.kill(pid, 0)


def test_a_robot_that_was_asked_for_nothing_is_not_made_to_stand(robot):
    def child(line):
        line.here = Beat.IDLE
        line.beat(boottime())

    status, _ = watched(robot, child)
    assert status == 7
    assert robot.seen == []


def test_zero_is_the_first_thing_that_a_link_carries_when_it_is_back():
    """Nothing answers at first; then somebody is there."""
    port, heard = free_port(), []

    def late():
        time.sleep(0.4)
        robot = Endpoint(port=port)
        end = boottime() + 3
        while boottime() < end and not (heard and heard[-1].mode == Mode.STAND):
            robot.serve(boottime())
            heard[:] = robot.seen
            time.sleep(0.001)
        robot.close()

    thread = threading.Thread(target=late)
    thread.start()
    assert take_over(("127.0.0.1", port), 0)
    thread.join()
    assert (heard[0].mode, heard[0].velocity) == (Mode.WALK, ZERO)


def test_nobody_there_is_given_up_after_a_while():
    assert not take_over(("127.0.0.1", free_port()), 0, persist_s=0.1)


def test_a_port_that_somebody_holds_is_said():
    taken = receiver()
    with pytest.raises(RobotError, match="cannot be stopped from here: port must be free"):
        take_over(("127.0.0.1", 9), taken.getsockname()[1], port_s=0.05)
    taken.close()
