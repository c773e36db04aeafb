"""A row of the ledger: a claim with what was found, and how rows are shown on a page."""

from dataclasses import dataclass

__all__ = ["ClaimsTable", "Row", "TwinTable"]


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


def _line(row: Row) -> str:
    interval = "" if row.low is None or row.high is None else f"{row.low:.4g} to {row.high:.4g}"
    ours = "" if row.value is None else f"{row.value:.4g}"
    marks = f" ({', '.join(row.flags)})" if row.flags and row.verdict not in row.flags else ""
    cells = [str(row.row), row.claim, row.paper_value or "", ours, interval, row.verdict + marks]
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def _twin_line(row: Row) -> str:
    cells = [str(row.row), row.claim, row.verdict, row.in_the_twin or "not published"]
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"
