"""What can be wrong with a log, one name a fault.

Every error says in which file and at which record. The same classes name what a recovery dropped:
a :class:`Fault` is an error that was survived.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

__all__ = [
    "DamagedLogError",
    "DuplicateChannelError",
    "EmptyLogError",
    "Fault",
    "FrameError",
    "LogError",
    "MissingChannelError",
    "NotALogError",
    "NotFiniteError",
    "ProvenanceError",
    "QuaternionError",
    "RangeError",
    "SchemaError",
    "TimeOrderError",
    "UnitError",
    "printable",
]

LONGEST = 2000  # [characters] of one message


def printable(text: str) -> str:
    r"""Return a text that may go to a terminal as it is.

    Names in a log are somebody else's text. Control characters, and those that turn the direction
    of writing, are written as Python writes them.

    >>> print(printable("topic /x\x1b[2J"))
    topic /x\x1b[2J
    """
    if len(text) > LONGEST:
        text = f"{text[:LONGEST]}... ({len(text)} characters)"
    if text.isprintable():
        return text
    return "".join(
        each if each.isprintable() else each.encode("unicode_escape").decode() for each in text
    )


class LogError(ValueError):
    """A log that cannot be used, or not as it was asked for.

    Args:
        what: What is wrong.
        path: The file.
        where: The record in it; empty if it is the file as a whole.

    Examples:
        >>> str(TimeOrderError("time goes from 1.2 s to 0.3 s", path="run.mcap", where="row 13"))
        'run.mcap: row 13: time goes from 1.2 s to 0.3 s'
    """

    def __init__(self, what: str, *, path: Path | str, where: str = "") -> None:
        self.what, self.path, self.where = printable(what), Path(path), printable(where)
        parts = (printable(self.path.name), self.where, self.what)
        super().__init__(": ".join(part for part in parts if part))


class NotALogError(LogError):
    """The file is of no kind that is read here."""


class EmptyLogError(LogError):
    """There is not one usable row."""


class DamagedLogError(LogError):
    """Bytes are missing or are not those that were written."""


class SchemaError(LogError):
    """A message or a table is not laid out as it should be."""


class MissingChannelError(LogError):
    """A channel or column is not there."""


class DuplicateChannelError(LogError):
    """A channel, column or message is there twice."""


class UnitError(LogError):
    """A unit is unknown, missing, or contradicted by the numbers."""


class FrameError(LogError):
    """A frame is unknown, missing, or contradicted by the numbers."""


class TimeOrderError(LogError):
    """Time stands still or runs backwards."""


class NotFiniteError(LogError):
    """A number that must be known is NaN or infinite."""


class QuaternionError(LogError):
    """An attitude is not a unit quaternion, or contradicts the heading beside it."""


class RangeError(LogError):
    """A value outside what it can be, such as a confidence of 7."""


class ProvenanceError(LogError):
    """Where the log comes from is not stated, or not in one of the four words for it."""


@dataclass(frozen=True, kw_only=True)
class Fault:
    """What was wrong and survived: an error, and how many rows it cost.

    Attributes:
        error: The class that names it.
        where: The record.
        what: What is wrong and what was done about it.
        rows: Rows that were dropped for it; 0 if none, or if their number is unknown.
    """

    error: type[LogError]
    where: str
    what: str
    rows: int = 0

    @property
    def name(self) -> str:
        """The error's name without its ending, such as ``TimeOrder``."""
        return self.error.__name__.removesuffix("Error")

    def raised(self, path: Path) -> LogError:
        """Return the error that a strict reader raises."""
        return self.error(self.what, path=path, where=self.where)

    def __str__(self) -> str:
        lost = f" ({self.rows} row{'s' * (self.rows != 1)} dropped)" if self.rows else ""
        return f"{self.name}: {printable(self.where)}: {printable(self.what)}{lost}"
