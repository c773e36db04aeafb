"""What did the robot do? Runs as files: written so that a crash costs nothing, read with suspicion.

One MCAP file a run, with units, frames and provenance in it (:mod:`cpl.logs.schema` has the
channels). What other machines and programs record is read as well, in any of the formats of
:mod:`cpl.logs.formats`. What is damaged is recovered as far as it can be confirmed, and the
recovery says what was dropped; beside it stands whether the numbers are plausible.
"""

from cpl.logs.errors import (
    DamagedLogError,
    DuplicateChannelError,
    EmptyLogError,
    Fault,
    FrameError,
    LogError,
    MissingChannelError,
    NotALogError,
    NotFiniteError,
    ProvenanceError,
    QuaternionError,
    RangeError,
    SchemaError,
    TimeOrderError,
    UnitError,
)
from cpl.logs.export import save_run
from cpl.logs.formats import Format, formats
from cpl.logs.info import RunInfo
from cpl.logs.plausible import Plausibility
from cpl.logs.run import Recovery, Run
from cpl.logs.schema import CHANNELS, COLUMNS, FRAMES, PROVENANCES, SLAM_ERRORS, Row
from cpl.logs.sources import Runs, read_run, read_runs
from cpl.logs.writer import RunWriter, write_run

__all__ = [
    "CHANNELS",
    "COLUMNS",
    "FRAMES",
    "PROVENANCES",
    "SLAM_ERRORS",
    "DamagedLogError",
    "DuplicateChannelError",
    "EmptyLogError",
    "Fault",
    "Format",
    "FrameError",
    "LogError",
    "MissingChannelError",
    "NotALogError",
    "NotFiniteError",
    "Plausibility",
    "ProvenanceError",
    "QuaternionError",
    "RangeError",
    "Recovery",
    "Row",
    "Run",
    "RunInfo",
    "RunWriter",
    "Runs",
    "SchemaError",
    "TimeOrderError",
    "UnitError",
    "formats",
    "read_run",
    "read_runs",
    "save_run",
    "write_run",
]
