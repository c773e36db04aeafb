"""The ledger as a file: the site shows it on its front page, and other programs may read it."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Sequence

from cpl.claims import ledger, own, table
from cpl.claims.sheets import claim_graph, claims_file

__all__ = ["judged_files", "ledger_file"]


def ledger_file(rows: Sequence[int] | None = None) -> bytes:
    """Return the verdicts as JSON: how many of each, and one entry a row of the ledger.

    What is counted are the paper's claims; the book's own follow behind them in the rows.

    Args:
        rows: The rows that a page shows; no other one is decided. All unless given.
    """
    whole = rows is None
    papers = ledger() if whole else []
    shown = [*papers, *own()] if whole else table(*rows).rows if rows else ()
    counts = Counter(row.verdict for row in papers)
    entries = [
        {"row": row.row, "claim": row.claim, "verdict": row.verdict, "chapter": row.chapter}
        for row in shown
    ]
    return (json.dumps({"counts": counts, "rows": entries}, indent=1) + "\n").encode()


def judged_files() -> dict[str, bytes]:
    """Return the whole ledger for other programs: every row in full, and the claim graph."""
    rows = [*ledger(), *own()]
    return {
        "claims.json": claims_file(rows).encode(),
        "claim_graph.json": claim_graph(rows).encode(),
    }
