"""Row 29: the 42 cells of Table I."""

import numpy as np

from cpl.claims.claim import Claim, Reader
from cpl.claims.rows._table1 import cells_of, driven
from cpl.claims.verdict import Finding, Verdict
from cpl.policies.table1 import against_print

__all__ = ["CLAIM"]


def _decide(read: Reader) -> Finding:
    source, cells = cells_of(read)
    verdicts = against_print(cells)["verdict"].to_numpy()
    same, other = float(np.mean(verdicts == "same")), float(np.mean(verdicts == "other"))
    verdict = Verdict.UNDECIDED
    if same >= 0.9:
        verdict = Verdict.HOLDS
    elif 1 - other < 0.9:
        verdict = Verdict.FAILS
    # The ends count what is shown to be the same, and what is not shown to be another.
    ends = {"low": same, "high": 1 - other}
    return Finding(
        verdict=verdict, value=same, **ends, n=driven(source), n_seeds=cells.groups,
        flags=("the ends count open cells as no and as yes",),
    )  # fmt: skip


CLAIM = Claim(
    row=29,
    claim="the 42 cells of Table I",
    where="Table I",
    paper_value="42 cells",
    rule="share of cells equivalent within 2 s and 1 m/s; at least 90 % must be",
    chapter="table1",
    decide=_decide,
)
