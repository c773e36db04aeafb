"""A cable that can be cut: datagrams between two loopback ports, with faults on the way."""

from __future__ import annotations

import select
import threading

from cpl.robot.clock import boottime
from cpl.robot.emulator.faults import Fault, Faults
from cpl.robot.ports import Address, drain_from, receiver, send

__all__ = ["Relay"]


class Relay:
    """Carry datagrams to a port and the answers back to whoever sent last.

    Args:
        to: Where they go.
    """

    def __init__(self, to: Address) -> None:
        self._to, self._front, self._back = to, receiver(), receiver()
        self._faults = Faults()
        self._there, self._return = self._faults.cable(), self._faults.cable()
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._carry, daemon=True)
        self._thread.start()

    @property
    def address(self) -> Address:
        """Where to send to."""
        return self._front.getsockname()

    def suffer(self, name: str, seconds: float = 1e9) -> None:
        """Let a fault of the cable begin now.

        Args:
            name: One of `dropped`, `late`, `duplicated`, `corrupted`, `cut`.
            seconds: For how long [s].
        """
        now = boottime()
        self._faults.planned.append(Fault(name=name, start_s=now, stop_s=now + seconds))

    def close(self) -> None:
        """Let the ports go."""
        self._stop.set()
        self._thread.join()
        self._front.close()
        self._back.close()

    def _carry(self) -> None:
        client: Address | None = None
        while not self._stop.is_set():
            select.select([self._front, self._back], [], [], 0.005)
            now = boottime()
            for data, client in drain_from(self._front):  # noqa: B007 - the last one counts
                self._there.put(data, now)
            for data, _ in drain_from(self._back):
                self._return.put(data, now)
            for data in self._there.take(now):
                send(self._back, data, self._to)
            for data in self._return.take(now):
                if client is not None:
                    send(self._front, data, client)
