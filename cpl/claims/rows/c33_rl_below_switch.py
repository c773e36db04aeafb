"""Row 33: RL underperforms the switch out of distribution."""

from cpl.claims.claim import Claim, Reader
from cpl.claims.rows._table1 import SHIFTED, cells_of, finding
from cpl.claims.verdict import Finding, rule_r
from cpl.policies.table1 import SWITCH

__all__ = ["CLAIM"]


def _decide(read: Reader) -> Finding:
    source, cells = cells_of(read)
    gaps = [cells.difference("duration_s", SWITCH, "rl", top)[0] for top in SHIFTED]
    verdict = rule_r(gaps, [None] * len(gaps))
    return finding(verdict, min(gaps, key=lambda gap: gap.value), source)


CLAIM = Claim(
    row=33,
    claim="RL underperforms the switch out of distribution",
    where="Section I, Section IV-F",
    rule="difference of mean durations, switch minus pi_RL; above 0 in both ranges",
    chapter="table1",
    decide=_decide,
)
