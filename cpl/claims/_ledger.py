"""From claims and rules to rows, to a table for a page, and to the verdicts that are committed."""

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

from cpl.claims import (
    _own,
    _rules,
    _rules_forecast,
    _rules_highway,
    _rules_listening,
    _rules_robot,
    _rules_table1,
)
from cpl.claims._reading import Reader, Source
from cpl.claims._rules_quadruped import IN_THE_TWIN
from cpl.claims._statements import CLAIMS, Claim
from cpl.claims._verdicts import Finding, Verdict
from cpl.store import DamagedResultError, atomic_write, data_path, read_published

__all__ = [
    "RULES",
    "ClaimsTable",
    "Row",
    "TwinTable",
    "accept",
    "attempts",
    "changes",
    "ledger",
    "own",
    "show",
    "show_twin",
]

RULES: dict[int, Callable[[Reader], Finding]] = {
    **_rules.RULES,
    **_rules_highway.RULES,
    **_rules_forecast.RULES,
    **_rules_table1.RULES,
    **_rules_listening.RULES,
    **_rules_robot.RULES,
    **_own.RULES,
}
"""The rules by row; a row without one is pending, or needs hardware."""

_PROFILE = "paper"
Answer = TypeVar("Answer")


@dataclass(frozen=True, kw_only=True)
class Row:
    """One claim with what was found.

    Attributes:
        row: Its number.
        claim: What the paper claims, in our words.
        paper_value: The number the paper gives, if any.
        value: Our number; what it is, `rule` says. None while pending.
        low: Lower end of its 95 % interval.
        high: Upper end.
        n: Units looked at.
        n_seeds: Seeds they come from.
        rule: What the number is, and what decides.
        verdict: The verdict.
        flags: What a reader must know beside it.
        chapter: Slug of the chapter that shows it.
        computed_from: Published results it rests on, as `experiment/profile@content`.
        in_the_twin: What the simulated quadruped shows of a claim about the robot, which is never a
            verdict; None where nobody asked it, or its results are not published.
    """

    row: int
    claim: str
    paper_value: str | None
    value: float | None
    low: float | None
    high: float | None
    n: int | None
    n_seeds: int | None
    rule: str
    verdict: str
    flags: tuple[str, ...]
    chapter: str
    computed_from: tuple[str, ...]
    in_the_twin: str | None = None


@dataclass(frozen=True)
class ClaimsTable:
    """Rows of the ledger that a notebook shows as a Markdown table."""

    rows: tuple[Row, ...]

    def _repr_markdown_(self) -> str:
        return str(self)

    def __str__(self) -> str:
        lines = [
            "| # | claim | paper | ours | 95 % interval | verdict |",
            "|---:|:---|:---|---:|---:|:---|",
        ]
        return "\n".join([*lines, *(_line(row) for row in self.rows)])


@dataclass(frozen=True)
class TwinTable:
    """Rows that need the robot, with what the twin shows, as a Markdown table."""

    rows: tuple[Row, ...]

    def _repr_markdown_(self) -> str:
        return str(self)

    def __str__(self) -> str:
        lines = ["| # | claim | verdict | in the twin |", "|---:|:---|:---|:---|"]
        return "\n".join([*lines, *(_twin_line(row) for row in self.rows)])


def ledger(root: Path | None = None) -> list[Row]:
    """Return all rows; see `cpl.claims.ledger`."""
    return [_row(claim, root) for claim in CLAIMS]


def own(root: Path | None = None) -> list[Row]:
    """Return the rows of the book's own claims; see `cpl.claims.own`."""
    return [_row(claim, root) for claim in _own.CLAIMS]


def attempts(root: Path | None = None) -> tuple[list[Row], dict[int, str]]:
    """Return the rows that can be decided, and why the others cannot.

    For results that may be too few, such as those of a single training seed.
    """
    rows: list[Row] = []
    undecided: dict[int, str] = {}
    for claim in (*CLAIMS, *_own.CLAIMS):
        try:
            rows.append(_row(claim, root))
        except DamagedResultError:
            raise
        except ValueError as error:
            undecided[claim.row] = str(error)
    return rows, undecided


