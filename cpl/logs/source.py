"""A file's bytes, read in pieces; and what comes out of its compressed parts, in pieces too."""

from __future__ import annotations

import bz2
import io
import re
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import BinaryIO, Self, cast

from cpl.logs.budget import LARGEST_FILE, PIECE, Budget
from cpl.logs.errors import EmptyLogError, NotALogError

__all__ = ["CannotUnpackError", "Flow", "ShortError", "Source", "unpacked"]

LARGEST_WINDOW = 1 << 26  # [byte] what a zstd stream may make us remember; level 19 asks for 2^23


class ShortError(Exception):
    """The bytes end before what was to be read."""


class CannotUnpackError(Exception):
    """A compressed part is not what its format says."""


class Source:
    """A file that is read in pieces.

    Args:
        file: Open for reading, seekable.
        size: Its size [byte].
    """

    def __init__(self, file: BinaryIO, size: int) -> None:
        self.file, self.size, self.budget = file, size, Budget(size=size)

    @classmethod
    def open(cls, path: Path) -> Self:
        """Open a file.

        Raises:
            EmptyLogError: It has no content.
            NotALogError: It is a folder, no regular file, or larger than what is read.
            OSError: It is not there, or may not be read.
        """
        if path.is_dir():
            raise NotALogError("is a folder; name one of its files, or use read_runs", path=path)
        if not path.is_file():
            path.stat()  # the system's own error, if there is nothing
            raise NotALogError("is no file that can be read twice (a pipe, a device)", path=path)
        if (size := path.stat().st_size) > LARGEST_FILE:
            what = f"has {size} bytes; the most that is read is {LARGEST_FILE}"
            raise NotALogError(what, path=path)
        if not size:
            raise EmptyLogError("has no content", path=path)
        return cls(path.open("rb"), size)

    @classmethod
    def of(cls, data: bytes) -> Self:
        """Return bytes in memory as a source."""
        return cls(io.BytesIO(data), len(data))

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.file.close()

    def read(self, at: int, count: int) -> bytes:
        """Return bytes from a place on; fewer where the file ends."""
        self.file.seek(at)
        return self.file.read(max(0, min(count, self.size - at)))

    def pieces(self, at: int, count: int) -> Iterator[bytes]:
        """Yield a stretch piece by piece."""
        end = min(at + count, self.size)
        while at < end:
            piece = self.read(at, min(PIECE, end - at))
            if not piece:  # the file was cut while it was read
                return
            yield piece
            at += len(piece)

    def matches(
        self, pattern: re.Pattern[bytes], at: int, end: int, *, reach: int
    ) -> Iterator[int]:
        """Yield where a pattern matches, from a place up to another.

        Args:
            pattern: What is looked for; what it looks ahead at is not part of a match.
            at: Where to begin.
            end: Matches begin before.
            reach: How many bytes a match looks at [byte].
        """
        while at < end:
            piece = self.read(at, PIECE + reach)
            for found in pattern.finditer(piece):
                if found.start() < PIECE and at + found.start() < end:
                    yield at + found.start()
            at += PIECE


class Flow:
    """Bytes that come in pieces and are taken record by record.

    Args:
        pieces: The bytes.

    Examples:
        >>> flow = Flow([b"ab", b"cdef"])
        >>> flow.take(3), flow.skip(1), flow.take(2), flow.ended()
        (b'abc', None, b'ef', True)
    """

    def __init__(self, pieces: Iterable[bytes]) -> None:
        self._pieces = iter(pieces)
        self._buffer, self._place = b"", 0
        self.taken = 0

    def take(self, count: int) -> bytes:
        """Return the next bytes.

        Raises:
            ShortError: There are fewer.
        """
        begin, end = self._place, self._place + count
        if end > len(self._buffer):
            self._more(count)
            begin, end = 0, count
        self._place = end
        self.taken += count
        return self._buffer[begin:end]

    def skip(self, count: int) -> None:
        """Leave the next bytes out, without holding them.

        Raises:
            ShortError: There are fewer.
        """
        self.taken += count
        while count > (have := len(self._buffer) - self._place):
            count -= have
            self._place = 0
            self._buffer = next(self._pieces, b"")
            if not self._buffer:
                raise ShortError
        self._place += count

    def ended(self) -> bool:
        """Tell whether nothing is left."""
        while self._place == len(self._buffer):
            self._place = 0
            self._buffer = next(self._pieces, b"")
            if not self._buffer:
                return True
        return False

    def rest(self) -> None:
        """Go through what is left without looking at it."""
        for _ in self._pieces:
            pass

    def _more(self, count: int) -> None:
        parts = [self._buffer[self._place :]]
        have = len(parts[0])
        while have < count:
            piece = next(self._pieces, b"")
            if not piece:
                self._buffer, self._place = b"".join(parts), 0
                raise ShortError
            parts.append(piece)
            have += len(piece)
        self._buffer, self._place = b"".join(parts), 0


