"""The ledger as a file: the site shows it on its front page, and other programs may read it."""

from __future__ import annotations

import json
from collections import Counter

from cpl.claims import ledger, own

__all__ = ["ledger_file"]


def ledger_file() -> bytes:
    """Return the verdicts as JSON: how many of each, and one entry a row of the ledger.

    What is counted are the paper's claims; the book's own follow behind them in the rows.
    """
    papers = ledger()
    rows = [*papers, *own()]
    counts = Counter(row.verdict for row in papers)
    entries = [
        {"row": row.row, "claim": row.claim, "verdict": row.verdict, "chapter": row.chapter}
        for row in rows
    ]
    return (json.dumps({"counts": counts, "rows": entries}, indent=1) + "\n").encode()
