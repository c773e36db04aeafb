"""What can go wrong, by name: between two times, on the cable, in the camera, in the robot.

The faults of the cable act on datagrams, whatever is in them; those of camera and robot on what
they say. Policy, disk, clock and operator are not emulated here: they are on the other side.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from math import isfinite

from cpl.rng import stream

__all__ = ["FAULTS", "Fault", "Faults"]

LATE_S = 0.4  # [s] how late a late datagram is
DROPPED = 0.5  # [-] share of datagrams that are lost

FAULTS: dict[str, str] = {
    "dropped": "half of the datagrams to and from the robot are lost",
    "late": "datagrams to and from the robot take 0.4 s",
    "duplicated": "each datagram to and from the robot comes twice",
    "corrupted": "one byte of each datagram to and from the robot is changed",
    "cut": "the cable to the robot is cut: nothing goes either way",
    "firmware": "the robot answers in datagrams of another version",
    "babble": "the robot answers with random bytes",
    "battery": "the battery is at 5 %",
    "damped": "somebody pressed the remote's emergency stop",
    "frozen": "the camera repeats one pose for ever",
    "jump": "the pose is 1.5 m off",
    "lost": "the camera was unplugged",
    "failed": "the tracker's confidence is 0",
    "storm": "a SLAM error in every step",
    "camera_late": "poses take 0.4 s",
    "camera_corrupted": "one byte of each pose packet is changed",
    "outside": "the robot believes to be 5 m from where it is",
}
"""What each fault does."""

CABLE = ("dropped", "late", "duplicated", "corrupted", "cut")
CAMERA_PACKETS = {"camera_late": "late", "camera_corrupted": "corrupted", "lost": "cut"}


@dataclass(frozen=True, kw_only=True)
class Fault:
    """A fault and when it is there.

    Args:
        name: One of `FAULTS`.
        start_s: From when on, in the emulation's time [s].
        stop_s: Until when [s].
    """

    name: str
    start_s: float = 0.0
    stop_s: float = float("inf")

    def __post_init__(self) -> None:
        if self.name not in FAULTS:
            raise ValueError(f"name must be one of {', '.join(FAULTS)}, not {self.name!r}")
        if not (isfinite(self.start_s) and self.start_s < self.stop_s):
            raise ValueError(f"start_s must be before stop_s, not {self.start_s} / {self.stop_s}")


class Faults:
    """The faults of one emulation, and its lossy channels.

    Args:
        planned: What goes wrong and when.
        seed: Draws which datagrams are lost and which bytes are changed.
    """

    def __init__(self, planned: Iterable[Fault] = (), seed: int = 0) -> None:
        self.planned = list(planned)
        self._rng = stream(seed, "robot", "faults")

    def active(self, name: str, now: float) -> bool:
        """Whether a fault is there at a time [s]."""
        return any(f.name == name and f.start_s <= now < f.stop_s for f in self.planned)

    def channel(self, camera: bool = False) -> Channel:
        """Return a new channel that these faults act on."""
        names = CAMERA_PACKETS if camera else {name: name for name in CABLE}
        return Channel(self, {kind: name for name, kind in names.items()})

    def kinds(self, names: dict[str, str], now: float) -> set[str]:
        """Return what happens to a datagram now."""
        return {kind for kind, name in names.items() if self.active(name, now)}

    def lost(self) -> bool:
        """Draw whether a datagram is lost."""
        return bool(self._rng.random() < DROPPED)

    def damaged(self, data: bytes) -> bytes:
        """Return the datagram with one byte changed."""
        at, change = int(self._rng.integers(len(data))), int(self._rng.integers(1, 256))
        return data[:at] + bytes([data[at] ^ change]) + data[at + 1 :]

    def noise(self, size: int) -> bytes:
        """Return random bytes."""
        return self._rng.bytes(size)


class Channel:
    """One direction of a cable: what is put in comes out, or not, or later, or changed."""

    def __init__(self, faults: Faults, names: dict[str, str]) -> None:
        self._faults, self._names = faults, names
        self._waiting: list[tuple[float, bytes]] = []

    def put(self, data: bytes, now: float) -> None:
        """Let a datagram in at a time [s]."""
        kinds = self._faults.kinds(self._names, now)
        if "cut" in kinds or ("dropped" in kinds and self._faults.lost()):
            return
        data = self._faults.damaged(data) if "corrupted" in kinds else data
        due = now + (LATE_S if "late" in kinds else 0.0)
        self._waiting += [(due, data)] * (2 if "duplicated" in kinds else 1)

    def take(self, now: float) -> list[bytes]:
        """Return what comes out at a time [s]."""
        out = [data for due, data in self._waiting if due <= now]
        self._waiting = [(due, data) for due, data in self._waiting if due > now]
        return out
