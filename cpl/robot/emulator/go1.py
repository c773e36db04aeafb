"""The robot's UDP endpoint: commands in, states out, checked as the robot checks them."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field

from cpl.robot.emulator.faults import Faults
from cpl.robot.interfaces import ZERO, Command, Mode, Pose
from cpl.robot.ports import Address, drain_from, receiver, send
from cpl.robot.wire import (
    STATE_BYTES,
    HighCommand,
    HighState,
    WireError,
    decode_command,
    encode_state,
)

__all__ = ["Endpoint", "Seen"]

RESTART_MPS = 0.15  # [m/s] after mode 0 a slower command does not start the gait again
DRIFT_MPS = 1.0  # [m/s] of odometry that drifts
RELEASE_S = 2.0  # [s] of silence before the robot listens to somebody else


@dataclass(frozen=True, kw_only=True)
class Seen:
    """A command that reached the robot: what the emulator's black box keeps."""

    t_s: float
    mode: int
    velocity: Command


@dataclass(kw_only=True)
class Endpoint:
    """A Go1's high-level endpoint on a loopback port.

    Like the robot it has no time-out of its own: the last command holds until the next one.

    Attributes:
        port: Where it listens; 0 for any that is free.
        faults: What goes wrong.
        far: Whether the cable lies between the robot and whoever speaks to it.
        battery: State of charge [%].
        refused: Datagrams that were no command, by what was wrong with them.
        seen: Every command that was obeyed.
    """

    port: int = 0
    faults: Faults = field(default_factory=Faults)
    far: bool = True
    battery: int = 85
    refused: Counter[str] = field(default_factory=Counter[str])
    seen: list[Seen] = field(default_factory=list[Seen])

    def __post_init__(self) -> None:
        self._socket = receiver(self.port)
        cable = self.faults if self.far else Faults()
        self._in, self._out = cable.cable(), cable.cable()
        self._client: Address | None = None
        self._heard_s = float("-inf")
        self._command = HighCommand(mode=Mode.STAND, velocity=ZERO)
        self._idle, self._owed = False, 0
        self._kept: Pose | None = None
        self.odometry: Pose = ZERO
        self.velocity: Command = ZERO

    @property
    def address(self) -> Address:
        """Where it listens."""
        return self._socket.getsockname()

    @property
    def drive(self) -> Command:
        """What the body is asked for: v_x [m/s], v_y [m/s], yaw rate [rad/s]."""
        if self._command.mode != Mode.WALK:
            return ZERO
        v_x, v_y, turn = self._command.velocity
        slow = max(abs(v_x), abs(v_y)) < RESTART_MPS
        return (0.0, 0.0, turn) if self._idle and slow else self._command.velocity

    def serve(self, now: float) -> None:
        """Take the commands that came and answer each."""
        self.take(now)
        self.answer(now)

    def take(self, now: float) -> None:
        """Take the commands that came."""
        for data, sender in drain_from(self._socket):
            if self._client not in (None, sender) and now - self._heard_s < RELEASE_S:
                self.refused["stranger"] += 1
                continue
            self._client = sender
            self._in.put(data, now)
        for data in self._in.take(now):
            self._obey(data, now)
            self._owed += 1

    def answer(self, now: float) -> None:
        """Answer each command that was taken, and send what was held up."""
        for _ in range(self._owed):
            self._out.put(self._state(now), now)
        self._owed = 0
        for data in self._out.take(now):
            if self._client is not None:
                send(self._socket, data, self._client)

    def close(self) -> None:
        """Let the port go."""
        self._socket.close()

    def _obey(self, data: bytes, now: float) -> None:
        try:
            command = decode_command(data)
        except WireError as error:
            self.refused[error.kind] += 1
            return
        self._heard_s = now
        if self.faults.active("damped", now):
            command = HighCommand(mode=Mode.DAMPED, velocity=ZERO)
        self._idle = command.mode == Mode.IDLE or (
            self._idle and max(map(abs, command.velocity[:2])) < RESTART_MPS
        )
        self._command = command
        self.seen.append(Seen(t_s=now, mode=command.mode, velocity=command.velocity))

    def _walked(self, now: float) -> Pose:
        """Return what the robot makes of its own steps."""
        if self.faults.active("odometry_frozen", now):
            self._kept = self._kept or self.odometry
            return self._kept
        self._kept = None
        x, y, yaw = self.odometry
        return x + DRIFT_MPS * (self.faults.since("odometry_drifts", now) or 0.0), y, yaw

    def _state(self, now: float) -> bytes:
        if self.faults.active("babble", now):
            return self.faults.noise(STATE_BYTES)
        data = encode_state(
            HighState(
                mode=self._command.mode,
                battery=5 if self.faults.active("battery", now) else self.battery,
                velocity=self.velocity,
                odometry=self._walked(now),
                version=(3, 8),
            )
        )
        return data[:-8] if self.faults.active("firmware", now) else data