def show(numbers: Sequence[int]) -> ClaimsTable:
    """Return the rows of the given numbers, or all; see `cpl.claims.table`."""
    known = {claim.row: claim for claim in (*CLAIMS, *_own.CLAIMS)}
    for number in numbers:
        if number not in known:
            msg = f"rows must lie in [1, {len(known)}], got {number!r}"
            raise ValueError(msg)
    return ClaimsTable(
        tuple(_row(known[number], None) for number in numbers or range(1, len(CLAIMS) + 1))
    )


def show_twin() -> TwinTable:
    """Return the rows that the twin was asked about; see `cpl.claims.twin_table`."""
    return TwinTable(tuple(_row(claim, None) for claim in CLAIMS if claim.row in IN_THE_TWIN))


def changes(root: Path | None = None) -> dict[int, tuple[str, str]]:
    """Compare with the committed verdicts; see `cpl.claims.changes`."""
    path = _committed(root)
    before = json.loads(path.read_text(encoding="utf-8")) if path.is_file() else {}
    return {
        row.row: (before.get(str(row.row), "none"), row.verdict)
        for row in (*ledger(root), *own(root))
        if before.get(str(row.row), "none") != row.verdict
    }


def accept(root: Path | None = None) -> Path:
    """Write the verdicts of now; see `cpl.claims.accept`."""
    verdicts = {str(row.row): row.verdict for row in (*ledger(root), *own(root))}
    return atomic_write(_committed(root), json.dumps(verdicts, indent=1) + "\n")


def _committed(root: Path | None) -> Path:
    return (data_path("results") if root is None else root) / "verdicts.json"


def _row(claim: Claim, root: Path | None) -> Row:
    found, used = _found(RULES.get(claim.row), root)
    leaning, beside = _found(IN_THE_TWIN.get(claim.row), root)
    flags = (*claim.flags, *(found.flags if found else ()))
    return Row(
        row=claim.row,
        claim=claim.claim,
        paper_value=claim.paper_value,
        value=found.value if found else None,
        low=found.low if found else None,
        high=found.high if found else None,
        n=found.n if found else None,
        n_seeds=found.n_seeds if found else None,
        rule=claim.rule,
        verdict=str(found.verdict if found else _without_results(claim)),
        flags=flags,
        chapter=claim.chapter,
        computed_from=(*used, *beside),
        in_the_twin=str(leaning) if leaning else None,
    )


def _found(
    rule: Callable[[Reader], Answer] | None, root: Path | None
) -> tuple[Answer | None, list[str]]:
    """Apply a rule, noting what it reads; None if it has none or not all is published."""
    used: list[str] = []

    def read(experiment: str) -> Source:
        table, manifest = read_published(experiment, _PROFILE, root=root)
        name = f"{experiment}/{_PROFILE}@{manifest.content[:12]}"
        used.extend([name] if name not in used else [])
        return Source(table=table, parameters=manifest.parameters)

    try:
        return (rule(read), used) if rule else (None, [])
    except FileNotFoundError:
        return None, []


def _without_results(claim: Claim) -> Verdict:
    return Verdict.HARDWARE if "needs hardware" in claim.flags else Verdict.PENDING


def _line(row: Row) -> str:
    interval = "" if row.low is None or row.high is None else f"{row.low:.4g} to {row.high:.4g}"
    ours = "" if row.value is None else f"{row.value:.4g}"
    marks = f" ({', '.join(row.flags)})" if row.flags and row.verdict not in row.flags else ""
    cells = [str(row.row), row.claim, row.paper_value or "", ours, interval, row.verdict + marks]
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def _twin_line(row: Row) -> str:
    cells = [str(row.row), row.claim, row.verdict, row.in_the_twin or "not published"]
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"
