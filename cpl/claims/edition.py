"""Which edition of the rules decides, when each was fixed, and what the first one said.

A rule is *fixed* by its digest, the time and the commit it stands in. A result that is computed
later carries the digests of all rules of that moment in its manifest. Whether the rule came first
can so be read from the data, whatever a page says.
"""

import json
import pkgutil
from dataclasses import dataclass
from datetime import UTC, datetime
from hashlib import sha256
from pathlib import Path

from cpl.claims import rows
from cpl.claims.claim import Claim
from cpl.store import (
    Manifest,
    atomic_write,
    data_path,
    fixed_rules,
    module_digests,
    source_commit,
)
from cpl.store.rules import RULES

__all__ = ["EDITION", "First", "came_first", "digest_of", "first_edition", "fix", "loose"]

EDITION = 2
_FIRST = "first_edition.json"
_RULES_OF = ("cpl.claims.rows.", "cpl.claims.judging", "cpl.claims.margins")


@dataclass(frozen=True, kw_only=True)
class First:
    """What the first edition said of a row.

    Attributes:
        verdict: Its verdict; None where the rule stood and its data were still to come.
        value: Its number.
        low: Lower end of the interval.
        high: Upper end.
        rule: Its rule in words.
        rule_committed: When the code of the rule was committed; None where there was none.
        data_committed: When the data were.
        note: What the history shows besides.
    """

    verdict: str | None
    value: float | None
    low: float | None
    high: float | None
    rule: str
    rule_committed: str | None = None
    data_committed: str | None = None
    note: str = ""


def first_edition() -> dict[int, First]:
    """Return the rows of the first edition, frozen before any rule of the second was written.

    Four rules of that time, rows 54 to 57, had no data yet; when those came is added.
    """
    path = data_path("results", _FIRST)
    told = json.loads(path.read_text(encoding="utf-8"))
    return {int(row): First(**entry) for row, entry in told.items()}


def digest_of(claim: Claim) -> str:
    """Return a digest of a claim's rule: its file, what it shares with others, and the judging."""
    (module,) = (name for name in _modules() if name.startswith(f"c{claim.row:02d}_"))
    digests = module_digests(f"{rows.__name__}.{module}", within="cpl.claims")
    own = [f"{name} {digest}" for name, digest in digests.items() if name.startswith(_RULES_OF)]
    return sha256("\n".join(own).encode()).hexdigest()[:12]


def loose(claims: dict[int, Claim], root: Path | None = None) -> list[int]:
    """Return the rows whose rule is not the one that was fixed."""
    fixed = fixed_rules(root).get("rows", {})
    return [
        row
        for row, claim in claims.items()
        if claim.decide and fixed.get(str(row), {}).get("digest") != digest_of(claim)
    ]


def fix(claims: dict[int, Claim], root: Path | None = None) -> Path:
    """Write down the rules of now; those that did not change keep their time and commit."""
    told = fixed_rules(root)
    kept = {row: rule for row, rule in told.get("rows", {}).items() if int(row) in claims}
    now = datetime.now(UTC).isoformat(timespec="seconds").replace("+00:00", "Z")
    for row in loose(claims, root):
        kept[str(row)] = {
            "digest": digest_of(claims[row]),
            "fixed": now,
            "commit": source_commit(),
        }
    text = json.dumps(
        {"edition": EDITION, "rows": dict(sorted(kept.items(), key=_number))}, indent=1
    )
    base = data_path("results") if root is None else root
    return atomic_write(base / RULES, text + "\n")


def came_first(claim: Claim, results: list[Manifest], root: Path | None = None) -> str:
    """Say which came first, a rule or the data that it decides on.

    A rule that the second edition left as it was keeps the order of the first.
    """
    if claim.decide is None or not results:
        return ""
    digest = digest_of(claim)
    if all(result.rules.get(str(claim.row)) == digest for result in results):
        return "rule first: the data name it"
    first = first_edition().get(claim.row)
    if claim.revised or first is None:
        return "data first: old data, older than this rule"
    if first.rule_committed is None or first.data_committed is None:
        return ""
    order = "rule" if first.rule_committed < first.data_committed else "data"
    if first.rule_committed == first.data_committed:
        order = "together"
    said = {"rule": "rule first", "data": "data first", "together": "rule and data together"}[order]
    return f"{said}: {first.note}" if first.note else said


def _modules() -> list[str]:
    return [module.name for module in pkgutil.iter_modules(rows.__path__)]


def _number(entry: tuple[str, object]) -> int:
    return int(entry[0])
