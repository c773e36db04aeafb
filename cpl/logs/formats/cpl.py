"""Runs that this package wrote: MCAP with a description, sealed and checksummed."""

from __future__ import annotations

from pathlib import Path

from cpl.logs.formats import Format, Head, Likeness, Options
from cpl.logs.reader import read_mcap
from cpl.logs.run import Run
from cpl.logs.salvage import MAGIC

__all__ = ["FORMAT"]


def _recognise(head: Head) -> Likeness:
    begins = head.data.startswith(MAGIC)
    if begins and b"cpl.logs" in head.data[:64]:
        return Likeness(1.0, "begins as MCAP does, and cpl.logs wrote it")
    if begins and len(head.data) < 64:
        return Likeness(0.95, "begins as MCAP does, and holds nothing else")
    if b"cpl.run" in head.data and b"cpl-log" in head.data:
        return Likeness(0.95, "holds the description of a run, though its beginning is damaged")
    return Likeness(0.0, "is not MCAP that cpl.logs wrote")


def _read(path: Path, options: Options) -> Run:
    del options  # it says everything itself
    return read_mcap(path)


FORMAT = Format(
    name="cpl",
    title="a run that cpl wrote: MCAP, every byte under a checksum",
    example="\\x89MCAP0, library cpl.logs (binary)",
    lacks="nothing: what a run does not have is not in its description",
    recognise=_recognise,
    read=_read,
    suffixes=(".mcap",),
)
