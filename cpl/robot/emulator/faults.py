"""What can go wrong, by name: between two times, on the cable, in the camera, in the robot.

The faults of the cable act on datagrams, whatever is in them; those of camera and robot on what
they say. Policy, disk, clock and operator are not emulated here: they are on the other side.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from math import isfinite
from typing import Generic, TypeVar

from cpl.rng import stream

__all__ = ["FAULTS", "STRANGERS", "Channel", "Fault", "Faults"]

LATE_S = 0.4  # [s] how late a late datagram is
QUEUE_S = 1.0  # [s] that a pose waits in a queue which was empty before
DRAG = 0.4  # [s/s] by which a queue grows
AGAIN_S = 1.0  # [s] after which a datagram comes again
MIXED_S = 0.05  # [s] within which datagrams change places
AWAY_S, FLAP_S = 0.3, 1.0  # [s] a cable with a loose contact: away for so long, every so often
DROPPED = 0.5  # [-] share of datagrams that are lost

FAULTS: dict[str, str] = {
    "dropped": "half of the datagrams on the cable are lost",
    "late": "datagrams on the cable take 0.4 s",
    "duplicated": "each datagram on the cable comes twice",
    "replayed": "each datagram on the cable comes again 1 s later",
    "reordered": "datagrams on the cable change places within 0.05 s",
    "corrupted": "one byte of each datagram on the cable is changed",
    "flapping": "the cable is away for 0.3 s in every second",
    "cut": "the cable is cut: nothing goes either way",
    "firmware": "the robot answers in datagrams of another version",
    "babble": "the robot answers with random bytes",
    "battery": "the battery is at 5 %",
    "damped": "somebody pressed the remote's emergency stop",
    "odometry_drifts": "the robot's odometry drifts by 1 m/s",
    "odometry_frozen": "the robot's odometry stands still",
    "frozen": "the camera repeats one pose for ever",
    "jump": "the pose is 1.5 m off",
    "lost": "the camera was unplugged",
    "failed": "the tracker's confidence is 0",
    "storm": "a SLAM error in every step",
    "camera_late": "pose packets take 0.4 s",
    "camera_queue": "poses wait for 1 s before the bridge has them, as regularly as ever",
    "camera_drags": "poses wait longer and longer, by 0.4 s in each second",
    "camera_fast": "the camera's clock is 10 % fast",
    "camera_set": "the camera's clock is set forward by 2 s",
    "camera_replugged": "the camera was plugged in again: its origin is a new one",
    "camera_moved": "the camera's origin is a new one, and nobody says so",
    "camera_duplicated": "each pose packet comes twice",
    "camera_replayed": "each pose packet comes again 1 s later",
    "camera_reordered": "pose packets change places within 0.05 s",
    "camera_corrupted": "one byte of each pose packet is changed",
    "outside": "the robot believes to be 5 m from where it is",
}
"""What each fault does."""

STRANGERS: dict[str, str] = {
    "orders_forged": "a stranger sends orders to walk, sealed with a key of his own",
    "orders_replayed": "a stranger repeats the policy's orders from another port",
    "orders_flood": "a stranger sends a thousand datagrams of noise in each second",
    "poses_forged": "a stranger sends poses that stand still, sealed with a key of his own",
}
"""What a stranger on the same computer may do, who has everything but the key."""

CABLE = ("dropped", "late", "duplicated", "replayed", "reordered", "corrupted", "flapping", "cut")
CAMERA_PACKETS = {
    "late": "camera_late",
    "corrupted": "camera_corrupted",
    "cut": "lost",
    "duplicated": "camera_duplicated",
    "replayed": "camera_replayed",
    "reordered": "camera_reordered",
}
CAMERA_QUEUE = {"queue": "camera_queue", "drags": "camera_drags"}


@dataclass(frozen=True, kw_only=True)
class Fault:
    """A fault and when it is there.

    Args:
        name: One of `FAULTS` or `STRANGERS`.
        start_s: From when on, in the emulation's time [s].
        stop_s: Until when [s].
    """

    name: str
    start_s: float = 0.0
    stop_s: float = float("inf")

    def __post_init__(self) -> None:
        if self.name not in FAULTS | STRANGERS:
            known = ", ".join(FAULTS | STRANGERS)
            raise ValueError(f"name must be one of {known}, not {self.name!r}")
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
        return self.since(name, now) is not None

    def since(self, name: str, now: float) -> float | None:
        """Return for how long a fault has been there [s]; None if it is not."""
        found = [f for f in self.planned if f.name == name and f.start_s <= now < f.stop_s]
        return now - found[0].start_s if found else None

    def begun(self, name: str, now: float) -> bool:
        """Whether a fault has begun, though it may be over: what it did remains."""
        return any(f.name == name and f.start_s <= now for f in self.planned)

    def cable(self) -> Channel[bytes]:
        """Return one direction of the cable."""
        return Channel(self, {name: name for name in CABLE})

    def camera(self) -> Channel[bytes]:
        """Return the way of pose packets from the bridge."""
        return Channel(self, CAMERA_PACKETS)

    def queue(self) -> Channel:
        """Return the way of poses to the bridge."""
        return Channel(self, CAMERA_QUEUE)

    def kinds(self, names: dict[str, str], now: float) -> dict[str, float]:
        """Return what happens to a datagram now, and for how long it has [s]."""
        found = {kind: self.since(name, now) for kind, name in names.items()}
        return {kind: since for kind, since in found.items() if since is not None}

    def lost(self) -> bool:
        """Draw whether a datagram is lost."""
        return bool(self._rng.random() < DROPPED)

    def wait(self) -> float:
        """Draw how long a datagram lets others pass [s]."""
        return MIXED_S * float(self._rng.random())

    def damaged(self, data: bytes) -> bytes:
        """Return the datagram with one byte changed."""
        at, change = int(self._rng.integers(len(data))), int(self._rng.integers(1, 256))
        return data[:at] + bytes([data[at] ^ change]) + data[at + 1 :]

    def noise(self, size: int) -> bytes:
        """Return random bytes."""
        return self._rng.bytes(size)


T = TypeVar("T")


class Channel(Generic[T]):
    """One direction of a way: what is put in comes out, or not, or later, or changed."""

    def __init__(self, faults: Faults, names: dict[str, str]) -> None:
        self._faults, self._names = faults, names
        self._waiting: list[tuple[float, T]] = []

    def put(self, item: T, now: float) -> None:
        """Let something in at a time [s]."""
        faults = self._faults
        kinds = faults.kinds(self._names, now)
        away = "flapping" in kinds and kinds["flapping"] % FLAP_S < AWAY_S
        if "cut" in kinds or away or ("dropped" in kinds and faults.lost()):
            return
        if "corrupted" in kinds and isinstance(item, bytes):
            item = faults.damaged(item)
        due = now
        due += LATE_S if "late" in kinds else 0.0
        due += QUEUE_S if "queue" in kinds else 0.0
        due += DRAG * kinds.get("drags", 0.0)
        due += faults.wait() if "reordered" in kinds else 0.0
        self._waiting += [(due, item)] * (2 if "duplicated" in kinds else 1)
        self._waiting += [(due + AGAIN_S, item)] * ("replayed" in kinds)

    def take(self, now: float) -> list[T]:
        """Return what comes out at a time [s]."""
        out = [each for each in self._waiting if each[0] <= now]
        self._waiting = [each for each in self._waiting if each[0] > now]
        return [item for _, item in sorted(out, key=lambda each: each[0])]
