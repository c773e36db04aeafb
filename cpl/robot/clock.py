"""Time: the computer's, which nobody can hurry, and how regular a loop was in it."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

__all__ = ["Clock", "RealClock", "Timing", "boottime", "histogram", "urgent"]


class Clock(Protocol):
    """Something that says how late it is and lets time pass."""

    def now(self) -> float:
        """Return the time [s]; only differences mean anything."""
        ...

    def wait(self, until: float) -> None:
        """Return when it is that late [s], or at once if it is later."""
        ...


def boottime() -> float:
    """Return the time since the computer was started [s], suspended or not.

    Setting the date does not move it. The monotonic clock stands still while a laptop sleeps: an
    order from before would look fresh to it on waking.
    """
    return time.clock_gettime(_CLOCK)


class RealClock:
    """The computer's: nobody can set it, and it goes on in suspend."""

    def now(self) -> float:
        """Return the time [s]."""
        return boottime()

    def wait(self, until: float) -> None:
        """Sleep until then."""
        while (left := until - boottime()) > 0:
            time.sleep(left)


@dataclass(kw_only=True)
class Timing:
    """How regular a loop was, and how long its work took.

    Attributes:
        period_s: What it should take from step to step [s].
        begun_s: When each step began [s].
        policy_s: From a step's beginning until its command was sent [s].
        busy_s: From a step's beginning until its work was done, log and screen included [s].
    """

    period_s: float
    begun_s: list[float] = field(default_factory=list[float])
    policy_s: list[float] = field(default_factory=list[float])
    busy_s: list[float] = field(default_factory=list[float])

    @property
    def error_s(self) -> list[float]:
        """By how much each period was off [s]."""
        return np.abs(np.diff(self.begun_s) - self.period_s).tolist()

    def told(self) -> dict[str, float]:
        """Return the numbers that matter [ms]: 99th percentiles and maxima; NaN without steps."""
        named = {"period_error": self.error_s, "policy": self.policy_s, "loop": self.busy_s}
        numbers: dict[str, float] = {"steps": len(self.begun_s)}
        for name, seconds in named.items():
            known = bool(len(seconds))
            numbers[f"{name}_p99_ms"] = _ms(np.quantile(seconds, 0.99)) if known else np.nan
            numbers[f"{name}_max_ms"] = _ms(max(seconds)) if known else np.nan
        return numbers


def histogram(seconds: Sequence[float], edges_ms: Sequence[float], width: int = 40) -> str:
    """Return a histogram in plain text.

    Args:
        seconds: What was measured [s].
        edges_ms: Upper edges of the bins [ms], growing; what is above the last one has its own.
        width: Of the longest bar [characters].

    >>> print(histogram([0.0004, 0.0006, 0.0007, 0.02], (0.5, 1, 5), width=4))
       < 0.5 ms       1 ##
         < 1 ms       2 ####
         < 5 ms       0
        >= 5 ms       1 ##
    """
    counts = np.bincount(
        np.searchsorted(edges_ms, 1e3 * np.asarray(seconds), side="right"),
        minlength=len(edges_ms) + 1,
    )
    names = [*(f"< {edge:g} ms" for edge in edges_ms), f">= {edges_ms[-1]:g} ms"]
    counts = counts[: int(np.flatnonzero(counts).max(initial=0)) + 1]  # no empty tail
    bars = ["#" * int(np.ceil(width * count / max(counts.max(), 1))) for count in counts]
    lines = zip(names, counts, bars, strict=False)
    return "\n".join(f"{name:>11}{count:8d} {bar}".rstrip() for name, count, bar in lines)


@contextmanager
def urgent(priority: int = 10) -> Iterator[bool]:
    """Run before ordinary processes for a while, if the scheduler agrees; give whether it does.

    Children stay ordinary. Without the right to ask, everything works, less regularly.

    Args:
        priority: Among urgent processes; policy and watchdog go before emulators.
    """
    try:
        before = os.sched_getscheduler(0), os.sched_getparam(0)
        os.sched_setscheduler(0, os.SCHED_RR | os.SCHED_RESET_ON_FORK, os.sched_param(priority))
    except (AttributeError, OSError):  # not Linux, or not allowed
        yield False
        return
    try:
        yield True
    finally:
        os.sched_setscheduler(0, *before)


def _ms(seconds: float) -> float:
    return round(float(1e3 * seconds), 3)


_CLOCK = getattr(time, "CLOCK_BOOTTIME", time.CLOCK_MONOTONIC)  # the first is Linux's
