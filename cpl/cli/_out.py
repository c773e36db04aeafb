"""Where a command writes what was asked for with `--out`: one way for all of them."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from cpl.cli import UsageError

__all__ = ["write_out"]


def write_out(path: Path, content: str | bytes, *, inputs: Iterable[Path] = ()) -> Path:
    """Write a file whole; go through what is no plain file of its own.

    A device or a pipe is written to, a link is followed, and a file with several names keeps them.

    Args:
        path: Where to.
        content: What.
        inputs: Files that the command has read, none of which may be written over.

    Returns:
        The path, as it was given.

    Raises:
        UsageError: It is a folder, or one of the inputs.
        OSError: It cannot be written.
    """
    from cpl.store import atomic_write

    for each in inputs:
        if path.exists() and path.samefile(each):
            msg = f"--out must not be the input: {path}"
            raise UsageError(msg)
    if path.is_dir():
        msg = f"--out must be a file, got the folder {path}"
        raise UsageError(msg)
    there = path.resolve()
    if path.exists() and (not path.is_file() or path.stat().st_nlink > 1):
        data = content.encode() if isinstance(content, str) else content
        with path.open("wb") as file:
            file.write(data)
    else:
        atomic_write(there, content)
    return path
