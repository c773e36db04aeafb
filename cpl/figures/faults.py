"""What happened to what was damaged, killed or made up on purpose: the stored counts as tables."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cpl.figures.table import Table, table

__all__ = ["TOPICS", "Counts", "read", "read_alone"]

TOPICS = {
    "formats": "stored files, cut short or with one bit flipped",
    "logs": "logs whose bytes are whole and whose content cannot be",
    "recordings": "recordings of every format, spoiled where the format is vulnerable",
    "hostile": "what somebody may send us to run their code",
    "kills": "killed processes, full and read-only disks",
    "robot": "datagrams to a robot's processes, from whoever has no key or ill will",
}
"""The topics, in words."""

_OUTCOMES = ("refused", "recovered", "harmless", "silent")
_HEADS = {"place": "where", "fault": "fault", "tried": "tried", "refused": "refused"}
_WORST = {"worst_mb": "memory [MB]", "worst_s": "time [s]"}
_HEADS |= {"recovered": "recovered", "harmless": "harmless", "silent": "wrong and silent"}


@dataclass(frozen=True, kw_only=True)
class Counts:
    """The counts by topic, as `make faults` writes them."""

    topics: Mapping[str, Mapping[str, Any]]

    def total(self, outcome: str = "tried") -> int:
        """Return how many attempts there were, or how many ended in one way."""
        return sum(row[outcome] for topic in self.topics.values() for row in topic["rows"])

    def verdict(self) -> str:
        """Say how many attempts there were and how many were wrong and silent, if any counted."""
        if not self.topics:
            return "The counts are not part of this edition, so nothing is claimed."
        silent = self.total("silent")
        return f"{self.total():,} faults; {silent:,} wrong and silent."

    def where(self) -> str:
        """Say when and where they were counted, and what was not."""
        if not self.topics:
            return "Not counted with this edition: `make faults` counts them."
        topics = list(self.topics.values())
        dates = sorted({part["made"] for part in topics})
        commits = sorted({part["commit"][:8] for part in topics})
        machine = topics[0]["machine"]
        versions = ", ".join(f"{name} {v}" for name, v in topics[0]["versions"].items())
        text = (
            f"Counted {' and '.join(dates)} at {' and '.join(commits)} on {machine['processor']} "
            f"({machine['system']}); {versions}."
        )
        missing = [TOPICS[name] for name in TOPICS if name not in self.topics]
        return f"{text} Not counted: {'; '.join(missing)}." if missing else text

    def summary(self) -> Table:
        """One line a topic."""
        if not self.topics:
            return Table(f"*{self.where()}*")
        rows = [
            {"topic": TOPICS.get(name, name)}
            | {key: sum(row[key] for row in topic["rows"]) for key in ("tried", *_OUTCOMES)}
            for name, topic in self.topics.items()
        ]
        return table(rows, columns={"topic": "topic", **dict(list(_HEADS.items())[2:])})

    def rows(self, topic: str) -> Table:
        """Every kind of fault of a topic.

        Raises:
            ValueError: If there is no such topic.
        """
        if topic not in TOPICS:
            msg = f"topic must be one of {', '.join(TOPICS)}, got {topic!r}"
            raise ValueError(msg)
        if topic not in self.topics:
            return Table(f"*{TOPICS[topic]}: not counted with this edition.*")
        rows = self.topics[topic]["rows"]
        measured = any(row.get("worst_mb") is not None for row in rows)
        return table(rows, columns=_HEADS | (_WORST if measured else {}))

    def worst(self, topic: str) -> str:
        """Say the most memory [MB] and processor time [s] that one attempt of a topic took."""
        rows = self.topics[topic]["rows"] if topic in self.topics else []
        if not rows:
            return "None of them was counted with this edition."
        most_mb, most_s = (max(row.get(n) or 0.0 for row in rows) for n in ("worst_mb", "worst_s"))
        return f"The most that one of them took was {most_mb:.0f} MB and {most_s:.1f} s."


def read(path: Path) -> Counts:
    """Read the stored counts; none of them if there is no such file."""
    topics = json.loads(path.read_text(encoding="utf-8")) if path.is_file() else {}
    return Counts(topics={name: topics[name] for name in TOPICS if name in topics})


def read_alone(damaged: bytes, whole: bytes) -> str:
    """Say how reading a damaged Parquet table ends without any digest.

    Returns:
        `refused`, `harmless` or `silent`, as in the counts.
    """
    from cpl.store import decode_table, same_table

    expected = decode_table(whole)
    try:
        found = decode_table(damaged)
        return "harmless" if same_table(found, expected, rtol=0.0, atol=0.0) is None else "silent"
    except (ValueError, OSError, KeyError):
        return "refused"
