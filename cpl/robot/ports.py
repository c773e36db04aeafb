"""UDP as it is used here: on the loopback interface unless somebody means it otherwise."""

from __future__ import annotations

import errno
import ipaddress
import socket
from collections.abc import Iterator

__all__ = [
    "LOOPBACK",
    "Address",
    "address",
    "drain",
    "drain_from",
    "free_port",
    "is_loopback",
    "receiver",
    "send",
]

LOOPBACK = "127.0.0.1"
LARGEST = 2048  # [byte] no datagram here is larger
BURST = 500  # datagrams taken at once: a flood must not hold up what is sent

Address = tuple[str, int]

_PASSING = {
    errno.EAGAIN, errno.ENOBUFS, errno.ECONNREFUSED, errno.ENETDOWN, errno.ENETUNREACH,
    errno.EHOSTDOWN, errno.EHOSTUNREACH, errno.EADDRNOTAVAIL, errno.ENODEV, errno.EPERM,
    errno.EINVAL, errno.ENONET, errno.EMSGSIZE, errno.EINTR, errno.EPIPE, errno.ENOMEM,
    errno.ETIMEDOUT,
}  # fmt: skip
"""What the operating system says of a link that is away, or of a moment without memory."""


def receiver(port: int = 0, host: str = LOOPBACK) -> socket.socket:
    """Return a socket that does not block, bound to a port; 0 for any that is free.

    Raises:
        ValueError: The port is taken or cannot be bound.
    """
    made = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    try:
        made.bind((host, port))
    except OSError as error:
        made.close()
        raise ValueError(f"port must be free, not {port} of {host} ({error.strerror})") from error
    made.setblocking(False)
    return made


def drain(there: socket.socket) -> Iterator[bytes]:
    """Yield the datagrams that have arrived, oldest first."""
    for data, _ in drain_from(there):
        yield data


def drain_from(there: socket.socket) -> Iterator[tuple[bytes, Address]]:
    """Yield the datagrams that have arrived, with their senders."""
    for _ in range(BURST):
        try:
            yield there.recvfrom(LARGEST)
        except BlockingIOError:
            return
        except OSError as error:
            if error.errno not in _PASSING:
                raise
            # Said once for each datagram that was lost; those behind it can still be read.


def send(there: socket.socket, data: bytes, to: Address | None = None) -> bool:
    """Send a datagram and say whether the operating system took it.

    A cable that is away, a full queue or a port where nobody listens is a lost datagram and no
    reason to end: whoever streams must still be there when the link comes back.
    """
    try:
        if to is None:
            there.send(data)
        else:
            there.sendto(data, to)
    except OSError as error:
        if error.errno not in _PASSING:
            raise
        return False
    return True


def free_port() -> int:
    """Return a UDP port of the loopback interface that is free now."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind((LOOPBACK, 0))
        return probe.getsockname()[1]


def address(text: str) -> Address:
    """Read HOST:PORT, the host as a number.

    Raises:
        ValueError: It is not that.

    >>> address("192.168.123.161:8082")
    ('192.168.123.161', 8082)
    """
    host, colon, port = text.rpartition(":")
    try:
        ipaddress.IPv4Address(host)
        number = int(port)
    except ValueError as error:
        raise ValueError(f"address must be like 127.0.0.1:8082, not {text!r}") from error
    if not (colon and 0 < number < 65536):
        raise ValueError(f"address must be like 127.0.0.1:8082, not {text!r}")
    return host, number


def is_loopback(host: str) -> bool:
    """Say whether an address is this very machine.

    >>> is_loopback("127.0.0.1"), is_loopback("192.168.123.161")
    (True, False)
    """
    return ipaddress.IPv4Address(host).is_loopback
