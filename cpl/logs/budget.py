"""How much of a file is read, whatever it declares: memory below 256 MB, time linear in its size.

A file says how long its records are, how many rows it has and what its compressed parts unpack to,
and nothing keeps it from lying. So nothing here is asked for because a file declares it: bytes are
read in pieces, what unpacks is counted while it comes out, and tables stop growing at a number of
values that fits into memory. Where a limit is met, the log is not called whole, and says why.
"""

from __future__ import annotations

from dataclasses import dataclass, field

__all__ = [
    "LARGEST_FILE",
    "LONGEST_LINE",
    "MOST_COLUMNS",
    "MOST_RECORDS",
    "MOST_VALUES",
    "PIECE",
    "Budget",
    "OverBudgetError",
]

LARGEST_FILE = 1 << 31  # [byte]
PIECE = 1 << 20  # [byte] read or unpacked at a time
LONGEST_LINE = 1 << 20  # [byte] of a text table
LARGEST_MESSAGE = 1 << 20  # [byte] a pose has less than 1 kB
MOST_COLUMNS = 4096  # of a text table
MOST_RECORDS = 1_000_000  # chunks, indexes and descriptions of a file
MOST_VALUES = 8_000_000  # numbers in a table; 64 MB: at 200 Hz and 13 columns, 51 minutes
UNPACKED_FREE = 16 << 20  # [byte] that any file may unpack to
UNPACKED_TIMES = 100  # [-] that a file may unpack to, beyond; odometry at rest reaches 40
RECORDS_FREE = 500_000  # that any file may have, inside of chunks
BYTES_A_RECORD = 8  # [byte] of the file for each record beyond; odometry at rest takes 17


class OverBudgetError(Exception):
    """A file asks for more than any recording of its size needs."""


@dataclass(kw_only=True)
class Budget:
    """What is left to spend on one file.

    Args:
        size: The file's size [byte].

    Examples:
        >>> budget = Budget(size=10)
        >>> budget.unpack(UNPACKED_FREE)
        >>> budget.unpack(2000)
        Traceback (most recent call last):
        ...
        cpl.logs.budget.OverBudgetError: unpacks to more than 16.8 MB, beyond what 10 bytes may
    """

    size: int
    unpacked: int = field(default=0, init=False)
    records: int = field(default=0, init=False)
    tried: int = field(default=0, init=False)

    @property
    def most_unpacked(self) -> int:
        """To how many bytes the file may unpack."""
        return UNPACKED_FREE + UNPACKED_TIMES * self.size

    def again(self) -> None:
        """Begin to count anew: the file is gone through a second time."""
        self.unpacked = self.records = 0

    def unpack(self, count: int) -> None:
        """Account for bytes that came out of a compressed part.

        Raises:
            OverBudgetError: More came out than may.
        """
        self.unpacked += count
        if self.unpacked > self.most_unpacked:
            most = self.most_unpacked / 1e6
            msg = f"unpacks to more than {most:.1f} MB, beyond what {self.size} bytes may"
            raise OverBudgetError(msg)

    def record(self, count: int = 1) -> None:
        """Account for records that were taken from a chunk.

        Raises:
            OverBudgetError: There are more than may be.
        """
        self.records += count
        if self.records > RECORDS_FREE + self.size // BYTES_A_RECORD:
            msg = f"has more than {self.records - 1} records, beyond what {self.size} bytes may"
            raise OverBudgetError(msg)

    def look(self, count: int) -> None:
        """Account for bytes that were read in search of the next sound record.

        Raises:
            OverBudgetError: The search has read the file four times over.
        """
        self.tried += count
        if self.tried > UNPACKED_FREE + 4 * self.size:
            msg = "holds so many false beginnings of records that the search was given up"
            raise OverBudgetError(msg)
