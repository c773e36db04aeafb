"""Tables of the book: rows in, one Markdown table out, so that a page can link and typeset it.

A DataFrame's own HTML cuts long texts and knows neither links nor formulas. A Markdown table is
typeset by the book like the text around it: a broken reference in it fails the build.

Example:
    >>> print(table([{"rule": "fixed", "share": 0.10042}], {"share": "{:.2f}"}).markdown)
    | rule | share |
    |:---|---:|
    | fixed | 0.10 |
"""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from numbers import Number
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["Table", "bench_table", "rows_or_note", "table"]


@dataclass(frozen=True)
class Table:
    """A table that a notebook shows as Markdown."""

    markdown: str
    """The table's source."""

    def _repr_markdown_(self) -> str:
        return self.markdown

    def __str__(self) -> str:
        return self.markdown


def table(
    rows: "pd.DataFrame | Iterable[Mapping[str, object]]",
    formats: Mapping[str, str] | None = None,
    *,
    columns: Mapping[str, str] | None = None,
) -> Table:
    r"""Lay out rows as a table.

    Args:
        rows: a DataFrame, or one mapping a row with the same keys in each.
        formats: how to write a column's values, such as `"{:.1%}"`; as text otherwise.
        columns: which columns to show, in this order, and the heading of each; all by default.

    Returns:
        The table, numbers to the right, texts to the left. Bars and line breaks in texts are made
        harmless, other markup is kept.

    Raises:
        ValueError: if there is no row, or a column is missing.

    Example:
        >>> rows = [{"x": 1, "note": "a | b"}]
        >>> print(table(rows, columns={"note": "remark", "x": "$x$"}))
        | remark | $x$ |
        |:---|---:|
        | a \| b | 1 |
    """
    records = list(rows) if not hasattr(rows, "to_dict") else rows.to_dict("records")  # type: ignore[union-attr]
    if not records:
        msg = "rows must hold at least one row, got none"
        raise ValueError(msg)
    shown = columns or {str(key): str(key) for key in records[0]}
    missing = [key for key in shown if any(key not in record for record in records)]
    if missing:
        msg = f"columns must name columns of rows, got {', '.join(map(repr, missing))}"
        raise ValueError(msg)
    write = dict(formats or {})
    lines = [
        _line(shown.values()),
        "|" + "".join(_alignment([record[key] for record in records]) for key in shown),
        *(_line(write.get(key, "{}").format(record[key]) for key in shown) for record in records),
    ]
    return Table("\n".join(lines))


def rows_or_note(
    rows: "pd.DataFrame", columns: Mapping[str, str], formats: Mapping[str, str]
) -> Table:
    r"""Return rows as a table or, where there are none, a line that says so.

    For rows that come from somebody's file: their texts are shown as they are, so that no markup in
    them comes alive on the page.

    Args:
        rows: what is shown.
        columns: which columns, and the heading of each.
        formats: how to write their values.

    Example:
        >>> import pandas as pd
        >>> print(rows_or_note(pd.DataFrame({"n": []}), {"n": "number"}, {}))
        *These logs do not have what this table needs; see what is missing above.*
        >>> print(rows_or_note(pd.DataFrame({"n": ["<script>"]}), {"n": "name"}, {}))
        | name |
        |:---|
        | \<script\> |
    """
    if not len(rows):
        return Table("*These logs do not have what this table needs; see what is missing above.*")
    plain = [
        {key: _literal(value) if isinstance(value, str) else value for key, value in row.items()}
        for row in rows.to_dict("records")
    ]
    return table(plain, formats, columns=columns)


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
        line = lines.setdefault((what, row["subject"]), {"what": what, "who": row["subject"]})
        line["measured"] = f"{_rounded(row['value'])} {row['unit']}"
        for peer in peers:
            line.setdefault(f"times {peer}", "")
        if row["peer"]:
            line[f"times {row['peer']}"] = _rounded(row["ratio"])
    return table(lines.values())


def _alignment(values: Sequence[object]) -> str:
    """Texts to the left, numbers to the right."""
    return "---:|" if all(isinstance(value, Number) for value in values) else ":---|"


def _line(cells: Iterable[str]) -> str:
    return "| " + " | ".join(_cell(text) for text in cells) + " |"


def _cell(text: str) -> str:
    return " ".join(text.split()).replace("|", r"\|")


def _literal(text: str) -> str:
    """Write a text so that Markdown shows it letter by letter."""
    return re.sub(r"([\\`*_{}\[\]()<>#$~:&!^'\"])", r"\\\1", text)


def _rounded(value: float) -> str:
    """Three digits, and no exponent."""
    return f"{float(f'{value:.3g}'):,.10g}"
