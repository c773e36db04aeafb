"""Write a run so that a kill, a crash or a full disk costs nothing that was written before.

While a run goes on, every row is one chunk that is handed to the operating system at once, so a
killed process loses nothing that `write` returned from; every `sync_every_s` the file is flushed to
the disk itself, so a power cut loses at most that much. When the run is closed the file is replaced
in one step by a smaller one with the same messages, `ROWS_PER_CHUNK` rows a chunk: a damaged byte
costs two seconds of a 10 Hz run, not the run.
"""

from __future__ import annotations

import io
import json
import os
import time
from collections.abc import Iterable, Mapping
from contextlib import suppress
from itertools import count, groupby
from operator import attrgetter
from pathlib import Path
from types import TracebackType
from typing import IO, Any, Self

from mcap.records import Message as McapMessage
from mcap.stream_reader import StreamReader
from mcap.writer import CompressionType, IndexType, Writer

from cpl.logs.codec import channels_of, encode, nanoseconds
from cpl.logs.info import METADATA, RunInfo, packed
from cpl.logs.schema import Channel, json_schema
from cpl.store import atomic_write

__all__ = ["ROWS_PER_CHUNK", "SYNC_EVERY_S", "RunWriter", "encoded_run", "write_run"]

ROWS_PER_CHUNK = 20  # [rows] 2 s of a 10 Hz run
SYNC_EVERY_S = 1.0  # [s] between flushes to the disk
LARGE = 1 << 40  # [byte] no chunk ends before a row does


class RunWriter:
    """A run's file, while the run goes on.

    Args:
        path: The file; it must not exist yet.
        info: What describes the run.
        sync_every_s: The most that a power cut may cost [s].
        compact: Whether to make the file small when it is closed.

    Raises:
        FileExistsError: The file exists: a log is never overwritten.

    Examples:
        >>> import tempfile
        >>> pose = dict(x_m=0.0, y_m=0.0, z_m=0.0, qx=0.0, qy=0.0, qz=0.0, qw=1.0, yaw_rad=0.0)
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     path = Path(folder) / "run.mcap"
        ...     with RunWriter(path, RunInfo(provenance="simulated-kinematic")) as log:
        ...         for step in range(3):
        ...             log.write({"t_s": 0.1 * step, **pose})
        ...     log.rows
        3
    """

    def __init__(
        self,
        path: Path | str,
        info: RunInfo,
        *,
        sync_every_s: float = SYNC_EVERY_S,
        compact: bool = True,
    ) -> None:
        if not sync_every_s >= 0:
            msg = f"sync_every_s must be at least 0, got {sync_every_s!r}"
            raise ValueError(msg)
        self.path, self.info = Path(path), info
        self._sync_every_s, self._compact = sync_every_s, compact
        self.path.parent.mkdir(parents=True, exist_ok=True)
        self._file = self.path.open("xb")
        self._log = _Encoder(self._file, info, rows_per_chunk=1)
        self._broken = False
        self._sync()

    @property
    def rows(self) -> int:
        """Rows written so far."""
        return self._log.rows

    def write(self, row: Mapping[str, Any]) -> None:
        """Write one row; when this returns, a kill of this process no longer loses it.

        Args:
            row: Columns of `cpl.logs.COLUMNS`; those of the first row are those of every row.

        Raises:
            ValueError: A column unknown, missing, of the wrong kind, out of range or not finite; a
                time that does not go on; a writer that is closed. Nothing of the row is written.
            OSError: The disk refused; what was written before is safe, and nothing more is taken.
        """
        if self._file.closed or self._broken:
            state = "broken by an earlier error of the disk" if self._broken else "closed"
            msg = f"write must come while the log is open; {self.path.name} is {state}"
            raise ValueError(msg)
        messages = self._log.prepared(row)
        try:
            self._log.add(messages)
            self._file.flush()
            if time.monotonic() - self._synced_s >= self._sync_every_s:
                self._sync()
        except OSError:
            self._broken = True
            raise

    def close(self) -> None:
        """Finish the file. Closing twice is allowed."""
        if self._file.closed:
            return
        if self._broken:
            with suppress(OSError):  # said already, when the row was refused
                self._file.close()
            return
        self._log.finish()
        self._sync()
        self._file.close()
        if self._compact:
            atomic_write(self.path, self._log.compacted(self.path.read_bytes()))

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def _sync(self) -> None:
        self._file.flush()
        os.fsync(self._file.fileno())
        self._synced_s = time.monotonic()


def write_run(
    path: Path | str,
    rows: Iterable[Mapping[str, Any]],
    info: RunInfo,
    *,
    numbers: Iterable[int] | None = None,
) -> Path:
    """Write a run that is over: the whole file, or nothing.

    Args:
        path: The file; it must not exist yet.
        rows: Mappings with columns of `cpl.logs.COLUMNS`, in order of time.
        info: What describes the run.
        numbers: The rows' numbers, growing, where some are missing; else 0, 1, 2 and so on.

    Returns:
        The path.

    Raises:
        FileExistsError: The file exists.
        ValueError: As :meth:`RunWriter.write`.
    """
    path = Path(path)
    if path.exists():
        raise FileExistsError(f"path must not exist yet, got {str(path)!r}")
    return atomic_write(path, encoded_run(rows, info, numbers=numbers))


