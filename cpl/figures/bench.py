"""The rows of a bench as one table: a line a subject, a column a peer."""

from collections.abc import Iterable, Mapping
from typing import Any

from cpl.figures.table import Table, table

__all__ = ["bench_table"]


def bench_table(rows: Iterable[Mapping[str, Any]]) -> Table:
    """Lay out measured rows.

    Args:
        rows: one mapping a row with `bench`, `subject`, `value`, `unit`, `peer` and `ratio`; a
            subject that was compared with two peers has two rows. What stands before a colon in
            `bench` is the topic and is left out.

    Returns:
        A line a bench and subject with its value, and how many times better than each peer it is.

    Raises:
        ValueError: if there is no row.

    Example:
        >>> row = {"bench": "toy: add", "subject": "ours", "value": 1234.5, "unit": "steps/s"}
        >>> print(bench_table([{**row, "peer": "theirs", "ratio": 12.34}]))
        | what | who | measured | times theirs |
        |:---|:---|:---|:---|
        | add | ours | 1,230 steps/s | 12.3 |
    """
    listed = list(rows)
    peers = list(dict.fromkeys(row["peer"] for row in listed if row["peer"]))
    lines: dict[tuple[str, str], dict[str, object]] = {}
    for row in listed:
        what = str(row["bench"]).partition(":")[2].strip() or str(row["bench"])
        blank = {f"times {peer}": "" for peer in peers}
        told = {"what": what, "who": row["subject"], "measured": _number(row["value"], row["unit"])}
        line = lines.setdefault((what, row["subject"]), told | blank)
        if row["peer"]:
            line[f"times {row['peer']}"] = _rounded(row["ratio"])
    return table(lines.values())


def _number(value: float, unit: str) -> str:
    return f"{_rounded(value)} {unit}"


def _rounded(value: float) -> str:
    """Three digits, and no exponent."""
    return f"{float(f'{value:.3g}'):,.10g}"
