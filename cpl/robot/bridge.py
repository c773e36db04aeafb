"""The T265's side of the story: read the camera, pass poses and SLAM errors on over UDP.

The last SDK that knows the camera (pyrealsense2 2.53.1) has wheels for Python 3.7 to 3.10 only, so
this file is a program of its own for Python 3.10. It needs pyrealsense2, and `seal.py` beside it::

    python3.10 cpl/robot/bridge.py --to 127.0.0.1:9201 --key-file run.key

Without `--key-file` the key is the first line of standard input. Each packet is sealed with it, and
says by which start of the camera its pose is counted: a camera that is plugged in again calls its
present place the origin.

A SLAM error is no notification of the SDK's: it writes the warning "SLAM_ERROR Speed" into its log,
so the log is what is listened to. With `--software PORT` there is no camera: poses and warnings
that come in at that port go through the library's software device and its log, and out again.
"""

from __future__ import annotations

import argparse
import os
import re
import signal
import socket
import struct
import sys
import threading
import time
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

if __package__:
    from cpl.robot import seal
else:  # a program of its own, in another Python
    import seal  # pyright: ignore[reportMissingImports]

__all__ = ["CameraPacketError", "Pose", "Stamp", "Warned", "decode", "encode", "main"]

MAGIC = b"CPLT"
KIND_POSE, KIND_WARNING = 1, 2
SEALED = b"camera"
# magic, kind, number, device time [s]; the bridge's run, the camera's start, computer's time [s]
HEADER = struct.Struct("<4sBIdQId")
POSE = struct.Struct("<13dB")  # position, quaternion, velocity, angular velocity, confidence
SLAM_ERROR = re.compile(r"SLAM_ERROR\s+(Vision|Speed|Other)")
CODES = {"Vision": 1, "Speed": 2, "Other": 3}
RETRY_S = 1.0  # [s] between attempts to open a camera that is not there


class CameraPacketError(ValueError):
    """A packet that is none of the bridge's."""


@dataclass(frozen=True)
class Pose:
    """A pose as the camera gives it, in its own axes (y up, z backward; velocities in the world).

    Args:
        number: Counts up, with warnings in the same count.
        t_s: The device's clock [s].
        position: x, y, z [m].
        quaternion: x, y, z, w.
        velocity: In the world frame [m/s].
        angular_velocity: In the world frame [rad/s].
        confidence: 0 failed .. 3 high.
    """

    number: int
    t_s: float
    position: tuple[float, ...]
    quaternion: tuple[float, ...]
    velocity: tuple[float, ...]
    angular_velocity: tuple[float, ...]
    confidence: int


@dataclass(frozen=True)
class Warned:
    """A SLAM error: 1 Vision, 2 Speed, 3 Other."""

    number: int
    t_s: float
    code: int


@dataclass(frozen=True)
class Stamp:
    """What the bridge says of a packet.

    Args:
        run: The bridge's number, drawn when it starts.
        start: How often it started the camera.
        sent_s: The computer's time, which goes on in suspend [s].
    """

    run: int
    start: int
    sent_s: float


def encode(packet: Pose | Warned, stamp: Stamp, key: bytes) -> bytes:
    """Return the sealed packet of a pose or of a SLAM error."""
    if isinstance(packet, Pose):
        numbers = (*packet.position, *packet.quaternion, *packet.velocity, *packet.angular_velocity)
        kind, body = KIND_POSE, POSE.pack(*numbers, packet.confidence)
    else:
        kind, body = KIND_WARNING, bytes([packet.code])
    said = (stamp.run, stamp.start, stamp.sent_s)
    head = HEADER.pack(MAGIC, kind, packet.number % 2**32, packet.t_s, *said)
    return seal.sealed(head + body, key, SEALED)


