"""Row 40: RL policies satisfy the conditions of the guarantee in practice."""

from dataclasses import replace

import numpy as np

from cpl.claims.claim import Claim, Reader
from cpl.claims.rows._table1 import cells_of, finding
from cpl.claims.verdict import Finding, Verdict
from cpl.policies.table1 import CARRIED

__all__ = ["CLAIM"]

_FIRST_ERROR = 0.1  # [-] the bound counts from the first error of this size


def _decide(read: Reader) -> Finding:
    source, cells = cells_of(read)
    alpha, share = (float(source.parameters[name]) for name in ("alpha", "share"))
    top = float(source.parameters["top_speed_mps"])
    rows = source.where(np.isin(source["policy"].astype(str), CARRIED)).table
    scored = rows.groupby(["policy", "pair"])["scored"].sum()
    fewest = float(np.min(np.asarray(scored, np.float64)))
    # `cpl.conformal.bounds.running_maximum_bound` for scores up to 1; rules only read tables.
    slack = (1 + share) / (share * _FIRST_ERROR) / fewest
    rates = [cells.estimate("error_rate", name, top) for name in CARRIED]
    within = [rate.high <= alpha + slack for rate in rates]
    verdict = Verdict.UNDECIDED
    if all(within):
        verdict = Verdict.HOLDS
    elif any(rate.low > alpha + slack for rate in rates):
        verdict = Verdict.IN_PART if any(within) else Verdict.FAILS
    worst = max(rates, key=lambda rate: rate.value)
    return replace(
        finding(verdict, worst, source),
        n=int(rows["scored"].to_numpy().sum()),
        flags=("q is carried over",),
    )


CLAIM = Claim(
    row=40,
    claim="RL policies satisfy the conditions of the guarantee in practice",
    where="Section I",
    rule="greatest long-run error rate of an agent; at most alpha plus the bound's slack",
    chapter="table1",
    decide=_decide,
)
