"""What the robot's tests share: a robot in lock-step, and a real session that can be killed."""

import json
import os
import signal
import subprocess
import sys
import textwrap
import time
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

import pytest

from cpl.optional import look
from cpl.robot import Envelope, GuardConfig, Mode, within
from cpl.robot.emulator import Ideal, LockStep

PROCESSES = ("watchdog", "second", "emulator")

VICTIM = textwrap.dedent(
    """
    import json, sys, time
    from dataclasses import replace
    from pathlib import Path
    from cpl.robot import collection, perform, urgent
    from cpl.robot import session
    from cpl.robot.live import Emulated, emulated
    from cpl.robot.keyboard import Operator

    folder, placement, seconds = Path(sys.argv[1]), sys.argv[2], float(sys.argv[3])
    plan = replace(collection(1)[0], max_s=seconds)
    said = lambda **words: print(json.dumps(words), flush=True)

    def halt(robot):
        said(phase="stopping")
        time.sleep(0.05)
        real_halt(robot)

    real_halt, session.halt = session.halt, halt
    config = Emulated(start=plan.course.start, world="ideal", placement=placement,
                      software_camera=False)
    with Operator() as operator, emulated(config, folder, operator) as stage:
        base = stage.base
        said(phase="standing", watchdog=base.pid, second=stage.second, emulator=stage.emulator.pid,
             camera=stage.robot.localizer.address[1])
        stage.robot.base.send(1)
        time.sleep(0.15)

        def watch(row):
            if 0.95 < row["t_s"] < 1.05:
                said(phase="walking")
            if (folder / "cut").exists():
                stage.cut()
            if (folder / "raise").exists():
                raise ZeroDivisionError("for a test")
            if (folder / "pause").exists():
                (folder / "pause").unlink()
                time.sleep(3)

        with urgent():
            walked = perform(stage.robot, plan, folder, watch=watch)
        said(phase="over", outcome=walked.outcome, rows=walked.rows)
    """
)


@pytest.fixture(params=["sdk", "wire"])
def library(request):
    """Both ways to speak to a robot; the vendor's where it can be loaded."""
    if request.param == "sdk" and not (found := look("unitree_legged_sdk")):
        pytest.skip(str(found))
    return request.param


@pytest.fixture
def lockstep():
    """Make robots in lock-step, with eyes that never err unless another world is given."""
    made = []

    def make(faults=(), **words):
        words.setdefault("world", Ideal())
        words.setdefault("library", "wire")
        made.append(LockStep(faults=faults, **words))
        return made[-1]

    yield make
    for each in made:
        each.close()


@dataclass
class Session:
    """A session in processes of its own, and the black box of its robot."""

    folder: Path
    process: subprocess.Popen
    pids: dict = field(default_factory=dict)
    said: list = field(default_factory=list)

    def wait_for(self, phase):
        """Read on until a phase begins."""
        for line in self.process.stdout:
            words = json.loads(line)
            self.said.append(words)
            self.pids.update({k: v for k, v in words.items() if k in PROCESSES})
            if words["phase"] == phase:
                return words
        raise AssertionError(f"never {phase}: {self.said}\n{self.process.stderr.read()}")

    def kill(self, whom, number=signal.SIGKILL):
        """Send a signal and return when."""
        os.kill(self.process.pid if whom == "policy" else self.pids[whom], number)
        return time.monotonic()

    def state(self, whom):
        """Return the state of a process as the kernel gives it; `gone` if there is none."""
        pid = self.process.pid if whom == "policy" else self.pids[whom]
        try:
            return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
        except FileNotFoundError:
            return "gone"

    def box(self):
        """Return what reached the robot."""
        lines = (self.folder / "black_box.jsonl").read_text().splitlines()
        return [json.loads(line) for line in lines if line.endswith("}")]

    def rests_after(self, then, seconds=6.0):
        """Return how long after `then` the robot was asked for zero, for good, and to stand."""
        deadline = time.monotonic() + seconds
        while time.monotonic() < deadline:
            after = [each for each in self.box() if each["t"] > then]
            stood = [each["t"] for each in after if each["mode"] == Mode.STAND]
            if stood and after[-1]["mode"] == Mode.STAND and after[-1]["t"] - stood[0] > 0.2:
                break
            time.sleep(0.1)
        box = self.box()
        stood = [e["t"] for e in box if e["t"] > then and e["mode"] == Mode.STAND]
        stand_s = stood[0] - then if stood else float("inf")
        # A velocity holds until the next command.
        until = [b["t"] for a, b in pairwise(box) if any(a["v"])]
        if box and any(box[-1]["v"]):
            return float("inf"), stand_s
        return max([t - then for t in until if t > then], default=0.0), stand_s


@pytest.fixture
def session(tmp_path):
    """Start sessions; end what is left of them, process by process."""
    made = []

    def start(placement="laptop", seconds=2.0):
        folder = tmp_path / "session"
        process = subprocess.Popen(
            [sys.executable, "-c", VICTIM, str(folder), placement, str(seconds)],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )
        made.append(Session(folder, process))
        return made[-1]

    yield start
    for each in made:
        if each.process.poll() is None:
            each.process.send_signal(signal.SIGCONT)
            each.process.kill()
        each.process.communicate()
        for pid in each.pids.values():
            for number in (signal.SIGCONT, signal.SIGTERM):
                with suppress(ProcessLookupError):
                    os.kill(pid, number)


@pytest.fixture
def inside():
    """Say that every command is inside the envelope."""

    def check(commands, envelope=None):
        envelope = envelope or GuardConfig().envelope
        outside = [each for each in commands if not within(tuple(each), envelope)]
        assert isinstance(envelope, Envelope)
        assert outside == []

    return check
