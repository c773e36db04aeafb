"""Row 38: pi_speed and pi_RL^1 agree in all four numbers at 20-50."""

from dataclasses import replace

from cpl.claims.claim import INCONSISTENT, Claim, Reader
from cpl.claims.rows._table1 import LEVEL, cells_of, finding
from cpl.claims.verdict import Finding, Verdict

__all__ = ["CLAIM"]


def _decide(read: Reader) -> Finding:
    source, cells = cells_of(read)
    share = cells.estimate("as_speed", "rl_1", 50.0)
    share = replace(share, low=max(share.low, 0.0), high=min(share.high, 1.0))
    verdict = Verdict.UNDECIDED
    if share.low > 1 - LEVEL:
        verdict = Verdict.HOLDS
    elif share.high < 0.5:
        verdict = Verdict.FAILS
    return finding(verdict, share, source)


CLAIM = Claim(
    row=38,
    claim="pi_speed and pi_RL^1 agree in all four numbers at 20-50",
    where="Table I",
    paper_value="identical",
    rule="share of episodes in which both take the same actions throughout; a copied row is the "
    "other explanation",
    chapter="table1",
    flags=(INCONSISTENT,),
    decide=_decide,
)