def decode(data: bytes, key: bytes) -> tuple[Pose | Warned, Stamp]:
    """Read a packet.

    Raises:
        CameraPacketError: It is damaged, or none of this run's bridge.

    >>> decode(encode(Warned(7, 0.5, 2), Stamp(1, 1, 9.0), bytes(32)), bytes(32))
    (Warned(number=7, t_s=0.5, code=2), Stamp(run=1, start=1, sent_s=9.0))
    """
    try:
        said = seal.opened(data, key, SEALED)
    except seal.SealError as error:
        raise CameraPacketError(str(error)) from error
    if len(said) <= HEADER.size or said[:4] != MAGIC:
        raise CameraPacketError(f"{len(data)} bytes that begin with {data[:4].hex()}")
    _, kind, number, t_s, run, start, sent_s = HEADER.unpack_from(said)
    body, stamp = said[HEADER.size :], Stamp(run, start, sent_s)
    timed = abs(t_s) < 1e12 and abs(sent_s) < 1e12  # False for NaN too
    if timed and kind == KIND_POSE and len(body) == POSE.size:
        *n, confidence = POSE.unpack(body)
        finite = all(abs(each) < 1e6 for each in n)
        if finite and confidence <= 3 and abs(sum(q * q for q in n[3:7]) - 1) < 1e-2:
            vectors = (tuple(n[:3]), tuple(n[3:7]), tuple(n[7:10]), tuple(n[10:]))
            return Pose(number, t_s, *vectors, confidence), stamp
    elif timed and kind == KIND_WARNING and len(body) == 1 and body[0] in CODES.values():
        return Warned(number, t_s, body[0]), stamp
    raise CameraPacketError(f"a packet of kind {kind} with contents that cannot be")


def main(words: Any = None) -> int:  # noqa: ANN401 - a list of words
    """Run the bridge until it is told to stop."""
    parser = argparse.ArgumentParser(
        prog="bridge.py", description="Read a T265, pass poses and SLAM errors on."
    )
    parser.add_argument("--to", required=True, metavar="HOST:PORT", help="who is to be told")
    parser.add_argument("--software", type=int, metavar="PORT", help="no camera: read this port")
    parser.add_argument("--key-file", type=Path, help="the run's key, mode 600 (default: stdin)")
    chosen = parser.parse_args(words)
    host, _, port = chosen.to.rpartition(":")
    try:
        rs: Any = import_module("pyrealsense2")
    except ImportError as error:
        version = ".".join(map(str, sys.version_info[:2]))
        sys.stderr.write(
            f"bridge: pyrealsense2 cannot be imported by Python {version} ({error}). For the T265 "
            "use Python 3.10 and `pip install pyrealsense2==2.53.1.4623`.\n"
        )
        return 1
    try:
        file = chosen.key_file
        key = seal.key_of_file(file) if file else seal.key_of_stream(sys.stdin.buffer)
    except (ValueError, OSError) as error:
        sys.stderr.write(f"bridge: {error}\n")
        return 1
    try:  # before ordinary processes, if that is allowed
        os.sched_setscheduler(0, os.SCHED_RR, os.sched_param(5))
    except OSError:
        sys.stderr.write("bridge: the scheduler gives no priority\n")
    stop = threading.Event()
    for name in (signal.SIGTERM, signal.SIGINT):
        signal.signal(name, lambda *_: stop.set())
    teller = _Teller((host, int(port)), key)
    rs.log_to_callback(rs.log_severity.warn, lambda _, message: teller.heard(message.raw()))
    if chosen.software is None:
        _camera(rs, teller, stop)
    else:
        _software(rs, teller, stop, chosen.software)
    sys.stdout.flush()
    # 2.53.1 crashes when the interpreter takes the log callback down: leave without that.
    os._exit(0)


def now_s() -> float:
    """Return the computer's time, which goes on in suspend [s]."""
    return time.clock_gettime(getattr(time, "CLOCK_BOOTTIME", time.CLOCK_MONOTONIC))


