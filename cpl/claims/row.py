"""A row of the ledger: a claim with what was found, and how rows are shown on a page."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["ClaimsTable", "Effect", "EffectsTable", "MachinesTable", "Row", "TwinTable"]


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
        where: Place in the paper, or in this book.
        formula: The claim typeset, in LaTeX.
        unit: Of the number; ``1`` where it has none.
        margin: The smallest effect that matters, or the level claimed, with the reason.
        conditions: The effects that decided, each with `name, value, low, high, needed, verdict`.
        beside: The same for what is told beside it and decides nothing.
        would_change: Which data would change the verdict.
        seeds_needed: How many seeds would decide an undecided row, if the estimate stays.
        order: Which came first, the rule or the data.
        before: Verdict of the first edition, if the row was in it.
        revised: What the second edition changed in the rule, and why.
        in_the_twin: What the simulated quadruped shows of a claim about the robot, which is never a
            verdict; None where nobody asked it, or its results are not published.
        on_other_machines: What recordings of other machines show of it, likewise no verdict.
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
    where: str = ""
    formula: str = ""
    unit: str = "1"
    margin: str = ""
    conditions: tuple[Effect, ...] = ()
    beside: tuple[Effect, ...] = ()
    would_change: str = ""
    seeds_needed: int | None = None
    order: str = ""
    before: str | None = None
    revised: str = ""
    in_the_twin: str | None = None
    on_other_machines: str | None = None


@dataclass(frozen=True, kw_only=True)
class Effect:
    """One condition of a claim as it was found.

    Attributes:
        name: Where, or between what.
        value: The effect, positive in the claimed direction.
        low: Lower end of its 95 % interval.
        high: Upper end.
        needed: What it has to reach.
        verdict: What is to be said of it alone.
    """

    name: str
    value: float
    low: float
    high: float
    needed: float
    verdict: str


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
class EffectsTable:
    """Effects named ``column: line``, side by side, as a Markdown table."""

    effects: tuple[Effect, ...]
    corner: str

    def _repr_markdown_(self) -> str:
        return str(self)

    def __str__(self) -> str:
        cells = {tuple(one.name.split(": ", 1)[::-1]): _cell(one) for one in self.effects}
        lines, columns = (list(dict.fromkeys(key[k] for key in cells)) for k in (0, 1))
        head = f"| {self.corner} | " + " | ".join(columns) + " |"
        rule = "|:---|" + "---:|" * len(columns)
        body = [
            f"| {line} | " + " | ".join(cells.get((line, column), "") for column in columns) + " |"
            for line in lines
        ]
        return "\n".join([head, rule, *body])


@dataclass(frozen=True)
class TwinTable:
    """Rows that need the robot, with what the twin shows, as a Markdown table."""

    rows: tuple[Row, ...]

    def _repr_markdown_(self) -> str:
        return str(self)

    def __str__(self) -> str:
        lines = ["| # | claim | verdict | in the twin |", "|---:|:---|:---|:---|"]
        return "\n".join([*lines, *(_twin_line(row) for row in self.rows)])


@dataclass(frozen=True)
class MachinesTable:
    """Rows with what recordings of other machines show of them, as a Markdown table."""

    rows: tuple[Row, ...]

    def _repr_markdown_(self) -> str:
        return str(self)

    def __str__(self) -> str:
        lines = ["| # | claim | verdict | on other machines |", "|---:|:---|:---|:---|"]
        return "\n".join([*lines, *(_machines_line(row) for row in self.rows)])


def _line(row: Row) -> str:
    interval = "" if row.low is None or row.high is None else f"{row.low:.4g} to {row.high:.4g}"
    ours = "" if row.value is None else f"{row.value:.4g}"
    marks = f" ({', '.join(row.flags)})" if row.flags and row.verdict not in row.flags else ""
    cells = [str(row.row), row.claim, row.paper_value or "", ours, interval, row.verdict + marks]
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def _cell(one: Effect) -> str:
    return f"{one.value:+.2f} ({one.low:+.2f} to {one.high:+.2f})"


def _twin_line(row: Row) -> str:
    cells = [str(row.row), row.claim, row.verdict, row.in_the_twin or "not published"]
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def _machines_line(row: Row) -> str:
    cells = [str(row.row), row.claim, row.verdict, row.on_other_machines or "not published"]
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"
