"""What policy and watchdog tell each other: orders one way, reports the other.

Each is sealed with the run's key (:mod:`cpl.robot.seal`). What the two must agree on:

- *run*: a number that the watchdog draws when it starts. An order that does not name it is a
  greeting: it is answered with a report and moves nothing. So nothing that was recorded of an
  earlier run is ever obeyed.
- *hello*: a number that the policy draws. A report repeats it, so it is no earlier policy's.
- *number*: counts up; what comes late or twice is known by it.
- *heard_s*: the time that the newest report bore when the order was decided. It is the watchdog's
  own clock, so an order's age needs no second clock that agrees, wherever the policy is.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from math import isfinite

from cpl.robot.interfaces import ZERO, Command, Mode, Pose
from cpl.robot.seal import SealError, opened, sealed

__all__ = ["TRIPS", "Order", "PacketError", "Report", "decode_order", "decode_report", "encode"]

ORDER, REPORT = b"order", b"report"
TRIPS = (
    "", "no order came in time", "told to end", "the robot does not answer",
    "its second is gone", "its clock ran backwards",
)  # fmt: skip
"""Why a watchdog obeys no more."""
_ORDER = struct.Struct("<4sQQIdBB3d")
_REPORT = struct.Struct("<4sQQIdIIIBB3d3dIIdIB48s")
_ORDERED = (Mode.IDLE, Mode.STAND, Mode.WALK)


class PacketError(ValueError):
    """A packet that is none of ours."""


@dataclass(frozen=True, kw_only=True)
class Order:
    """What the policy wants.

    Args:
        run: The watchdog's number; 0 in a greeting.
        hello: The policy's number.
        number: Counts up.
        heard_s: The watchdog's time when this was decided, as its newest report said [s].
        mode: IDLE (nothing is asked for), STAND or WALK.
        command: v_x [m/s], v_y [m/s], yaw rate [rad/s].
        last: Whether no order follows.
    """

    run: int
    hello: int
    number: int
    heard_s: float
    mode: Mode
    command: Command = ZERO
    last: bool = False


@dataclass(frozen=True, kw_only=True)
class Report:
    """What the watchdog knows.

    Args:
        run: The watchdog's number.
        hello: The number of the policy that is spoken to.
        number: Counts up.
        sent_s: When this was sent, by the watchdog's clock [s].
        obeyed: Number of the last order taken.
        pid: The watchdog's process.
        refused: Datagrams of the robot that could not be read.
        mode: The robot's; 255 while it has not answered.
        battery: The robot's [%].
        velocity: The robot's.
        odometry: The robot's.
        version: The robot's.
        age_s: How old all that is [s].
        unsent: Commands that the operating system did not take.
        tripped: Why orders are no longer obeyed; empty while they are.
        library: What speaks to the robot.
    """

    run: int
    hello: int
    number: int
    sent_s: float
    obeyed: int
    pid: int
    refused: int
    mode: int
    battery: int
    velocity: Command
    odometry: Pose
    version: tuple[int, int]
    age_s: float
    unsent: int
    tripped: str
    library: str


def encode(packet: Order | Report, key: bytes) -> bytes:
    """Return the sealed datagram of an order or a report."""
    if isinstance(packet, Order):
        head = (b"CPLO", packet.run, packet.hello, packet.number, packet.heard_s)
        data = _ORDER.pack(*head, packet.mode, packet.last, *packet.command)
        return sealed(data, key, ORDER)
    data = _REPORT.pack(
        b"CPLR",
        packet.run,
        packet.hello,
        packet.number,
        packet.sent_s,
        packet.obeyed,
        packet.pid,
        packet.refused,
        packet.mode,
        packet.battery,
        *packet.velocity,
        *packet.odometry,
        *packet.version,
        packet.age_s,
        packet.unsent,
        TRIPS.index(packet.tripped),
        packet.library.encode()[:48],
    )
    return sealed(data, key, REPORT)


def decode_order(data: bytes, key: bytes) -> Order:
    """Read an order.

    Raises:
        PacketError: It is damaged, or none of this run.

    >>> wanted = Order(run=1, hello=2, number=1, heard_s=0.5, mode=Mode.WALK, command=(0.5, 0, 0))
    >>> decode_order(encode(wanted, bytes(32)), bytes(32)) == wanted
    True
    """
    fields = _checked(data, key, ORDER, b"CPLO", _ORDER)
    run, hello, number, heard_s, mode, last, *command = fields
    if mode not in _ORDERED or last > 1 or not all(map(isfinite, (heard_s, *command))):
        raise PacketError(f"an order for mode {mode} at {command}, heard at {heard_s} s")
    v_x, v_y, turn = command
    return Order(
        run=run,
        hello=hello,
        number=number,
        heard_s=heard_s,
        mode=Mode(mode),
        command=(v_x, v_y, turn),
        last=bool(last),
    )


def decode_report(data: bytes, key: bytes) -> Report:
    """Read a report.

    Raises:
        PacketError: It is damaged, or none of this run.
    """
    fields = _checked(data, key, REPORT, b"CPLR", _REPORT)
    run, hello, number, sent_s, obeyed, pid, refused, mode, battery = fields[:9]
    numbers = fields[9:15]
    v0, v1, age_s, unsent, trip, library = fields[15:]
    if not all(map(isfinite, (*numbers, age_s, sent_s))) or trip >= len(TRIPS):
        raise PacketError(f"a report of {numbers}, {age_s} s old, trip {trip}")
    return Report(
        run=run,
        hello=hello,
        number=number,
        sent_s=sent_s,
        obeyed=obeyed,
        pid=pid,
        refused=refused,
        mode=mode,
        battery=battery,
        velocity=(numbers[0], numbers[1], numbers[2]),
        odometry=(numbers[3], numbers[4], numbers[5]),
        version=(v0, v1),
        age_s=age_s,
        unsent=unsent,
        tripped=TRIPS[trip],
        library=library.rstrip(b"\0").decode(errors="replace"),
    )


def _checked(data: bytes, key: bytes, kind: bytes, magic: bytes, layout: struct.Struct) -> tuple:
    try:
        said = opened(data, key, kind)
    except SealError as error:
        raise PacketError(str(error)) from error
    if len(said) != layout.size or said[:4] != magic:
        raise PacketError(f"{len(said)} bytes that begin with {said[:4].hex()}")
    return layout.unpack(said)[1:]