class _Teller:
    """Number packets and send them; called from the library's threads."""

    def __init__(self, to: tuple[str, int], key: bytes) -> None:
        self.key, self.start = key, 0
        self._to, self._number, self._lock = to, 0, threading.Lock()
        self._run = int.from_bytes(os.urandom(8), "little")
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)

    def heard(self, text: str) -> None:
        found = SLAM_ERROR.search(text)
        if found:
            self._send(lambda n: Warned(n, now_s(), CODES[found[1]]))

    def frame(self, frame: Any) -> None:  # noqa: ANN401 - the library's
        p = frame.as_pose_frame().get_pose_data()
        t, r, v, w = p.translation, p.rotation, p.velocity, p.angular_velocity
        self._send(
            lambda n: Pose(
                n,
                frame.timestamp / 1e3,
                (t.x, t.y, t.z),
                (r.x, r.y, r.z, r.w),
                (v.x, v.y, v.z),
                (w.x, w.y, w.z),
                p.tracker_confidence,
            )
        )

    def _send(self, packet: Any) -> None:  # noqa: ANN401 - from a number to a packet
        with self._lock:
            self._number += 1
            stamp = Stamp(self._run, self.start, now_s())
            try:
                self._socket.sendto(encode(packet(self._number), stamp, self.key), self._to)
            except OSError as error:  # a lost packet: whoever waits for poses notices
                sys.stderr.write(f"bridge: {error}\n")


def _camera(rs: Any, teller: _Teller, stop: threading.Event) -> None:  # noqa: ANN401
    """Read a T265; open it again for as long as it takes when it was unplugged."""
    parent = os.getppid()
    while not stop.is_set() and os.getppid() == parent:
        pipeline, config = rs.pipeline(), rs.config()
        config.enable_stream(rs.stream.pose)
        teller.start += 1  # its origin is another one from now on
        try:
            pipeline.start(config, teller.frame)
        except RuntimeError as error:
            sys.stderr.write(f"bridge: no camera: {error}\n")
            stop.wait(RETRY_S)
            continue
        sys.stderr.write("bridge: the camera streams\n")
        while not stop.wait(RETRY_S) and len(rs.context().query_devices()):
            if os.getppid() != parent:  # nobody is left to be told
                stop.set()
        pipeline.stop()


def _software(rs: Any, teller: _Teller, stop: threading.Event, port: int) -> None:  # noqa: ANN401
    """Let what comes in at a port pass through the library as if a camera had said it."""
    stream = rs.pose_stream()
    stream.type, stream.fmt = rs.stream.pose, rs.format.six_dof
    stream.index, stream.uid, stream.fps = 0, 1, 200
    device = rs.software_device()
    sensor = device.add_sensor("Tracking Module")
    profile = sensor.add_pose_stream(stream)
    sensor.open(profile)
    sensor.start(teller.frame)
    feed = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    feed.bind(("127.0.0.1", port))
    feed.settimeout(0.2)
    sys.stderr.write("bridge: the software device streams\n")
    sys.stderr.flush()
    parent = os.getppid()
    while not stop.is_set() and os.getppid() == parent:
        try:
            packet, stamp = decode(feed.recv(2048), teller.key)
        except TimeoutError:
            continue
        except CameraPacketError as error:
            sys.stderr.write(f"bridge: {error}\n")
            continue
        teller.start = stamp.start
        if isinstance(packet, Warned):
            kind = {code: name for name, code in CODES.items()}[packet.code]
            rs.log(rs.log_severity.warn, f"SLAM_ERROR {kind}")
        else:
            sensor.on_pose_frame(_frame(rs, packet, profile))
    sensor.stop()
    sensor.close()


def _frame(rs: Any, packet: Pose, profile: Any) -> Any:  # noqa: ANN401
    data = rs.pose()
    for name in ("translation", "velocity", "angular_velocity", "acceleration"):
        numbers = {"translation": packet.position, "acceleration": (0.0, 0.0, 0.0)}.get(name)
        setattr(data, name, _vector(rs, getattr(packet, name) if numbers is None else numbers))
    data.angular_acceleration = _vector(rs, (0.0, 0.0, 0.0))
    turn = rs.quaternion()
    turn.x, turn.y, turn.z, turn.w = packet.quaternion
    data.rotation = turn
    data.tracker_confidence = data.mapper_confidence = packet.confidence
    frame = rs.software_pose_frame()
    frame.data, frame.profile = data, rs.pose_stream_profile(profile)
    frame.timestamp, frame.frame_number = packet.t_s * 1e3, packet.number
    frame.domain = rs.timestamp_domain.system_time
    return frame


def _vector(rs: Any, numbers: tuple[float, ...]) -> Any:  # noqa: ANN401
    vector = rs.vector()
    vector.x, vector.y, vector.z = numbers
    return vector


if __name__ == "__main__":
    sys.exit(main())
