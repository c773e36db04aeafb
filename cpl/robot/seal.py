"""Who sent this datagram? A keyed digest says it: BLAKE2b with a key that only this run knows.

A key travels on a pipe or lies in a file that nobody else can read. It never stands in a command
line, in an environment or in a log. Needs the standard library alone: the camera's bridge, which
runs in another Python, imports this file too.
"""

from __future__ import annotations

import hashlib
import hmac
import os
import secrets
import stat
from pathlib import Path
from typing import IO

__all__ = ["KEY_BYTES", "SEAL_BYTES", "SealError", "key_of_file", "key_of_stream", "make_key_file",
           "new_key", "opened", "sealed"]  # fmt: skip

KEY_BYTES = 32
SEAL_BYTES = 16
PRIVATE = stat.S_IRUSR | stat.S_IWUSR  # 600


class SealError(ValueError):
    """A datagram that nobody with the key has sent, or that was changed on its way."""


def new_key() -> bytes:
    """Draw a key from the operating system."""
    return secrets.token_bytes(KEY_BYTES)


def sealed(data: bytes, key: bytes, kind: bytes) -> bytes:
    """Return the datagram with its digest behind it.

    Args:
        data: What is said.
        key: The run's.
        kind: Who speaks to whom, so that no datagram can be turned against its sender.

    >>> there = sealed(b"stand", bytes(32), b"order")
    >>> opened(there, bytes(32), b"order")
    b'stand'
    """
    return data + _digest(data, key, kind)


def opened(data: bytes, key: bytes, kind: bytes) -> bytes:
    """Return what was said.

    Raises:
        SealError: Another key, another kind, or another content than was sealed.
    """
    said, seal = data[:-SEAL_BYTES], data[-SEAL_BYTES:]
    if not hmac.compare_digest(seal, _digest(said, key, kind)):
        raise SealError(f"{len(data)} bytes without the seal of this run")
    return said


def make_key_file(path: Path) -> None:
    """Write a new key where nobody else can read it.

    Raises:
        FileExistsError: There is something at that path.
    """
    handle = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, PRIVATE)
    with os.fdopen(handle, "w") as file:
        file.write(new_key().hex() + "\n")


def key_of_file(path: Path) -> bytes:
    """Read a key that is nobody else's.

    Raises:
        ValueError: The file is another user's, can be read by others, or holds no key.
        OSError: It cannot be opened.
    """
    handle = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK)
    with os.fdopen(handle, "rb") as file:
        found = os.fstat(handle)
        if not stat.S_ISREG(found.st_mode) or found.st_uid != os.geteuid():
            raise ValueError(f"key file must be a file of your own, not {path}")
        if found.st_mode & 0o077:
            mode = f"{stat.S_IMODE(found.st_mode):o}"
            raise ValueError(f"key file must be for you alone (chmod 600 {path}), not mode {mode}")
        return key_of_stream(file)


def key_of_stream(stream: IO[bytes]) -> bytes:
    """Read a key from a pipe or a file: one line of hexadecimal digits.

    Raises:
        ValueError: There is none. What was read instead is not repeated.
    """
    line = stream.readline(2 * KEY_BYTES + 2).strip()
    try:
        key = bytes.fromhex(line.decode("ascii"))
    except ValueError:
        key = b""
    if len(key) != KEY_BYTES:
        raise ValueError(f"a key must be a line of {2 * KEY_BYTES} hexadecimal digits")
    return key


def _digest(data: bytes, key: bytes, kind: bytes) -> bytes:
    if len(key) != KEY_BYTES:
        raise ValueError(f"key must have {KEY_BYTES} bytes, not {len(key)}")
    return hashlib.blake2b(data, digest_size=SEAL_BYTES, key=key, person=kind).digest()
