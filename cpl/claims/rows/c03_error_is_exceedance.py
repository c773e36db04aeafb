"""Row 3: an error happens exactly when the score exceeds the quantile."""

import numpy as np

from cpl.claims.claim import Claim, Reader
from cpl.claims.rows._theory import counted, decided
from cpl.claims.verdict import Finding

__all__ = ["CLAIM"]


def _decide(read: Reader) -> Finding:
    runs = read("miscoverage")
    points = runs.total("points")
    wrong = int(np.maximum(runs["wrong_report"], runs["wrong_set"]).sum())
    # A tracker that never met a tie, or never missed, would not have been tested.
    tried = bool((runs["ties"] > 0).all() and (runs["misses"] > 0).all())
    return counted(decided(wrong == 0, points if tried else 0, 1), wrong, points, seeds=1)


CLAIM = Claim(
    row=3,
    claim="an error happens exactly when the score exceeds the quantile",
    where="Section III-A",
    paper_value="err = 1 iff s > q",
    rule="share of scores whose reported error contradicts s > q; 0, ties included, for every rule",
    formula=r"\mathrm{err}_t=1\iff s_t>q_t",
    unit="1",
    margin="none: one exception refutes it",
    chapter="tracking",
    decide=_decide,
)
