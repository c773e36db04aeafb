"""The T265's side of the story: read the camera, pass poses and SLAM errors on over UDP.

The last SDK that knows the camera (pyrealsense2 2.53.1) has wheels for Python 3.7 to 3.10 only, so
this file is a program of its own for Python 3.10. It needs pyrealsense2 and nothing else::

    python3.10 cpl/robot/bridge.py --to 127.0.0.1:9201

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
import zlib
from dataclasses import dataclass
from importlib import import_module
from typing import Any

__all__ = ["CameraPacketError", "Pose", "Warned", "decode", "encode_pose", "encode_warning", "main"]

MAGIC = b"CPLT"
KIND_POSE, KIND_WARNING = 1, 2
HEADER = struct.Struct("<4sBId")  # magic, kind, number, device time [s]
POSE = struct.Struct("<13dB")  # position, quaternion, velocity, angular velocity, confidence
TAIL = struct.Struct("<I")  # CRC-32 of everything before
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


def encode_pose(pose: Pose) -> bytes:
    """Return the packet of a pose."""
    numbers = (*pose.position, *pose.quaternion, *pose.velocity, *pose.angular_velocity)
    return _packet(KIND_POSE, pose.number, pose.t_s, POSE.pack(*numbers, pose.confidence))


def encode_warning(warned: Warned) -> bytes:
    """Return the packet of a SLAM error."""
    return _packet(KIND_WARNING, warned.number, warned.t_s, bytes([warned.code]))


def decode(data: bytes) -> Pose | Warned:
    """Read a packet.

    Raises:
        CameraPacketError: It is damaged or none of the bridge's.

    >>> decode(encode_warning(Warned(7, 0.5, 2)))
    Warned(number=7, t_s=0.5, code=2)
    """
    least = HEADER.size + TAIL.size
    if len(data) <= least or data[:4] != MAGIC:
        raise CameraPacketError(f"{len(data)} bytes that begin with {data[:4].hex()}")
    if TAIL.unpack(data[-4:])[0] != zlib.crc32(data[:-4]):
        raise CameraPacketError(f"{len(data)} bytes with a wrong checksum")
    _, kind, number, t_s = HEADER.unpack_from(data)
    body = data[HEADER.size : -4]
    if kind == KIND_POSE and len(body) == POSE.size:
        *n, confidence = POSE.unpack(body)
        finite = all(abs(each) < 1e6 for each in (*n, t_s))  # False for NaN too
        if finite and confidence <= 3 and abs(sum(q * q for q in n[3:7]) - 1) < 1e-2:
            return Pose(
                number, t_s, tuple(n[:3]), tuple(n[3:7]), tuple(n[7:10]), tuple(n[10:]), confidence
            )
    elif kind == KIND_WARNING and len(body) == 1 and body[0] in CODES.values():
        return Warned(number, t_s, body[0])
    raise CameraPacketError(f"a packet of kind {kind} with contents that cannot be")


def main(words: Any = None) -> int:  # noqa: ANN401 - a list of words
    """Run the bridge until it is told to stop."""
    parser = argparse.ArgumentParser(
        prog="bridge.py", description="Read a T265, pass poses and SLAM errors on."
    )
    parser.add_argument("--to", required=True, metavar="HOST:PORT", help="who is to be told")
    parser.add_argument("--software", type=int, metavar="PORT", help="no camera: read this port")
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
    try:  # before ordinary processes, if that is allowed
        os.sched_setscheduler(0, os.SCHED_RR, os.sched_param(5))
    except OSError:
        sys.stderr.write("bridge: the scheduler gives no priority\n")
    stop = threading.Event()
    for name in (signal.SIGTERM, signal.SIGINT):
        signal.signal(name, lambda *_: stop.set())
    teller = _Teller((host, int(port)))
    rs.log_to_callback(rs.log_severity.warn, lambda _, message: teller.heard(message.raw()))
    if chosen.software is None:
        _camera(rs, teller, stop)
    else:
        _software(rs, teller, stop, chosen.software)
    sys.stdout.flush()
    # 2.53.1 crashes when the interpreter takes the log callback down: leave without that.
    os._exit(0)


class _Teller:
    """Number packets and send them; called from the library's threads."""

    def __init__(self, to: tuple[str, int]) -> None:
        self._to, self._number, self._lock = to, 0, threading.Lock()
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)

    def heard(self, text: str) -> None:
        found = SLAM_ERROR.search(text)
        if found:
            self._send(lambda n: encode_warning(Warned(n, time.monotonic(), CODES[found[1]])))

    def frame(self, frame: Any) -> None:  # noqa: ANN401 - the library's
        p = frame.as_pose_frame().get_pose_data()
        t, r, v, w = p.translation, p.rotation, p.velocity, p.angular_velocity
        self._send(
            lambda n: encode_pose(
                Pose(
                    n,
                    frame.timestamp / 1e3,
                    (t.x, t.y, t.z),
                    (r.x, r.y, r.z, r.w),
                    (v.x, v.y, v.z),
                    (w.x, w.y, w.z),
                    p.tracker_confidence,
                )
            )
        )

    def _send(self, packet: Any) -> None:  # noqa: ANN401 - from a number to bytes
        with self._lock:
            self._number += 1
            self._socket.sendto(packet(self._number), self._to)


def _camera(rs: Any, teller: _Teller, stop: threading.Event) -> None:  # noqa: ANN401
    """Read a T265; open it again for as long as it takes when it was unplugged."""
    parent = os.getppid()
    while not stop.is_set() and os.getppid() == parent:
        pipeline, config = rs.pipeline(), rs.config()
        config.enable_stream(rs.stream.pose)
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
            packet = decode(feed.recv(2048))
        except TimeoutError:
            continue
        except CameraPacketError as error:
            sys.stderr.write(f"bridge: {error}\n")
            continue
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


def _packet(kind: int, number: int, t_s: float, body: bytes) -> bytes:
    data = HEADER.pack(MAGIC, kind, number % 2**32, t_s) + body
    return data + TAIL.pack(zlib.crc32(data))


if __name__ == "__main__":
    sys.exit(main())
