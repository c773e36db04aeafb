"""A stranger on the same computer: he sees every port, hears what is said, and has no key."""

from __future__ import annotations

import socket
from math import cos, sin

from cpl.robot import bridge
from cpl.robot.emulator.faults import Faults
from cpl.robot.interfaces import Mode, Pose
from cpl.robot.packets import Order, encode
from cpl.robot.ports import Address, send
from cpl.robot.seal import new_key
from cpl.robot.t265 import Mount, camera_pose

__all__ = ["Stranger"]

FLOOD = 10  # datagrams in a hundredth of a second
LARGEST = 1400  # [byte]


class Stranger:
    """Do what `STRANGERS` names, from a port of his own.

    Args:
        faults: When he does what.
        watchdog: Where orders go.
        camera: Where poses go.
        start: Where he would have the robot believe to be.
    """

    def __init__(self, faults: Faults, watchdog: Address, camera: Address, start: Pose) -> None:
        self.heard: list[bytes] = []
        """What he overheard of the policy's orders."""
        self._faults, self._watchdog, self._camera = faults, watchdog, camera
        self._start, self._key, self._number = start, new_key(), 2**31
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)

    def act(self, now: float) -> None:
        """Do it, if it is time to [s]."""
        self._number += 1
        if self._faults.active("orders_forged", now):
            send(self._socket, self._order(now), self._watchdog)
        if self._faults.active("orders_replayed", now):
            for data in self.heard[-3:]:
                send(self._socket, data, self._watchdog)
        if self._faults.active("orders_flood", now):
            for _ in range(FLOOD):
                send(self._socket, self._faults.noise(LARGEST), self._watchdog)
        if self._faults.active("poses_forged", now):
            send(self._socket, self._pose(now), self._camera)

    def close(self) -> None:
        """Go."""
        self._socket.close()

    def _order(self, now: float) -> bytes:
        order = Order(
            run=1,
            hello=1,
            number=self._number,
            heard_s=now,
            mode=Mode.WALK,
            command=(-1.0, 0.0, 0.0),
        )
        return encode(order, self._key)

    def _pose(self, now: float) -> bytes:
        x, y, yaw = self._start
        turn = (0.0, 0.0, sin(yaw / 2), cos(yaw / 2))
        still = camera_pose(self._number, now, (x, y, 0.35), turn, (0.0, 0.0, 0.0), 3, Mount())
        return bridge.encode(still, bridge.Stamp(1, 1, now), self._key)
