"""Row 31: pi_RL is the second best."""

import numpy as np

from cpl.claims.claim import INCONSISTENT, Claim, Reader
from cpl.claims.rows._table1 import LEVEL, TOPS, cells_of, driven
from cpl.claims.verdict import Finding, Verdict
from cpl.policies.table1 import ranks

__all__ = ["CLAIM"]


def _decide(read: Reader) -> Finding:
    source, cells = cells_of(read)
    chance = np.array([ranks(cells, top)[2].to_dict()["rl"] for top in TOPS])
    count = int((chance > 1 - LEVEL).sum())
    if count == len(TOPS):
        verdict = Verdict.HOLDS
    elif count:
        verdict = Verdict.IN_PART
    else:
        verdict = Verdict.FAILS if (chance < LEVEL).any() else Verdict.UNDECIDED
    return Finding(
        verdict=verdict, value=float(count), n=driven(source),
        n_seeds=cells.groups,
    )  # fmt: skip


CLAIM = Claim(
    row=31,
    claim="pi_RL is the second best",
    where="Section IV-F",
    paper_value="second in 3 of 3 ranges",
    rule="number of ranges in which it is second with probability above 0.95",
    chapter="table1",
    flags=(INCONSISTENT,),
    decide=_decide,
)