def encoded_run(
    rows: Iterable[Mapping[str, Any]],
    info: RunInfo,
    *,
    numbers: Iterable[int] | None = None,
    rows_per_chunk: int = ROWS_PER_CHUNK,
) -> bytes:
    """Return the bytes of a whole run's file."""
    buffer = io.BytesIO()
    log = _Encoder(buffer, info, rows_per_chunk=rows_per_chunk)
    for number, row in zip(count() if numbers is None else numbers, rows, strict=False):
        log.add([(topic, number, t_ns, data) for topic, _, t_ns, data in log.prepared(row)])
    log.finish()
    return buffer.getvalue()


Message = tuple[str, int, int, bytes]  # topic, row, log time [ns], payload


class _Encoder:
    """The MCAP side of a run: metadata, channels and messages, into any stream."""

    def __init__(self, stream: IO[bytes], info: RunInfo, *, rows_per_chunk: int) -> None:
        self.rows, self.channels = 0, tuple[Channel, ...]()
        self._info, self._rows_per_chunk = info, rows_per_chunk
        self._last_ns = -1
        self._ids: dict[str, int] = {}
        # Message indexes would double the size and serve a viewer's seeking only.
        self._mcap = Writer(
            stream,
            chunk_size=LARGE,
            compression=CompressionType.ZSTD,
            index_types=IndexType.CHUNK | IndexType.METADATA,
            enable_data_crcs=True,
        )
        self._mcap.start(profile="", library="cpl.logs")

    def prepared(self, row: Mapping[str, Any]) -> list[Message]:
        """Return a row's messages; nothing is changed if the row is refused."""
        where = f"row {self.rows}"
        try:
            t_ns = nanoseconds(row["t_s"])
            channels = self._channels(row)
            stamp = self._info.start_unix_ns + t_ns
            encoded = [(each.topic, encode(each, row, stamp)) for each in channels]
        except KeyError as error:
            msg = f"{where}: row must have {error.args[0]!r}, got only {', '.join(row)}"
            raise ValueError(msg) from error
        except ValueError as error:
            raise ValueError(f"{where}: {error}") from error
        if t_ns <= self._last_ns:
            msg = f"{where}: t_s must grow, got {t_ns / 1e9} after {self._last_ns / 1e9}"
            raise ValueError(msg)
        return [(topic, self.rows, stamp, data) for topic, data in encoded if data is not None]

    def add(self, messages: list[Message]) -> None:
        """Write the messages of one row."""
        if not self._ids:
            self._begin()
        for topic, row, stamp, payload in messages:
            self._mcap.add_message(self._ids[topic], stamp, payload, stamp, row)
        self._last_ns = messages[0][2] - self._info.start_unix_ns
        self.rows += 1
        if self.rows % self._rows_per_chunk == 0:
            self._mcap.flush()

    def finish(self) -> None:
        """Write what is left, the metadata again (the first copy may be damaged), and the end."""
        self._mcap.flush()
        topics = tuple(each.topic for each in self.channels if self.rows)
        self._mcap.add_metadata(METADATA, packed(self._info, topics, self.rows))
        self._mcap.finish()

    def compacted(self, data: bytes) -> bytes:
        """Return the same run with many rows a chunk.

        Args:
            data: What this encoder wrote, one row a chunk.
        """
        topics = {number: topic for topic, number in self._ids.items()}
        buffer = io.BytesIO()
        log = _Encoder(buffer, self._info, rows_per_chunk=ROWS_PER_CHUNK)
        log.channels = self.channels
        records = StreamReader(io.BytesIO(data), validate_crcs=True).records
        messages = (record for record in records if isinstance(record, McapMessage))
        for row, group in groupby(messages, key=attrgetter("sequence")):
            log.add([(topics[each.channel_id], row, each.log_time, each.data) for each in group])
        log.finish()
        return buffer.getvalue()

    def _begin(self) -> None:
        """Write the metadata and register the channels; called with the first row."""
        topics = tuple(each.topic for each in self.channels)
        self._mcap.add_metadata(METADATA, packed(self._info, topics))
        for each in self.channels:
            schema = json.dumps(json_schema(each), separators=(",", ":")).encode()
            self._ids[each.topic] = self._mcap.register_channel(
                each.topic,
                "json",
                self._mcap.register_schema(each.schema, "jsonschema", schema),
                {"frame": each.frame, "units": json.dumps(each.units, separators=(",", ":"))},
            )

    def _channels(self, row: Mapping[str, Any]) -> tuple[Channel, ...]:
        there = channels_of(row)
        if not self.rows:
            self.channels = there
        elif there != self.channels:
            names = " ".join(each.topic for each in self.channels)
            have = " ".join(each.topic for each in there)
            msg = f"row must have the channels of the first row ({names}), got {have}"
            raise ValueError(msg)
        return there
