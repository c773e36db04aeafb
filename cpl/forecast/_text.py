"""What a file of text says, plain or compressed; damage is one sentence."""

from __future__ import annotations

import bz2
import gzip
import lzma
import zipfile
import zlib
from io import BytesIO
from pathlib import Path
from typing import Any

__all__ = ["text_of"]

LARGEST = 2**30  # [B] of text that is taken from one file


def text_of(path: Path) -> str:
    """Return what a file says; a damaged or endless one is refused by name.

    Args:
        path: The file; `.gz`, `.bz2`, `.xz`, `.zst` and `.zip` (of one file) are unpacked.

    Raises:
        OSError: If it cannot be opened.
        ValueError: If it is damaged, too large or no text.
    """
    openers: dict[str, Any] = {
        ".gz": gzip.open, ".bz2": bz2.open, ".xz": lzma.open, ".zst": _zstandard, ".zip": _zip,
    }  # fmt: skip
    opener = openers.get(path.suffix.lower(), open)
    broken = (EOFError, zlib.error, lzma.LZMAError, zipfile.BadZipFile, NotImplementedError)
    try:
        with opener(path, "rb") as file:
            data = file.read(LARGEST + 1)
    except broken as error:
        raise ValueError(f"{path.name} is damaged: {error}") from error
    except OSError as error:
        if error.errno is not None:
            raise  # about the file, not about what is in it
        raise ValueError(f"{path.name} is damaged: {error}") from error
    if len(data) > LARGEST:
        raise ValueError(f"{path.name} must hold at most {LARGEST / 2**20:.0f} MiB of text")
    wide = data[:2] in (b"\xff\xfe", b"\xfe\xff")
    try:
        return data.decode("utf-16" if wide else "utf-8-sig")
    except UnicodeDecodeError as error:
        raise ValueError(f"{path.name} must be a table of numbers: {error}") from error


def _zip(path: Path, _: str) -> BytesIO:
    with zipfile.ZipFile(path) as archive:
        members = [each for each in archive.infolist() if not each.is_dir()]
        if len(members) != 1:
            raise ValueError(f"{path.name} must hold one file, not {len(members)}")
        if members[0].flag_bits & 1:
            raise ValueError(f"{path.name} is locked by a password")
        with archive.open(members[0]) as file:
            return BytesIO(file.read(LARGEST + 1))


def _zstandard(path: Path, _: str) -> BytesIO:
    import zstandard

    try:
        with path.open("rb") as file, zstandard.ZstdDecompressor().stream_reader(file) as reader:
            return BytesIO(reader.read(LARGEST + 1))
    except zstandard.ZstdError as error:
        raise ValueError(f"{path.name} is damaged: {error}") from error
