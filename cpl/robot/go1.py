"""Speak to a Go1, through its vendor's SDK or, without it, through `cpl.robot.wire`.

The vendor's library is asked for velocities alone; its `Safety` class acts in low-level control
only and is no help here. Either way what leaves is clamped, finite and rounded toward zero.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, Protocol

from cpl.optional import look
from cpl.robot.clock import boottime
from cpl.robot.envelope import Envelope, clamp
from cpl.robot.interfaces import ZERO, BaseState, Command, Mode, RobotError
from cpl.robot.ports import Address, drain, receiver, send
from cpl.robot.wire import (
    HIGH_LEVEL,
    HighCommand,
    HighState,
    WireError,
    decode_state,
    encode_command,
    toward_zero,
)

__all__ = ["GO1", "LIBRARIES", "LOCAL_PORT", "Go1Base", "vendor_version"]

GO1: Address = ("192.168.123.161", 8082)  # the motion controller on the robot's own network
LOCAL_PORT = 8080  # what the vendor's examples send from
LIBRARIES = ("auto", "sdk", "wire")
PACKAGE, SDK = "unitree-legged-sdk", "unitree_legged_sdk"
BURST = 200  # states taken at once


class Go1Base:
    """A Go1, or something that answers like one.

    Args:
        to: Its address.
        library: `sdk` for the vendor's, `wire` for our own, `auto` for the vendor's if it is here.
        local_port: Where to send from; 0 for any that is free.
        envelope: No larger velocity ever leaves.
        clock: The time [s].

    Raises:
        ValueError: No such library.
        RobotError: The vendor's library is asked for and not here.
    """

    def __init__(
        self,
        to: Address,
        *,
        library: str = "auto",
        local_port: int = 0,
        envelope: Envelope | None = None,
        clock: Callable[[], float] = boottime,
    ) -> None:
        if library not in LIBRARIES:
            raise ValueError(f"library must be one of {', '.join(LIBRARIES)}, not {library!r}")
        vendor = (
            None if library == "wire" else vendor_version()
        )  # to look takes a fifth of a second
        if library == "sdk" and vendor is None:
            raise RobotError(str(look(SDK)))
        use_vendor = vendor is not None and library != "wire"
        self.library = f"{PACKAGE} {vendor}" if use_vendor else "cpl.robot.wire"
        self._envelope, self._clock = envelope or Envelope(), clock
        self._link: _Link = (_VendorLink if use_vendor else _WireLink)(to, local_port)
        self._state: HighState | None = None
        self._received_s = 0.0

    @property
    def refused(self) -> int:
        """States that came damaged and were not used."""
        return self._link.refused

    @property
    def unsent(self) -> int:
        """Commands that the operating system did not take: the link is away."""
        return self._link.unsent

    def send(self, mode: Mode, command: Command = ZERO) -> None:
        """Ask for a mode, and in `Mode.WALK` for a velocity, clamped once more."""
        wanted = clamp(command, self._envelope) if mode is Mode.WALK else ZERO
        v_x, v_y, turn = (toward_zero(each) for each in wanted)
        self._link.send(HighCommand(mode=mode, velocity=(v_x, v_y, turn)))

    def state(self) -> BaseState | None:
        """Return the newest state; None before there is one."""
        fresh = self._link.newest()
        if fresh is not None:
            self._state, self._received_s = fresh, self._clock()
        if self._state is None:
            return None
        return BaseState(
            mode=self._state.mode,
            battery=self._state.battery,
            velocity=self._state.velocity,
            odometry=self._state.odometry,
            version=self._state.version,
            received_s=self._received_s,
        )

    def close(self) -> None:
        """Let the port go."""
        self._link.close()


def vendor_version() -> str | None:
    """Return the version of the vendor's SDK; None if it is not here or cannot be loaded."""
    found = look(SDK)
    return found.version if found else None


class _Link(Protocol):
    refused: int
    unsent: int

    def __init__(self, to: Address, local_port: int) -> None: ...
    def send(self, command: HighCommand) -> None: ...
    def newest(self) -> HighState | None: ...
    def close(self) -> None: ...


class _WireLink:
    """Our own datagrams."""

    def __init__(self, to: Address, local_port: int) -> None:
        self.refused = self.unsent = 0
        self._socket = receiver(local_port, "")
        self._to, self._connected = to, False

    def send(self, command: HighCommand) -> None:
        self.unsent += not (self._connect() and send(self._socket, encode_command(command)))

    def _connect(self) -> bool:
        """Hear the robot alone; without a route, try again with the next command."""
        if not self._connected:
            with suppress(OSError):
                self._socket.connect(self._to)
                self._connected = True
        return self._connected

    def newest(self) -> HighState | None:
        newest = None
        if not self._connect():
            return None
        for data in drain(self._socket):
            try:
                newest = decode_state(data)
            except WireError:
                self.refused += 1
        return newest

    def close(self) -> None:
        self._socket.close()


class _VendorLink:
    """unitree-legged-sdk. Its Recv takes one datagram a call and says what was wrong with it."""

    def __init__(self, to: Address, local_port: int) -> None:
        from unitree_legged_sdk import robot_interface as sdk

        self.refused = self.unsent = 0
        with _silence():
            self._udp: Any = sdk.UDP(HIGH_LEVEL, local_port, *to)
        self._command, self._state = sdk.HighCmd(), sdk.HighState()
        self._udp.InitCmdData(self._command)

    def send(self, command: HighCommand) -> None:
        self._command.mode = command.mode
        self._command.velocity = list(command.velocity[:2])
        self._command.yawSpeed = command.velocity[2]
        self._udp.SetSend(self._command)
        self.unsent += self._udp.Send() < 0

    def newest(self) -> HighState | None:
        """Take what is there. Recv says -1 both for "nothing" and for a wrong head."""
        fresh = False
        for _ in range(BURST):
            answer = self._udp.Recv()
            fresh = fresh or answer == 0
            if answer == -1:
                break
            self.refused += answer != 0
        if not fresh:
            return None
        state = self._state
        self._udp.GetRecv(state)
        x, y, _ = state.position
        return HighState(
            mode=state.mode,
            battery=state.bms.SOC,
            velocity=(state.velocity[0], state.velocity[1], state.yawSpeed),
            odometry=(x, y, state.imu.rpy[2]),
            version=(state.version[0], state.version[1]),
            level=state.levelFlag,
        )

    def close(self) -> None:
        with _silence():
            self._udp = None  # its destructor closes the socket


@contextmanager
def _silence() -> Iterator[None]:
    """Keep what the vendor's library prints out of our own output."""
    sys.stdout.flush()
    kept = os.dup(1)
    try:
        with Path(os.devnull).open("wb") as nowhere:
            os.dup2(nowhere.fileno(), 1)
            yield
    finally:
        os.dup2(kept, 1)
        os.close(kept)
