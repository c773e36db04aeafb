"""From the rows that passed to a run: one order of time, one table, and what it cost."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from cpl.logs.checks import check_run
from cpl.logs.clock import NS, Clock, ordered
from cpl.logs.errors import EmptyLogError, TimeOrderError, printable
from cpl.logs.info import RunInfo
from cpl.logs.plausible import plausibility
from cpl.logs.run import Recovery, Run
from cpl.logs.schema import CHANNELS, COLUMNS, FIELDS
from cpl.logs.sieve import Sieve

__all__ = ["LONG_AGO_NS", "finished"]

LONG_AGO_NS = 10**8 * NS  # [ns] a time beyond is counted from 1970
Origin = Literal["first", "dated", "stated"]
_BY_TOPIC = {each.topic: each for each in CHANNELS}


def finished(
    sieve: Sieve,
    info: RunInfo,
    path: Path,
    notes: list[str],
    *,
    size: int,
    topics: tuple[str, ...],
    written: int | None,
    lost: int = 0,
    origin: Origin = "first",
    unit_known: bool = False,
) -> Run:
    """Return what the sieve let through as a run.

    Args:
        sieve: Rows and faults.
        info: What describes the run.
        path: The file.
        notes: What was done to read it.
        size: Of the file [byte].
        topics: The channels that every row has.
        written: How many rows there were; None if nobody knows.
        lost: Bytes that nothing could be made of.
        origin: What the run's time is counted from: `first` for the first row; `dated` for the
            first row if stamps are dates or negative, else 0; `stated` for the start that `info`
            states.
        unit_known: As `checks.check_run`.

    Raises:
        EmptyLogError: No row is left.
        UnitError: As `checks.check_run`.
        FrameError: As `checks.check_run`.
    """
    clock, start = ordered(np.frombuffer(sieve.stamps, dtype=np.int64)), 0
    if sieve.rows:
        same = _name_times(clock, sieve)
        if same:
            notes = [*notes, f"{same} rows are written twice, the same; once is enough"]
            written = None if written is None else written - same
        start = info.start_unix_ns if origin == "stated" else _first(clock, origin)
        early = clock.time_ns < start
        if early.any():
            clock = _later(clock, early, sieve, start)
    if not len(clock.kept):
        causes = "; ".join(str(fault) for fault in sieve.faults[:3])
        raise EmptyLogError(f"has no usable row{': ' * bool(causes)}{causes}", path=path)
    if origin != "stated" and start > LONG_AGO_NS and not info.start_unix_ns:
        info = replace(info, start_unix_ns=start)
    table = _table(sieve, clock, start, _columns(topics))
    check_run(table, path, unit_known=unit_known)
    t_s = table["t_s"].to_numpy()
    recovery = Recovery(
        rows=len(table),
        seconds=float(t_s[-1] - t_s[0]),
        bytes=size,
        rows_dropped=None if written is None else written - len(table),
        bytes_dropped=lost,
        faults=tuple(sieve.faults),
        notes=tuple(map(printable, notes)),
        plausibility=plausibility(table),
    )
    return Run(path=path, info=info, table=table, recovery=recovery)


def _first(clock: Clock, origin: Origin) -> int:
    first = int(clock.time_ns[0]) if len(clock.kept) else 0
    return first if origin == "first" or first > LONG_AGO_NS or first < 0 else 0


def _name_times(clock: Clock, sieve: Sieve) -> int:
    """Say which rows were dropped for their time, and where the clock was set.

    Returns:
        How many rows are the same as the row before in every number, which costs nothing.
    """
    stamps, places = sieve.stamps, sieve.places
    same = 0
    for at in clock.still.tolist():
        if all(values[at] == values[at - 1] for values in sieve.columns.values()):
            same += 1
            continue
        what = f"time stands still at {stamps[at] / NS:.6f} s"
        sieve.drop(TimeOrderError, sieve.place.format(places[at]), what)
    for at in clock.strays.tolist():
        near = stamps[at - 1 if at else min(1, len(stamps) - 1)] / NS
        what = f"its time, {stamps[at] / NS:.6f} s, is out of order beside {near:.6f} s"
        sieve.drop(TimeOrderError, sieve.place.format(places[at]), what)
    for at, by in clock.sets:
        how = f"set {'ahead' if by > 0 else 'back'} by {abs(by) / NS:.6f} s"
        what = f"the clock was {how}; rows go on two usual steps later, the true pause is not known"
        sieve.drop(TimeOrderError, sieve.place.format(places[at]), what, rows=0)
    return same


def _later(clock: Clock, early: NDArray[np.bool], sieve: Sieve, start: int) -> Clock:
    """Drop what came before the start."""
    for at in clock.kept[early].tolist():
        what = f"time is {(sieve.stamps[at] - start) / NS} s, before the run's start"
        sieve.drop(TimeOrderError, sieve.place.format(sieve.places[at]), what)
    return replace(clock, kept=clock.kept[~early], time_ns=clock.time_ns[~early])


def _table(sieve: Sieve, clock: Clock, start: int, order: list[str]) -> pd.DataFrame:
    """Return the kept rows with the types that the schema states."""
    every = len(clock.kept) == sieve.rows
    numbers = np.frombuffer(sieve.numbers, dtype=np.int64)[clock.kept]
    columns: dict[str, Any] = {"t_s": (clock.time_ns - start) / NS}
    for name in order:
        if name == "t_s":
            continue
        if FIELDS[name].kind == "text":
            words = sieve.texts.get(name, {})
            texts = [words.get(number, "") for number in numbers.tolist()]
            columns[name] = pd.array(texts, dtype="str")
            continue
        values = np.frombuffer(sieve.columns.pop(name), dtype=np.float64)
        kept = values if every else values[clock.kept]
        columns[name] = kept.astype(np.int64) if FIELDS[name].kind == "int" else kept
    index = pd.Index(numbers, name="row", dtype=np.int64)
    return pd.DataFrame(columns, index=index, copy=False)


def _columns(topics: tuple[str, ...]) -> list[str]:
    have = {name for topic in topics if topic in _BY_TOPIC for name in _BY_TOPIC[topic].columns}
    return [name for name in COLUMNS if name == "t_s" or name in have]
