"""What goes over the cable to a Go1? Two datagrams, checked as robot and vendor's SDK check them.

A command (HighCmd) has 129 bytes and a checksum over its first 31 words, a state (HighState) 1,087
and one over its first 270. Both were seen to agree with unitree-legged-sdk 3.8.20231105 on
loopback; the layout is that of the SDK's public header. Nothing here needs the SDK.
"""

from __future__ import annotations

import struct
import zlib
from array import array
from dataclasses import dataclass
from math import isfinite

import numpy as np

from cpl.robot.interfaces import Command, Pose

__all__ = [
    "COMMAND_BYTES",
    "STATE_BYTES",
    "HighCommand",
    "HighState",
    "WireError",
    "checksum",
    "decode_command",
    "decode_state",
    "encode_command",
    "encode_state",
    "toward_zero",
]

COMMAND_BYTES = 129
STATE_BYTES = 1087
HEAD = b"\xfe\xef"
HIGH_LEVEL = 0xEE
STATE_LEVELS = (0x00, 0xF0, 0xFF)  # what the SDK's Recv lets pass
COMMAND_WORDS, STATE_WORDS = 31, 270  # under the checksum

_MODE, _VELOCITY, _COMMAND_CRC = 22, 53, 125
_STATE = {"rpy": 62, "soc": 838, "mode": 885, "position": 895, "velocity": 911, "yaw": 923}
_VERSION, _STATE_CRC = 12, 1083
_REVERSED = bytes(int(f"{byte:08b}"[::-1], 2) for byte in range(256))


class WireError(ValueError):
    """A datagram that is none of a Go1's.

    Args:
        kind: `length`, `head`, `level`, `checksum` or `number`.
        what: What is wrong.
    """

    def __init__(self, kind: str, what: str) -> None:
        self.kind = kind
        super().__init__(what)


@dataclass(frozen=True, kw_only=True)
class HighCommand:
    """What a robot is asked for.

    Args:
        mode: As in `Mode`.
        velocity: v_x [m/s], v_y [m/s], yaw rate [rad/s] in the body frame.
    """

    mode: int
    velocity: Command


@dataclass(frozen=True, kw_only=True)
class HighState:
    """What a robot says of itself.

    Args:
        mode: As in `Mode`.
        battery: State of charge [%].
        velocity: v_x [m/s], v_y [m/s], yaw rate [rad/s] in the body frame.
        odometry: x [m], y [m], yaw [rad] by its own odometry.
        version: Version numbers of hardware and software.
        level: The level flag.
    """

    mode: int
    battery: int
    velocity: Command
    odometry: Pose
    version: tuple[int, int] = (0, 0)
    level: int = 0


def checksum(words: bytes) -> int:
    """Return the CRC-32 of little-endian words, highest bit first (polynomial 0x04c11db7).

    zlib's CRC has the same polynomial with all bits mirrored, and it is compiled.

    Args:
        words: A whole number of 4-byte words.

    Returns:
        In [0, 2^32).

    >>> hex(checksum(bytes(4))), hex(checksum(bytes([1, 0, 0, 0])))
    ('0xc704dd7b', '0xc3c5c0cc')
    """
    swapped = array("I", words)
    swapped.byteswap()
    mirrored = zlib.crc32(swapped.tobytes().translate(_REVERSED)) ^ 0xFFFFFFFF
    return int.from_bytes(mirrored.to_bytes(4, "little").translate(_REVERSED), "big")


def toward_zero(value: float) -> float:
    """Return the nearest float32 that is no larger in magnitude: rounding must not speed up.

    >>> toward_zero(0.1) <= 0.1 and toward_zero(-0.1) >= -0.1
    True
    """
    single = np.float32(value)
    if abs(float(single)) > abs(value):
        single = np.nextafter(single, np.float32(0))
    return float(single)


