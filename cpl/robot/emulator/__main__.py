"""The emulator as a process, in real time: ``python -m cpl.robot.emulator --port 8082 ...``.

Its black box, one line a command that reached the robot, is what tests and rehearsals believe.
"""

from __future__ import annotations

import argparse
import json
import os
import signal
import sys
import threading
import time
from collections.abc import Sequence
from pathlib import Path

from cpl.robot.clock import boottime, urgent
from cpl.robot.emulator.body import Ideal
from cpl.robot.emulator.faults import Fault, Faults
from cpl.robot.emulator.twin import Emulation, rehearsal_world
from cpl.robot.interfaces import Mode
from cpl.robot.ports import address, is_loopback
from cpl.robot.seal import key_of_file, key_of_stream

STEP_S = 0.1
LOOK_S = 0.005  # [s] the camera's 200 Hz
SERVE_S = 0.001  # [s]
STANDING_S = 1e6  # [s] before any time at which it walks
ORPHAN_S = 5.0  # [s] of life after whoever started it is gone


def main(words: Sequence[str] | None = None) -> int:
    """Be a robot until told to stop."""
    parser = argparse.ArgumentParser(
        prog="emulator", description="A Go1 and a T265 on loopback, in real time."
    )
    parser.add_argument("--port", type=int, required=True, help="the robot's endpoint")
    parser.add_argument("--camera", type=address, required=True, metavar="HOST:PORT")
    parser.add_argument("--start", default="0,0,0", metavar="X,Y,YAW")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--world", choices=("twin", "ideal"), default="twin")
    parser.add_argument("--fault", action="append", default=[], metavar="NAME@START:STOP")
    parser.add_argument("--black-box", type=Path)
    parser.add_argument(
        "--key-file", type=Path, metavar="FILE", help="the camera's key, mode 600 (default: stdin)"
    )
    parser.add_argument("--life", type=float, default=600.0, help="leave after so long [s]")
    chosen = parser.parse_args(words)
    if not is_loopback(chosen.camera[0]):
        parser.error(f"--camera must be on loopback, not {chosen.camera[0]}")
    try:
        faults = [_fault(text) for text in chosen.fault]
        x, y, yaw = map(float, chosen.start.split(","))
        file = chosen.key_file
        key = key_of_file(file) if file else key_of_stream(sys.stdin.buffer)
    except (ValueError, OSError) as error:
        parser.error(str(error))
    world = Ideal() if chosen.world == "ideal" else rehearsal_world()
    if chosen.world == "twin":
        world.reset((x, y, yaw), chosen.seed)
        world.step((0.0, 0.0, 0.0))  # compiled before anybody waits for it
    emulation = Emulation(
        world, chosen.camera, Faults(faults, chosen.seed), key=key, port=chosen.port
    )
    emulation.place((x, y, yaw), chosen.seed)
    process = _Process(emulation, chosen.black_box)
    for name in (signal.SIGTERM, signal.SIGINT):
        signal.signal(name, lambda *_: process.stop.set())
    signal.signal(signal.SIGUSR1, lambda *_: process.cut())
    sys.stdout.write("the emulator is there\n")
    sys.stdout.flush()
    with urgent(5):  # a robot is a computer of its own
        process.run(chosen.life)
    return 0


class _Process:
    """Two threads: the endpoint answers at once, the world takes its time."""

    def __init__(self, emulation: Emulation, black_box: Path | None) -> None:
        self.stop = threading.Event()
        self._emulation, self._box = emulation, black_box
        self._begun_s = boottime()
        self._walks_s: float | None = None  # when the first velocity came: faults count from there

    def run(self, life_s: float) -> None:
        """Live for so long, or until told to stop."""
        endpoint = threading.Thread(target=self._serve, daemon=True)
        endpoint.start()
        begun = due = boottime()
        steps = 0
        parent, orphaned = os.getppid(), float("inf")
        while not self.stop.is_set() and due < min(begun + life_s, orphaned + ORPHAN_S):
            now = boottime()
            orphaned = min(orphaned, now) if os.getppid() != parent else float("inf")
            if now >= begun + steps * STEP_S:
                steps = max(steps + 1, int((now - begun) / STEP_S) - 4)
                self._emulation.advance(self._time(now))
            picture = begun + (steps - 1) * STEP_S
            self._emulation.look(self._time(now), min(now - picture, STEP_S))
            due = max(due + LOOK_S, now - STEP_S)
            time.sleep(max(0.0, due - boottime()))
        self.stop.set()
        endpoint.join()
        self._emulation.close()

    def cut(self) -> None:
        """Let the cable be cut from now on; SIGUSR1 does it."""
        now = self._time(boottime())
        self._emulation.faults.planned.append(Fault(name="cut", start_s=now))

    def _serve(self) -> None:
        go1, told = self._emulation.go1, 0
        box = None if self._box is None else self._box.open("w", encoding="utf-8", buffering=1)
        while not self.stop.wait(SERVE_S):
            now = boottime()
            told_s = time.monotonic()  # what those who read the black box measure with
            go1.serve(self._time(now))
            for seen in go1.seen[told:]:
                if self._walks_s is None and seen.mode == Mode.WALK:
                    self._walks_s = now
                if box is not None:
                    box.write(
                        json.dumps({"t": told_s, "mode": seen.mode, "v": seen.velocity}) + "\n"
                    )
            told = len(go1.seen)
        if box is not None:
            box.close()

    def _time(self, now: float) -> float:
        """Return the time since the robot was first asked to walk; before, it is negative [s]."""
        walks_s = self._walks_s
        return now - self._begun_s - STANDING_S if walks_s is None else now - walks_s


def _fault(text: str) -> Fault:
    name, at, times = text.partition("@")
    start, colon, stop = times.partition(":")
    if not (at and colon):
        raise ValueError(f"a fault is written NAME@START:STOP, not {text!r}")
    return Fault(name=name, start_s=float(start), stop_s=float(stop))


if __name__ == "__main__":
    sys.exit(main())
