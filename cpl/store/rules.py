"""Which rules were in force when a result was computed: the data name them, not only the page."""

import json
from pathlib import Path
from typing import Any

from cpl.store.paths import data_path

__all__ = ["RULES", "fixed_rules", "rules_in_force"]

RULES = "rules.json"
"""Name of the file in the published layer; `cpl claims --fix` writes it."""


def fixed_rules(root: Path | None = None) -> dict[str, Any]:
    """Return the rules as they were fixed: edition, and by row its digest, time and commit.

    Args:
        root: Folder of the published layer; ``data/results`` unless given.

    Returns:
        Empty if no rule was ever fixed.
    """
    path = (data_path("results") if root is None else root) / RULES
    return json.loads(path.read_text(encoding="utf-8")) if path.is_file() else {}


def rules_in_force() -> dict[str, str]:
    """Return what a new result says of the rules that were fixed before it.

    Returns:
        ``edition``, and by row of the ledger the digest of its rule; empty without fixed rules.
    """
    told = fixed_rules()
    if not told:
        return {}
    digests = {row: str(rule["digest"]) for row, rule in told["rows"].items()}
    return {"edition": str(told["edition"]), **digests}