def encode_command(command: HighCommand, *, level: int = HIGH_LEVEL) -> bytes:
    """Return the datagram of a command.

    Raises:
        ValueError: A velocity that is not finite.
    """
    if not all(map(isfinite, command.velocity)):
        raise ValueError(f"velocity must be finite, not {command.velocity}")
    data = bytearray(COMMAND_BYTES)
    data[0:2], data[2], data[_MODE] = HEAD, level, command.mode
    struct.pack_into("<3f", data, _VELOCITY, *map(toward_zero, command.velocity))
    struct.pack_into("<I", data, _COMMAND_CRC, checksum(bytes(data[: 4 * COMMAND_WORDS])))
    return bytes(data)


def decode_command(data: bytes) -> HighCommand:
    """Read a command as the robot does.

    Raises:
        WireError: Length, head, level flag, checksum or a number is wrong.

    >>> there = encode_command(HighCommand(mode=2, velocity=(0.5, 0.0, -1.0)))
    >>> decode_command(there).velocity
    (0.5, 0.0, -1.0)
    """
    _check(data, COMMAND_BYTES, (HIGH_LEVEL,), COMMAND_WORDS, _COMMAND_CRC)
    velocity = struct.unpack_from("<3f", data, _VELOCITY)
    _finite(velocity)
    return HighCommand(mode=data[_MODE], velocity=velocity)


def encode_state(state: HighState) -> bytes:
    """Return the datagram of a state."""
    data = bytearray(STATE_BYTES)
    x, y, yaw = state.odometry
    data[0:2], data[2], data[_STATE["soc"]] = HEAD, state.level, state.battery
    data[_STATE["mode"]] = state.mode
    struct.pack_into("<2I", data, _VERSION, *state.version)
    struct.pack_into("<3f", data, _STATE["rpy"], 0.0, 0.0, yaw)
    struct.pack_into("<3f", data, _STATE["position"], x, y, 0.28)
    struct.pack_into("<2f", data, _STATE["velocity"], *state.velocity[:2])
    struct.pack_into("<f", data, _STATE["yaw"], state.velocity[2])
    struct.pack_into("<I", data, _STATE_CRC, checksum(bytes(data[: 4 * STATE_WORDS])))
    return bytes(data)


def decode_state(data: bytes) -> HighState:
    """Read a state as the vendor's SDK does.

    Raises:
        WireError: Length, head, level flag, checksum or a number is wrong.

    >>> said = HighState(mode=2, battery=80, velocity=(0.5, 0.0, 0.0), odometry=(1.0, 2.0, 0.5))
    >>> decode_state(encode_state(said)) == said
    True
    """
    _check(data, STATE_BYTES, STATE_LEVELS, STATE_WORDS, _STATE_CRC)
    x, y, _ = struct.unpack_from("<3f", data, _STATE["position"])
    (yaw,) = struct.unpack_from("<f", data, _STATE["rpy"] + 8)
    v_x, v_y = struct.unpack_from("<2f", data, _STATE["velocity"])
    (turn,) = struct.unpack_from("<f", data, _STATE["yaw"])
    _finite((x, y, yaw, v_x, v_y, turn))
    version = struct.unpack_from("<2I", data, _VERSION)
    return HighState(
        mode=data[_STATE["mode"]],
        battery=data[_STATE["soc"]],
        velocity=(v_x, v_y, turn),
        odometry=(x, y, yaw),
        version=version,
        level=data[2],
    )


def _check(data: bytes, size: int, levels: tuple[int, ...], words: int, crc_at: int) -> None:
    if len(data) != size:
        raise WireError("length", f"a datagram of {len(data)} bytes, not {size}")
    if data[0:2] != HEAD:
        raise WireError("head", f"a datagram that begins with {data[0:2].hex()}, not {HEAD.hex()}")
    if data[2] not in levels:
        raise WireError("level", f"level flag {data[2]:#04x}, not one of {[*map(hex, levels)]}")
    (said,) = struct.unpack_from("<I", data, crc_at)
    if (found := checksum(data[: 4 * words])) != said:
        raise WireError("checksum", f"checksum {said:#010x} for contents of {found:#010x}")


def _finite(numbers: tuple[float, ...]) -> None:
    if not all(map(isfinite, numbers)):
        raise WireError("number", f"numbers that are not finite: {numbers}")
