"""ROS 2 bags packed by zstd, message by message or as whole files, unpacked within a budget.

A frame of zstd says how large it becomes, and need not be right: a message is not unpacked beyond
what any pose takes, and a file is unpacked to the disk, piece by piece, until its budget is spent.
"""

from __future__ import annotations

import io
from pathlib import Path

from cpl.logs.budget import LARGEST_FILE, LARGEST_MESSAGE, Budget, OverBudgetError
from cpl.logs.source import LARGEST_WINDOW, CannotUnpackError, Source

__all__ = ["ENDINGS", "ZSTD", "beginning", "unpacked_file", "unpacked_message"]

ZSTD = b"\x28\xb5\x2f\xfd"  # how a frame begins; CDR begins with a zero
ENDINGS = (".zstd", ".zst")
FED = 1 << 10  # [byte] given to zstd at a time: four become at most 128 kB, so this 32 MB
FIRST = 160 << 10  # [byte] that hold a frame's head and its first block, which is 128 kB at most


def beginning(path: Path, count: int) -> bytes:
    """Return how a packed file begins when it is unpacked; nothing if it cannot be.

    Args:
        path: The file.
        count: How many bytes, at most.
    """
    import zstandard

    with path.open("rb") as file:
        packed = io.BytesIO(file.read(FIRST))
    decompressor = zstandard.ZstdDecompressor(max_window_size=LARGEST_WINDOW)
    try:
        with decompressor.stream_reader(packed) as reader:
            return reader.read(count)
    except zstandard.ZstdError:
        return b""


def unpacked_message(data: bytes, budget: Budget) -> bytes:
    """Return the content of a packed message.

    Args:
        data: One frame.
        budget: Of the file it is from.

    Raises:
        CannotUnpackError: It is no whole frame, or larger than any message with a pose.
        OverBudgetError: The file's messages unpack to more than they may.
    """
    import zstandard

    try:
        declared = zstandard.get_frame_parameters(data).content_size
        if declared != zstandard.CONTENTSIZE_UNKNOWN and declared > LARGEST_MESSAGE:
            raise CannotUnpackError("says it unpacks to more than any pose takes")
        content = zstandard.ZstdDecompressor(max_window_size=LARGEST_WINDOW).decompress(
            data, max_output_size=LARGEST_MESSAGE, allow_extra_data=False
        )
    except zstandard.ZstdError as error:
        raise CannotUnpackError("cannot be decompressed") from error
    budget.unpack(len(content))
    return content


def unpacked_file(path: Path, folder: Path) -> tuple[Path, str]:
    """Unpack a file into a folder.

    Args:
        path: The file.
        folder: Where to; the file there is called the same, without its last ending.

    Returns:
        The file there, with what could be had, and what is wrong with the rest; empty if nothing.

    Raises:
        OverBudgetError: It unpacks to more than a file of its size may.
    """
    import zstandard

    made = folder / (path.stem if path.suffix in ENDINGS else path.name)
    size = 0
    with Source.open(path) as source, made.open("wb") as file:
        decompressor = zstandard.ZstdDecompressor(max_window_size=LARGEST_WINDOW)
        frame = decompressor.decompressobj()
        whole = False
        try:
            for piece in source.pieces(0, source.size):
                for at in range(0, len(piece), FED):
                    left = piece[at : at + FED]
                    while left:
                        if whole:
                            frame, whole = decompressor.decompressobj(), False
                        content = frame.decompress(left)
                        source.budget.unpack(len(content))
                        size += len(content)
                        if size > LARGEST_FILE:
                            msg = f"unpacks to more than the {LARGEST_FILE} bytes that are read"
                            raise OverBudgetError(msg)
                        file.write(content)
                        whole, left = frame.eof, frame.unused_data if frame.eof else b""
        except zstandard.ZstdError:
            return made, f"after {size} bytes the file cannot be decompressed"
    return made, "" if whole else f"the file ends within what is compressed, after {size} bytes"
