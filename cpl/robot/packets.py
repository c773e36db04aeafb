"""What policy and watchdog tell each other: orders one way, reports the other.

Both are short datagrams with a checksum. An order carries the session's token, so that a program
left over from before cannot steer, and a number, so that one that comes late or twice is known.
"""

from __future__ import annotations

import struct
import zlib
from dataclasses import dataclass
from math import isfinite

from cpl.robot.interfaces import Command, Mode, Pose

__all__ = ["Order", "PacketError", "Report", "decode_order", "decode_report", "encode"]

_ORDER = struct.Struct("<4sIIB3d")
_REPORT = struct.Struct("<4sIIIBB3d3dIIdIB48s")
_TAIL = struct.Struct("<I")
_TRIPS = ("", "no order came in time", "told to end", "the robot does not answer")


class PacketError(ValueError):
    """A packet that is none of ours."""


@dataclass(frozen=True, kw_only=True)
class Order:
    """What the policy wants.

    Args:
        token: The session's.
        number: Counts up.
        mode: STAND or WALK.
        command: v_x [m/s], v_y [m/s], yaw rate [rad/s].
    """

    token: int
    number: int
    mode: Mode
    command: Command


@dataclass(frozen=True, kw_only=True)
class Report:
    """What the watchdog knows.

    Args:
        token: The session's.
        number: Counts up.
        obeyed: Number of the last order taken.
        mode: The robot's; 255 while it has not answered.
        battery: The robot's [%].
        velocity: The robot's.
        odometry: The robot's.
        version: The robot's.
        age_s: How old all that is [s].
        refused: Datagrams of the robot that could not be read.
        tripped: Why orders are no longer obeyed; empty while they are.
        library: What speaks to the robot.
    """

    token: int
    number: int
    obeyed: int
    mode: int
    battery: int
    velocity: Command
    odometry: Pose
    version: tuple[int, int]
    age_s: float
    refused: int
    tripped: str
    library: str


def encode(packet: Order | Report) -> bytes:
    """Return the datagram of an order or a report."""
    if isinstance(packet, Order):
        data = _ORDER.pack(b"CPLO", packet.token, packet.number, packet.mode, *packet.command)
    else:
        data = _REPORT.pack(
            b"CPLR",
            packet.token,
            packet.number,
            packet.obeyed,
            packet.mode,
            packet.battery,
            *packet.velocity,
            *packet.odometry,
            *packet.version,
            packet.age_s,
            packet.refused,
            _TRIPS.index(packet.tripped),
            packet.library.encode()[:48],
        )
    return data + _TAIL.pack(zlib.crc32(data))


def decode_order(data: bytes) -> Order:
    """Read an order.

    Raises:
        PacketError: It is damaged or none.

    >>> wanted = Order(token=7, number=1, mode=Mode.WALK, command=(0.5, 0.0, 0.0))
    >>> decode_order(encode(wanted)) == wanted
    True
    """
    _, token, number, mode, *command = _checked(data, b"CPLO", _ORDER)
    if mode not in (Mode.STAND, Mode.WALK) or not all(map(isfinite, command)):
        raise PacketError(f"an order for mode {mode} at {command}")
    v_x, v_y, turn = command
    return Order(token=token, number=number, mode=Mode(mode), command=(v_x, v_y, turn))


def decode_report(data: bytes) -> Report:
    """Read a report.

    Raises:
        PacketError: It is damaged or none.
    """
    fields = _checked(data, b"CPLR", _REPORT)
    _, token, number, obeyed, mode, battery = fields[:6]
    numbers = fields[6:12]
    v0, v1, age_s, refused, trip, library = fields[12:]
    if not all(map(isfinite, (*numbers, age_s))) or trip >= len(_TRIPS):
        raise PacketError(f"a report of {numbers}, {age_s} s old, trip {trip}")
    return Report(
        token=token,
        number=number,
        obeyed=obeyed,
        mode=mode,
        battery=battery,
        velocity=(numbers[0], numbers[1], numbers[2]),
        odometry=(numbers[3], numbers[4], numbers[5]),
        version=(v0, v1),
        age_s=age_s,
        refused=refused,
        tripped=_TRIPS[trip],
        library=library.rstrip(b"\0").decode(errors="replace"),
    )


def _checked(data: bytes, magic: bytes, layout: struct.Struct) -> tuple:
    if len(data) != layout.size + _TAIL.size or data[:4] != magic:
        raise PacketError(f"{len(data)} bytes that begin with {data[:4].hex()}")
    if _TAIL.unpack(data[-4:])[0] != zlib.crc32(data[:-4]):
        raise PacketError(f"{len(data)} bytes with a wrong checksum")
    return layout.unpack(data[:-4])
