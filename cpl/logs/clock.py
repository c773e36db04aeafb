"""When was each row recorded? Stamps as a machine's clock wrote them, put into one order of time.

A clock can be wrong in ways that a row cannot: it starts at 0 or at boot time until the network
sets it, it is set back while recording, one stamp of many runs ahead. Sorting by such stamps puts
the second half of a run before the first; dropping what is not later than the row before lets one
wrong stamp take all good ones after it. So rows stay in the order of the file, single strays are
dropped, and where the clock itself was set, time goes on and the break is named.
"""

from __future__ import annotations

from bisect import bisect_left
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

__all__ = ["LAST_NS", "Clock", "ordered"]

NS = 1_000_000_000
LAST_NS = 1 << 62  # [ns] the year 2116: a stamp beyond is no time
STRAYS = 4  # [rows] in a row that are taken for strays, not for a clock that was set
A_DAY = 86_400 * NS
FAR_NS = 100 * A_DAY  # [ns] no recording pauses that long: the clock was set
Stamps = NDArray[np.int64]


@dataclass(kw_only=True)
class Clock:
    """What was made of a run's stamps.

    Attributes:
        kept: Which rows have a time, as places in the stamps.
        time_ns: Their times [ns]; those of the first stretch, or of the first that tells a date,
            are the stamps themselves.
        still: Rows whose stamp is that of the row before.
        strays: Rows whose stamp lies outside the order of all others.
        sets: Where the clock was set: first row after it, and by how much [ns].
    """

    kept: NDArray[np.intp]
    time_ns: Stamps
    still: NDArray[np.intp]
    strays: NDArray[np.intp]
    sets: list[tuple[int, int]] = field(default_factory=list)


def ordered(stamps: Stamps) -> Clock:
    """Put stamps into one order of time.

    Args:
        stamps: Stamps in the order of the file [ns], shape (T,).

    Returns:
        Which rows are kept, and their times, which grow.

    One stamp runs ahead, and later the clock is set back by 20:

    >>> clock = ordered(np.array([10, 11, 90, 12, 13, 14, 15, 16, 17, 18, -2, -1, 0, 1, 2, 3]))
    >>> clock.strays.tolist(), clock.sets
    ([2], [(10, -20)])
    >>> clock.time_ns.tolist()
    [10, 11, 12, 13, 14, 15, 16, 17, 18, 20, 21, 22, 23, 24, 25]
    """
    rows = np.arange(len(stamps))
    same = np.zeros(len(stamps), dtype=bool)
    same[1:] = stamps[1:] == stamps[:-1]
    still, rows = rows[same], rows[~same]
    rows, strays = _without_strays(stamps, rows)
    time = stamps[rows].copy()
    sets: list[tuple[int, int]] = []
    if len(time) > 1:
        time, sets = _going_on(time, rows)
    return Clock(kept=rows, time_ns=time, still=still, strays=strays, sets=sets)


def _without_strays(
    stamps: Stamps, rows: NDArray[np.intp]
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Take out rows that lie outside the longest growing order, where they are few in a row."""
    out = np.zeros(len(rows), dtype=bool)
    if (np.diff(stamps[rows]) < 0).any():
        out = ~_growing(stamps[rows])
        out &= _run_lengths(out) <= STRAYS
    left = rows[~out]
    if len(left) > 2 * STRAYS:  # a few at either end, years away from all others
        far = np.flatnonzero(np.abs(np.diff(stamps[left])) > FAR_NS) + 1
        head = max((int(cut) for cut in far if cut <= STRAYS), default=0)
        tail = min((int(cut) for cut in far if cut >= len(left) - STRAYS), default=len(left))
        left = left[head:tail]
    kept = np.isin(rows, left, assume_unique=True)
    return left, rows[~kept]


def _growing(stamps: Stamps) -> NDArray[np.bool]:
    """Return which stamps belong to a longest strictly growing subsequence (patience sorting)."""
    ends: list[int] = []  # the least stamp that ends a growing sequence of each length
    places: list[int] = []
    before = np.full(len(stamps), -1, dtype=np.int64)
    for place, stamp in enumerate(stamps.tolist()):
        length = bisect_left(ends, stamp)
        if length == len(ends):
            ends.append(stamp)
            places.append(place)
        else:
            ends[length], places[length] = stamp, place
        before[place] = places[length - 1] if length else -1
    belongs = np.zeros(len(stamps), dtype=bool)
    place = places[-1]
    while place >= 0:
        belongs[place] = True
        place = int(before[place])
    return belongs


def _run_lengths(flags: NDArray[np.bool]) -> NDArray[np.intp]:
    """Return for each flag that is set how many are set around it, itself included; else 0."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(np.int8)))
    lengths = np.zeros(len(flags), dtype=np.intp)
    for begin, end in edges.reshape(-1, 2):
        lengths[begin:end] = end - begin
    return lengths


def _going_on(time: Stamps, rows: NDArray[np.intp]) -> tuple[Stamps, list[tuple[int, int]]]:
    """Let time go on where the clock was set: two usual steps later, which is a gap to readers."""
    steps = np.diff(time)
    cuts = np.flatnonzero((steps <= 0) | (steps > FAR_NS)) + 1
    if not len(cuts):
        return time, []
    usual = steps[(steps > 0) & (steps <= FAR_NS)]
    pause = 2 * max(1, int(np.median(usual))) if len(usual) else NS
    sets = [(int(rows[cut]), int(steps[cut - 1])) for cut in cuts]
    shift = np.zeros(len(time), dtype=np.int64)
    shift[cuts] = pause - steps[cuts - 1]
    shift = np.cumsum(shift)
    moved = time + shift
    begins = [0, *cuts.tolist()]
    dated = next((at for at in begins if time[at] > FAR_NS), 0)
    return moved - shift[dated], sets
