"""Does the number hold? One row a claim of the paper, its verdict computed from stored results.

A claim is a file of `cpl.claims.rows`: the statement and the rule that decides it. Rules read
published tables and nothing else; none of them starts an experiment, and no verdict is typed
anywhere. A row is computed once a process for the same results. The errata are in
`cpl.claims.errata`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pathlib import Path

    from cpl.claims.row import ClaimsTable, EffectsTable, MachinesTable, Row, TwinTable
    from cpl.claims.sheets import Sheet

__all__ = [
    "accept",
    "attempts",
    "changes",
    "committed",
    "discussed_in",
    "fix",
    "ledger",
    "machines_table",
    "own",
    "readings",
    "sheet",
    "table",
    "twin_table",
]


def ledger(*, root: Path | None = None) -> list[Row]:
    """Return one row for each of the paper's checkable claims.

    Args:
        root: Folder of the published results; the project's own unless given.

    Returns:
        Rows with the fields `row, claim, paper_value, value, low, high, n, n_seeds, rule, verdict,
        flags, chapter, computed_from, in_the_twin, on_other_machines`, in order. A claim whose
        results are not published yet says `pending`.

    Raises:
        cpl.store.DamagedResultError: If a published result does not agree with its manifest.

    Examples:
        >>> rows = ledger()
        >>> rows[0].row, rows[41].verdict
        (1, 'needs hardware')
    """
    from cpl.claims._ledger import ledger as _ledger

    return _ledger(root)


def own(*, root: Path | None = None) -> list[Row]:
    """Return one row for each of the book's own claims, numbered after the paper's.

    Args:
        root: As in `ledger`.

    Examples:
        >>> own()[0].chapter
        'earns'
    """
    from cpl.claims._ledger import own as _own

    return _own(root)


def table(*rows: int) -> ClaimsTable:
    """Show claims beside what was found, for a page: all, or those of the given row numbers.

    All are all of the paper's.

    Raises:
        ValueError: If there is no such row.

    Examples:
        >>> print(str(table(42)).splitlines()[0])
        | # | claim | paper | ours | 95 % interval | verdict |
    """
    from cpl.claims._ledger import show as _show

    return _show(rows)


def sheet(*rows: int) -> Sheet:
    """Show claims on a page with all that one needs to judge each: all of the paper's, or some.

    Args:
        rows: Their numbers.

    Raises:
        ValueError: If there is no such row.
    """
    from cpl.claims.sheets import Sheet as _Sheet

    return _Sheet(table(*rows).rows)


def readings(row: int) -> EffectsTable:
    """Show a row's effects by the readings of its words, with its controls beside them.

    Args:
        row: A row whose conditions are named ``over whom: reading``, such as 20.

    Raises:
        ValueError: If there is no such row, or it has no readings.
    """
    from cpl.claims.row import EffectsTable as _EffectsTable

    (one,) = table(row).rows
    effects = (*one.conditions, *one.beside)
    if not effects or not all(": " in effect.name for effect in effects):
        raise ValueError(f"row must have readings, got {row!r}")
    return _EffectsTable(effects, "collisions, speed")


def discussed_in(chapter: str) -> tuple[int, ...]:
    """Return the numbers of the rows that a chapter shows; no rule is asked for it.

    Args:
        chapter: Its slug.

    Examples:
        >>> discussed_in("tracking")
        (3, 6)
    """
    from cpl.claims._ledger import claims as _claims

    return tuple(row for row, claim in _claims().items() if claim.chapter == chapter)


def machines_table() -> MachinesTable:
    """Show the rows that recordings of other machines say something of, which is never a verdict.

    Examples:
        >>> print(str(machines_table()).splitlines()[0])
        | # | claim | verdict | on other machines |
    """
    from cpl.claims._ledger import show_machines

    return show_machines()


def twin_table() -> TwinTable:
    """Show, for a page, what the simulated quadruped shows of the claims that need the robot.

    Examples:
        >>> print(str(twin_table()).splitlines()[0])
        | # | claim | verdict | in the twin |
    """
    from cpl.claims._ledger import show_twin as _show_twin

    return _show_twin()


def changes(*, root: Path | None = None) -> Mapping[int, tuple[str, str]]:
    """Return the rows whose verdict differs from the committed one: row -> (committed, now)."""
    from cpl.claims._ledger import changes as _changes

    return _changes(root)


def committed(*, root: Path | None = None) -> Mapping[int, str]:
    """Return the verdicts that were last accepted, by row.

    Examples:
        >>> committed()[1]
        'holds'
    """
    from cpl.claims._ledger import committed as _committed

    return _committed(root)


def attempts(*, root: Path | None = None) -> tuple[list[Row], Mapping[int, str]]:
    """Return the rows that can be decided, and why the others cannot: row -> reason.

    For results that may be too few, such as those of a single training seed.

    Raises:
        cpl.store.DamagedResultError: If a published result does not agree with its manifest.
    """
    from cpl.claims._ledger import attempts as _attempts

    return _attempts(root)


def accept(*, root: Path | None = None) -> Path:
    """Write today's verdicts down as the committed ones, and return the file."""
    from cpl.claims._ledger import accept as _accept

    return _accept(root)


def fix(*, root: Path | None = None) -> Path:
    """Fix the rules as they are now, before the data that they will decide on; return the file.

    What is computed from now on names them in its manifest. A rule that did not change since it
    was fixed keeps its date.
    """
    from cpl.claims._ledger import fix_rules as _fix

    return _fix(root)
