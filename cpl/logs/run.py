"""A run in memory: one table, what describes it, and what it cost to get it."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pandas as pd

from cpl.logs.errors import Fault, MissingChannelError, SchemaError, printable
from cpl.logs.info import RunInfo
from cpl.logs.plausible import Plausibility
from cpl.logs.schema import CHANNELS, channel_of

__all__ = ["Recovery", "Run"]

FASTEST_HZ = 1e6  # [Hz] no estimator gives more poses a second


@dataclass(frozen=True, kw_only=True)
class Recovery:
    """How much of a file could be read.

    Attributes:
        rows: Rows in the table.
        rows_dropped: Rows that the file held, or says it held, and the table does not; None if the
            file's end is lost, and with it the number of rows that there were.
        seconds: From the first row to the last [s].
        bytes: Size of the file.
        bytes_dropped: Bytes that nothing could be made of.
        faults: What was wrong, in the order in which it was found.
        notes: What was done to a sound file to read it (an import's conversions).
        plausibility: What the rows show of rate, speed and jumps; None where nobody looked.
    """

    rows: int
    seconds: float
    bytes: int
    rows_dropped: int | None = 0
    bytes_dropped: int = 0
    faults: tuple[Fault, ...] = ()
    notes: tuple[str, ...] = ()
    plausibility: Plausibility | None = None

    @property
    def whole(self) -> bool:
        """Whether everything that the file promises was read. It may still be nonsense."""
        return not self.faults

    def __str__(self) -> str:
        text = f"{self.rows} rows, {self.seconds:.2f} s"
        if self.whole:
            return f"whole: {text}"
        lost = "an unknown number of" if self.rows_dropped is None else str(self.rows_dropped)
        return (
            f"damaged: {text} recovered, {lost} rows and {self.bytes_dropped} of {self.bytes} "
            "bytes dropped"
        )


@dataclass(frozen=True, kw_only=True)
class Run:
    """One run.

    Attributes:
        path: The file that it was read from.
        info: What describes it.
        table: One row a step, columns as in `cpl.logs.COLUMNS` as far as the run has them; the
            index `row` is the step's number, so a dropped row is a gap in it.
        recovery: How much of the file is in the table.
    """

    path: Path
    info: RunInfo
    table: pd.DataFrame
    recovery: Recovery

    @property
    def duration_s(self) -> float:
        """From the first row to the last [s]."""
        return self.recovery.seconds

    @property
    def label(self) -> str:
        """The provenance stamp for figures."""
        damaged = "" if self.recovery.whole else ", recovered from a damaged file"
        return f"{self.info.label}, {printable(self.path.name)}{damaged}"

    @property
    def topics(self) -> tuple[str, ...]:
        """The channels that it has."""
        return tuple(each.topic for each in CHANNELS if set(each.columns) <= set(self.table))

    @property
    def missing(self) -> tuple[str, ...]:
        """The channels that it does not have."""
        return tuple(each.topic for each in CHANNELS if each.topic not in self.topics)

    def require(self, *columns: str) -> pd.DataFrame:
        """Return the table if it has these columns.

        Raises:
            MissingChannelError: It lacks one; the error names the channel.
        """
        for column in columns:
            if column not in self.table:
                what = f"has no {column}: the channel {channel_of(column).topic} is missing"
                raise MissingChannelError(what, path=self.path)
        return self.table

    def segments(self) -> list[pd.DataFrame]:
        """Return the stretches without a gap: what looks steps ahead must not look across one.

        A gap is a dropped row, or a time step longer than 1.5 times the usual one.
        """
        row, t_s = np.asarray(self.table.index), np.asarray(self.table["t_s"])
        step = np.diff(t_s)
        usual = np.median(step) if len(step) else 0.0
        cuts = np.flatnonzero((np.diff(row) != 1) | (step > 1.5 * usual)) + 1
        bounds = [0, *cuts.tolist(), len(row)]
        return [self.table.iloc[a:b] for a, b in pairwise(bounds)]

    def downsampled(self, rate_hz: float) -> Run:
        """Return the run at a lower rate: of each interval the last row, nothing interpolated.

        The confidence is the lowest and the SLAM error the first one of the interval, so that
        neither is lost between two rows.

        Args:
            rate_hz: The new rate [Hz], below that of the run.

        Raises:
            ValueError: Not a positive rate.
            SchemaError: The run has a policy's columns; its steps are not to be thinned.
        """
        if not (math.isfinite(rate_hz) and 0 < rate_hz <= FASTEST_HZ):
            msg = f"rate_hz must be finite, above 0 and at most {FASTEST_HZ:g}, got {rate_hz!r}"
            raise ValueError(msg)
        if "kp" in self.table or "l_hat" in self.table:
            what = "holds a policy's steps, which are not to be thinned"
            raise SchemaError(what, path=self.path)
        t_s = np.asarray(self.table["t_s"])
        tick = np.ceil((t_s - t_s[0]) * rate_hz - 1e-6).astype(np.int64)
        number, begin = np.unique(tick, return_index=True)
        last = np.append(begin[1:], len(tick)) - 1
        table = self.table.iloc[last].set_axis(pd.Index(number, name="row"))
        if "confidence" in table:
            least = np.minimum.reduceat(np.asarray(self.table["confidence"]), begin)
            table["confidence"] = least
        if "slam_error" in table:
            parts = np.split(np.asarray(self.table["slam_error"]), begin[1:])
            table["slam_error"] = [next((int(c) for c in part if c), 0) for part in parts]
        note = f"thinned to {rate_hz:g} Hz: the last of {len(t_s)} rows in each interval"
        seconds = float(table["t_s"].iloc[-1] - table["t_s"].iloc[0])
        recovery = replace(
            self.recovery, rows=len(table), seconds=seconds, notes=(*self.recovery.notes, note)
        )
        return replace(self, table=table, recovery=recovery)
