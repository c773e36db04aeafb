"""From claims and rules to rows, and to the verdicts that are committed."""

import json
import pkgutil
from collections.abc import Callable, Sequence
from functools import lru_cache
from importlib import import_module
from pathlib import Path
from typing import TypeVar

from cpl.claims import rows
from cpl.claims.claim import HARDWARE, Claim, Reader, Source
from cpl.claims.edition import came_first, first_edition, fix
from cpl.claims.judging import Condition, decided_by, what_would_change
from cpl.claims.row import ClaimsTable, Effect, MachinesTable, Row, TwinTable
from cpl.claims.verdict import Verdict
from cpl.store import DamagedResultError, Manifest, atomic_write, data_path, read_published

__all__ = [
    "accept",
    "attempts",
    "changes",
    "claims",
    "committed",
    "fix_rules",
    "ledger",
    "own",
    "show",
    "show_machines",
    "show_twin",
]

_PROFILE = "paper"
_Answer = TypeVar("_Answer")


@lru_cache(maxsize=1)
def claims() -> dict[int, Claim]:
    """Return all claims by row, as they are found in the folder `rows`.

    Raises:
        ValueError: If two files claim the same row.
    """
    names = sorted(m.name for m in pkgutil.iter_modules(rows.__path__) if m.name[0] != "_")
    found: list[Claim] = [import_module(f"{rows.__name__}.{name}").CLAIM for name in names]
    by_row = {claim.row: claim for claim in sorted(found, key=lambda claim: claim.row)}
    if len(by_row) < len(found):
        msg = f"rows must differ from claim to claim, got {[claim.row for claim in found]}"
        raise ValueError(msg)
    return by_row


def ledger(root: Path | None = None) -> list[Row]:
    """Return the rows of the paper's claims; see `cpl.claims.ledger`."""
    return [_row(claim, root) for claim in claims().values() if not claim.ours]


def own(root: Path | None = None) -> list[Row]:
    """Return the rows of the book's own claims; see `cpl.claims.own`."""
    return [_row(claim, root) for claim in claims().values() if claim.ours]


def attempts(root: Path | None = None) -> tuple[list[Row], dict[int, str]]:
    """Return the rows that can be decided; see `cpl.claims.attempts`."""
    decided: list[Row] = []
    undecided: dict[int, str] = {}
    for claim in claims().values():
        try:
            decided.append(_row(claim, root))
        except DamagedResultError:
            raise
        except ValueError as error:
            undecided[claim.row] = str(error)
    return decided, undecided


def show(numbers: Sequence[int]) -> ClaimsTable:
    """Return the rows of the given numbers, or all of the paper's; see `cpl.claims.table`."""
    known = claims()
    for number in numbers:
        if number not in known:
            msg = f"rows must be among {min(known)} to {max(known)}, got {number!r}"
            raise ValueError(msg)
    return ClaimsTable(
        tuple(_row(known[number], None) for number in numbers) if numbers else tuple(ledger())
    )


def show_twin() -> TwinTable:
    """Return the rows that the twin was asked about; see `cpl.claims.twin_table`."""
    return TwinTable(tuple(_row(claim, None) for claim in claims().values() if claim.in_the_twin))


def show_machines() -> MachinesTable:
    """Return the rows that other machines were asked about; see `cpl.claims.machines_table`."""
    asked = (claim for claim in claims().values() if claim.on_other_machines)
    return MachinesTable(tuple(_row(claim, None) for claim in asked))


def changes(root: Path | None = None) -> dict[int, tuple[str, str]]:
    """Compare with the committed verdicts; see `cpl.claims.changes`."""
    before = committed(root)
    return {
        row.row: (before.get(row.row, "none"), row.verdict)
        for row in (*ledger(root), *own(root))
        if before.get(row.row, "none") != row.verdict
    }


def accept(root: Path | None = None) -> Path:
    """Write the verdicts of now; see `cpl.claims.accept`."""
    verdicts = {str(row.row): row.verdict for row in (*ledger(root), *own(root))}
    return atomic_write(_file(root), json.dumps(verdicts, indent=1) + "\n")


def fix_rules(root: Path | None = None) -> Path:
    """Write the rules of now down; see `cpl.claims.fix`."""
    return fix(claims(), root)


def committed(root: Path | None = None) -> dict[int, str]:
    """Return the committed verdicts by row; none if nobody committed to any."""
    path = _file(root)
    verdicts = json.loads(path.read_text(encoding="utf-8")) if path.is_file() else {}
    return {int(row): verdict for row, verdict in verdicts.items()}


def _file(root: Path | None) -> Path:
    return (data_path("results") if root is None else root) / "verdicts.json"


# The last row of each claim, with the manifests of the results that it was decided from.
_KEPT: dict[Claim, tuple[dict[str, Manifest], Row]] = {}


def _row(claim: Claim, root: Path | None) -> Row:
    """Decide a claim, unless it was decided from the same results before."""
    if claim in _KEPT:
        seen, row = _KEPT[claim]
        if all(_manifest(name, root) == manifest for name, manifest in seen.items()):
            return row
    seen, missing = {}, False

    def read(experiment: str) -> Source:
        table, seen[experiment] = read_published(experiment, _PROFILE, root=root)
        manifest = seen[experiment]
        return Source(table=table, parameters=manifest.parameters, content=manifest.content)

    def answer(rule: Callable[[Reader], _Answer] | None) -> _Answer | None:
        nonlocal missing
        before = dict(seen)
        try:
            return rule(read) if rule else None
        except FileNotFoundError:
            missing = True
            seen.clear()
            seen.update(before)  # an answer that failed rests on nothing
            return None

    before = first_edition().get(claim.row)
    found, leaning = answer(claim.decide), answer(claim.in_the_twin)
    elsewhere = answer(claim.on_other_machines)
    row = Row(
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
        flags=(*claim.flags, *(found.flags if found else ())),
        chapter=claim.chapter,
        where=claim.where,
        formula=claim.formula,
        unit=claim.unit,
        margin=claim.margin,
        conditions=_effects(found.conditions) if found else (),
        beside=_effects(found.beside) if found else (),
        would_change=what_would_change(found) if found else "",
        seeds_needed=decided_by(found) if found else None,
        order=came_first(claim, list(seen.values())) if found else "",
        before=before.verdict if before else None,
        revised=claim.revised,
        computed_from=tuple(_named(manifest) for manifest in seen.values()),
        in_the_twin=str(leaning) if leaning else None,
        on_other_machines=str(elsewhere) if elsewhere else None,
    )
    if not missing:
        _KEPT[claim] = seen, row
    return row


def _effects(conditions: Sequence[Condition]) -> tuple[Effect, ...]:
    return tuple(
        Effect(
            name=one.name,
            value=one.effect.value,
            low=one.effect.low,
            high=one.effect.high,
            needed=one.needed,
            verdict=str(one.verdict),
        )
        for one in conditions
    )


def _manifest(experiment: str, root: Path | None) -> Manifest | None:
    """Return the manifest of a published result that is whole; None if it is not published."""
    try:
        return read_published(experiment, _PROFILE, root=root)[1]
    except FileNotFoundError:
        return None


def _named(manifest: Manifest) -> str:
    return f"{manifest.experiment}/{manifest.profile}@{manifest.content[:12]}"


def _without_results(claim: Claim) -> Verdict:
    return Verdict.HARDWARE if HARDWARE in claim.flags else Verdict.PENDING
