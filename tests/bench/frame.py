"""The bench's frame: what a row is, how time is taken, how rows are kept and shown.

A topic is a module ``bench_<topic>.py`` beside this file with one public function::

    def measure() -> Iterator[Row]: ...

and, if its numbers depend on more than the interpreter, numpy and numba,
``PACKAGES = ("name", ...)`` with the distributions whose versions belong beside them.

Two habits keep the numbers honest on a shared machine: a subject and its peer are timed in the
same run, in turns, and of the rounds the fastest counts, since noise only ever adds time.
"""

import dataclasses
import gc
import json
import os
import platform
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from cpl.store import atomic_write

__all__ = ["Row", "compare", "fastest", "machine", "merge", "read", "table", "versions", "write"]

COLUMNS = ("bench", "subject", "peer", "value", "unit", "ratio")


@dataclasses.dataclass(frozen=True, kw_only=True)
class Row:
    """One measured number.

    Attributes:
        bench: What was measured, e.g. ``"conformal: fixed step, T=1e6"``.
        subject: Whose number it is, e.g. ``"cpl track"``.
        value: The number.
        unit: Its unit, e.g. ``"ns/step"``.
        peer: Whom the subject is compared with; empty for a number that stands alone.
        ratio: How many times better than the peer (> 1: better than the peer); None without one.
        limit: The number that was aimed at, in the same unit; None if there is none.
    """

    bench: str
    subject: str
    value: float
    unit: str
    peer: str = ""
    ratio: float | None = None
    limit: float | None = None


def fastest(
    subjects: Mapping[str, Callable[[], Any]],
    *,
    rounds: int = 7,
    clock: Callable[[], float] = time.process_time,
) -> dict[str, float]:
    """Time callables in turns and return the fastest round of each.

    Each is called once untimed, so that compiling and caches are paid for before.

    Args:
        subjects: The callables, by name.
        rounds: How often each is timed.
        clock: Processor time of this process, or ``time.perf_counter`` where threads or other
            processes do the work.

    Returns:
        Seconds, by name.
    """
    best = dict.fromkeys(subjects, float("inf"))
    for call in subjects.values():
        call()
    collecting = gc.isenabled()
    gc.disable()
    try:
        for _ in range(rounds):
            for name, call in subjects.items():
                start = clock()
                call()
                best[name] = min(best[name], clock() - start)
    finally:
        if collecting:
            gc.enable()
    return best


def compare(
    bench: str,
    seconds: Mapping[str, float],
    *,
    per: Mapping[str, float] | float,
    unit: str,
    scale: float,
    peer: str,
    limits: Mapping[str, float] | None = None,
) -> list[Row]:
    """Turn timings into rows, each compared with one peer.

    Args:
        bench: What was measured.
        seconds: Fastest times by subject, the peer among them.
        per: How many units of work one call did, for all subjects or by subject.
        unit: The unit of the value, e.g. ``"ns/step"``.
        scale: Units in a second, e.g. 1e9 for nanoseconds.
        peer: The subject that the others are compared with.
        limits: What was aimed at, by subject, in the unit.

    Returns:
        One row a subject; the ratio is the peer's value over the subject's.
    """
    share = dict.fromkeys(seconds, per) if isinstance(per, int | float) else per
    values = {name: scale * taken / share[name] for name, taken in seconds.items()}
    return [
        Row(
            bench=bench,
            subject=name,
            value=value,
            unit=unit,
            peer="" if name == peer else peer,
            ratio=None if name == peer else values[peer] / value,
            limit=(limits or {}).get(name),
        )
        for name, value in values.items()
    ]


def machine() -> str:
    """Return what the numbers were measured on: system, processor, number of cores."""
    names = [
        line.partition(":")[2].strip()
        for line in _lines(Path("/proc/cpuinfo"))
        if line.startswith("model name")
    ]
    processor = names[0] if names else platform.processor()
    return f"{platform.system()} {platform.machine()}, {processor}, {os.cpu_count()} cores"


def versions(packages: Iterable[str]) -> str:
    """Return the versions of Python and of the named distributions on one line."""
    found = [f"python {platform.python_version()}"]
    for name in packages:
        try:
            found.append(f"{name} {version(name)}")
        except PackageNotFoundError:
            found.append(f"{name} absent")
    return ", ".join(found)


def read(path: Path) -> list[dict[str, Any]]:
    """Return the rows kept in ``path``; none if the file does not exist."""
    return json.loads(path.read_text(encoding="utf-8")) if path.exists() else []


def merge(
    old: Sequence[Mapping[str, Any]], new: Sequence[Mapping[str, Any]], topics: Iterable[str]
) -> list[dict[str, Any]]:
    """Replace the rows of the topics that were run and keep those of the others."""
    ran = set(topics)
    kept = [dict(row) for row in old if row["topic"] not in ran]
    return sorted([*kept, *map(dict, new)], key=lambda row: row["topic"])


def write(path: Path, rows: Sequence[Mapping[str, Any]]) -> None:
    """Write the rows as JSON, whole or not at all."""
    atomic_write(path, json.dumps(rows, indent=1, ensure_ascii=False) + "\n")


def table(rows: Sequence[Mapping[str, Any]]) -> str:
    """Return the rows as an aligned text table, one block a bench."""
    head = ("subject", "value", "unit", "aim", "times the peer", "peer")
    cells = [head, *(_cells(row) for row in rows)]
    widths = [max(len(line[k]) for line in cells) for k in range(len(head))]
    texts = [
        "  "
        + "  ".join(
            cell.rjust(width) if k in {1, 3, 4} else cell.ljust(width)
            for k, (cell, width) in enumerate(zip(line, widths, strict=True))
        ).rstrip()
        for line in cells
    ]
    lines = texts[:1]
    for before, row, text in zip([None, *rows], rows, texts[1:], strict=False):
        if before is None or before["bench"] != row["bench"]:
            lines.append(row["bench"])
        lines.append(text)
    return "\n".join(lines)


def _cells(row: Mapping[str, Any]) -> tuple[str, ...]:
    aim = "" if row.get("limit") is None else f"<= {row['limit']:g}"
    ratio = "" if row["ratio"] is None else f"{row['ratio']:.3g}"
    return row["subject"], f"{row['value']:.4g}", row["unit"], aim, ratio, row["peer"]


def _lines(path: Path) -> list[str]:
    return path.read_text(encoding="utf-8").splitlines() if path.exists() else []
