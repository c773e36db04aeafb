"""How old is a pose? As old as its camera says, not as old as its packet.

The camera stamps a pose with its own clock, the bridge stamps the packet with the computer's. What
the second is ahead of the first changes only by the way that the pose took; its least value so far
is the way at its fastest. What a pose took longer than that, it is late. So a queue that fills up
between camera and bridge shows, though packets come as regularly as ever.

A quartz drifts by some 50 millionths, and that much the least value may rise again. A clock that is
set, drifts more, or starts anew is a fault: nothing can be said of an age then.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

__all__ = ["CameraClock", "hear"]

CREEP = 2e-4  # [s/s] drift that is allowed for
SET_S = 0.05  # [s] by which a settled least way may still fall; more is a clock that was set


@dataclass(frozen=True, kw_only=True)
class CameraClock:
    """What is known of a camera's clock.

    Args:
        least_s: The least that the computer's clock was ahead of the camera's [s]; None at first.
        device_s: The camera's time of the last pose [s].
        sent_s: The computer's time of the last packet [s].
        settled_s: `least_s` when the run began [s]; None before.
        late_s: By how much the last pose was late [s].
        fault: What is wrong with the clock; empty if nothing is.
    """

    least_s: float | None = None
    device_s: float = float("-inf")
    sent_s: float = float("-inf")
    settled_s: float | None = None
    late_s: float = 0.0
    fault: str = ""

    @property
    def taken_s(self) -> float:
        """When the last pose was taken, by the computer's clock [s]."""
        return self.sent_s - self.late_s

    def settled(self) -> CameraClock:
        """Return this clock when a run begins: from now on its least way is known."""
        return replace(self, settled_s=self.least_s)


def hear(clock: CameraClock, device_s: float, sent_s: float) -> CameraClock:
    """Return what is known after one more pose, numbered after the last.

    Args:
        clock: What was known.
        device_s: The camera's time [s].
        sent_s: The computer's time when the bridge had it [s].

    >>> clock = CameraClock()
    >>> for k in range(3):
    ...     clock = hear(clock, 100 + 0.1 * k, 5.02 + 0.1 * k)
    >>> round(hear(clock, 100.3, 5.72).late_s, 3), round(hear(clock, 100.3, 5.72).taken_s, 3)
    (0.4, 5.32)
    """
    ahead = sent_s - device_s
    fault = clock.fault
    if clock.least_s is None:
        least = ahead
    else:
        least = min(ahead, clock.least_s + CREEP * max(0.0, sent_s - clock.sent_s))
        if device_s < clock.device_s:
            fault = fault or "the camera's clock ran backwards"
    if clock.settled_s is not None and least < clock.settled_s - SET_S:
        fault = fault or "the camera's clock was set, or drifts"
    return replace(
        clock,
        least_s=least,
        device_s=device_s,
        sent_s=sent_s,
        late_s=ahead - least,
        fault=fault,
    )
