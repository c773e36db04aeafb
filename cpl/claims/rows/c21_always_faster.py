"""Row 21: it is always faster at the same collision frequency."""

import numpy as np

from cpl.claims.claim import Claim, Reader
from cpl.claims.rows._pareto import BASELINES, PLANES, lead
from cpl.claims.verdict import Finding, Verdict

__all__ = ["CLAIM"]


def _decide(read: Reader) -> Finding:
    source = read("pareto")
    bands = [lead(source, name, plane).gain for plane in PLANES for name in BASELINES]
    low, value, high = (
        np.concatenate([getattr(band, end) for band in bands]) for end in ("low", "value", "high")
    )
    if (low > 0).all():
        verdict = Verdict.HOLDS
    elif (low > 0).any():
        verdict = Verdict.IN_PART
    else:
        verdict = Verdict.FAILS if (high < 0).any() else Verdict.UNDECIDED
    return Finding(
        verdict=verdict,
        value=float((value > 0).mean()),
        low=float((low > 0).mean()),
        high=float((high > 0).mean()),
        n=len(value),
        n_seeds=bands[0].n,
    )


CLAIM = Claim(
    row=21,
    claim="it is always faster at the same collision frequency",
    where="Figure 2",
    paper_value="always",
    rule="share of collision levels at which it is faster; one failure makes it hold in part",
    chapter="switch",
    decide=_decide,
)
