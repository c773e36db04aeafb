"""Row 36: the penalty on q keeps pi_RL^1 in known states."""

from cpl.claims.claim import Claim, Reader
from cpl.claims.rows._table1 import SHIFTED, TOPS, cells_of, finding
from cpl.claims.verdict import Finding, rule_r

__all__ = ["CLAIM"]


def _decide(read: Reader) -> Finding:
    source, cells = cells_of(read)
    quantiles = [cells.difference("mean_q", "rl", "rl_1", top)[0] for top in TOPS]
    shares = [cells.difference("fast_share", "rl", "rl_1", top)[0] for top in SHIFTED]
    found = [*quantiles, *shares]
    verdict = rule_r(found, [None] * len(found))
    return finding(verdict, quantiles[TOPS.index(40.0)], source)


CLAIM = Claim(
    row=36,
    claim="the penalty on q keeps pi_RL^1 in known states",
    where="Section IV-F",
    rule="difference of the mean quantile, pi_RL minus pi_RL^1, and of the share of steps out of "
    "distribution; rule R",
    chapter="table1",
    decide=_decide,
)
