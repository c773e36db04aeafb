"""The piece of an experiment that is computed, kept and re-executed as a whole."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

__all__ = ["Shard", "parts"]


@dataclass(frozen=True)
class Shard:
    """A name that is unique within the experiment, and what distinguishes this piece.

    Examples:
        >>> Shard("uniform-3", {"kind": "uniform", "part": 3})["part"]
        3
    """

    name: str
    values: Mapping[str, int | float | str] = field(default_factory=dict[str, "int | float | str"])

    def __getitem__(self, key: str) -> int | float | str:
        return self.values[key]

    def number(self, key: str) -> int:
        """Return an integer value."""
        return int(self.values[key])

    def text(self, key: str) -> str:
        """Return a value as text."""
        return str(self.values[key])


def parts(total: int, size: int) -> Iterator[tuple[int, int]]:
    """Cut a number of things into parts of at most a size: part number and its own size.

    Examples:
        >>> list(parts(25, 10))
        [(0, 10), (1, 10), (2, 5)]
    """
    for part, first in enumerate(range(0, total, size)):
        yield part, min(size, total - first)
