"""The fault table's frame: what is provoked, how it ended, how rows are kept.

A topic is a module ``provoke_<topic>.py`` beside this file with one public function::

    def provoke(count: int) -> Iterator[Row]: ...

`count` is how often a fault that has many variants is tried. Every attempt ends in one word:

- ``refused``: an error with a name, or the damage was put aside and said so,
- ``recovered``: what was whole was kept, and the report says what was lost,
- ``harmless``: nothing that is read differs,
- ``silent``: something differs and nothing was said. There must be none.
"""

import dataclasses
import json
from collections import Counter
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from cpl.rng import stream
from cpl.store import atomic_write

__all__ = ["OUTCOMES", "Row", "damaged", "table", "tally", "write"]

OUTCOMES = ("refused", "recovered", "harmless", "silent")


@dataclasses.dataclass(frozen=True, kw_only=True)
class Row:
    """One kind of fault in one place, and how its attempts ended.

    `worst_mb` and `worst_s` are the most memory [MB] and processor time [s] that one of them took,
    where that is measured.
    """

    place: str
    fault: str
    tried: int
    refused: int
    recovered: int
    harmless: int
    silent: int
    worst_mb: float | None = None
    worst_s: float | None = None


def tally(place: str, fault: str, outcomes: Iterable[str]) -> Row:
    """Count how attempts ended.

    Raises:
        ValueError: for an ending that is none of `OUTCOMES`.
    """
    counted = Counter(outcomes)
    if unknown := counted.keys() - set(OUTCOMES):
        raise ValueError(f"outcomes must be of {OUTCOMES}, got {sorted(unknown)}")
    numbers = {name: counted.get(name, 0) for name in OUTCOMES}
    return Row(place=place, fault=fault, tried=sum(numbers.values()), **numbers)


def damaged(content: bytes, how: str, count: int, seed: int = 0) -> Iterator[bytes]:
    """Yield damaged copies: ``cut`` short at, or with one bit ``flip``ped in, drawn places."""
    rng = stream(seed, "faults", how, len(content))
    for _ in range(count):
        if how == "cut":
            yield content[: int(rng.integers(len(content)))]
        else:
            bit = int(rng.integers(8 * len(content)))
            copy = bytearray(content)
            copy[bit // 8] ^= 1 << bit % 8
            yield bytes(copy)


def write(path: Path, topic: str, rows: Iterable[Row], about: dict[str, Any]) -> Path:
    """Keep a topic's table beside those of the others, whole or not at all."""
    told = json.loads(path.read_text(encoding="utf-8")) if path.is_file() else {}
    told[topic] = {**about, "rows": [dataclasses.asdict(row) for row in rows]}
    return atomic_write(path, json.dumps(dict(sorted(told.items())), indent=1) + "\n")


def table(rows: Iterable[Row]) -> str:
    """Show the rows."""
    head = ("place", "fault", "tried", *OUTCOMES, "MB", "s")
    lines = [head, *(tuple(map(_shown, dataclasses.astuple(row))) for row in rows)]
    widths = [max(len(line[i]) for line in lines) for i in range(len(head))]
    shown = []
    for line in lines:
        words = [
            c.ljust(w) if i < 2 else c.rjust(w)
            for i, (c, w) in enumerate(zip(line, widths, strict=True))
        ]
        shown.append("  ".join(words).rstrip())
    return "\n".join(shown)


def _shown(value: object) -> str:
    return "" if value is None else str(value)