def unpacked(source: Source, at: int, size: int, kind: str) -> Iterator[bytes]:
    """Yield a compressed stretch of a file, unpacked, piece by piece.

    Args:
        source: The file.
        at: Where the stretch begins.
        size: Its length [byte].
        kind: Empty for not compressed, `zstd`, `lz4` or `bz2`.

    Raises:
        CannotUnpackError: The stretch is not what its format says; what came before is sound as
            far as the format can tell.
        cpl.logs.budget.OverBudgetError: More comes out than a file of that size may hold.
    """
    makers = {"zstd": _zstd, "lz4": _lz4, "bz2": _bz2}
    if not kind:
        yield from source.pieces(at, size)
        return
    if kind not in makers:
        msg = f"is compressed by {kind!r}, not by one of {', '.join(makers)}"
        raise CannotUnpackError(msg)
    for piece in makers[kind](source, at, size):
        source.budget.unpack(len(piece))
        yield piece


class _Stretch(io.RawIOBase):
    """A part of a file as a file."""

    def __init__(self, source: Source, at: int, size: int) -> None:
        self._source, self._at, self._end = source, at, min(at + size, source.size)

    def readable(self) -> bool:
        return True

    def read(self, size: int = -1, /) -> bytes:
        size = self._end - self._at if size < 0 else min(size, self._end - self._at)
        piece = self._source.read(self._at, size)
        self._at += len(piece)
        return piece


def _zstd(source: Source, at: int, size: int) -> Iterator[bytes]:
    import zstandard

    decompressor = zstandard.ZstdDecompressor(max_window_size=LARGEST_WINDOW)
    try:
        with decompressor.stream_reader(
            cast("BinaryIO", _Stretch(source, at, size)),
            read_size=min(size, PIECE),
            read_across_frames=True,
        ) as reader:
            while piece := reader.read(PIECE):
                yield piece
    except zstandard.ZstdError as error:
        raise CannotUnpackError("cannot be decompressed") from error


def _lz4(source: Source, at: int, size: int) -> Iterator[bytes]:
    from lz4.frame import LZ4FrameDecompressor

    decompressor = LZ4FrameDecompressor()
    try:
        for packed in source.pieces(at, size):
            if decompressor.eof:
                return
            piece = decompressor.decompress(packed, PIECE)
            while piece:
                yield piece
                if decompressor.eof or decompressor.needs_input:
                    break
                piece = decompressor.decompress(b"", PIECE)
    except (RuntimeError, EOFError, ValueError) as error:
        raise CannotUnpackError("cannot be decompressed") from error


def _bz2(source: Source, at: int, size: int) -> Iterator[bytes]:
    decompressor = bz2.BZ2Decompressor()
    try:
        for packed in source.pieces(at, size):
            if decompressor.eof:
                return
            piece = decompressor.decompress(packed, PIECE)
            while piece or not (decompressor.needs_input or decompressor.eof):
                if piece:
                    yield piece
                if decompressor.eof or decompressor.needs_input:
                    break
                piece = decompressor.decompress(b"", PIECE)
    except (OSError, EOFError, ValueError) as error:
        raise CannotUnpackError("cannot be decompressed") from error
