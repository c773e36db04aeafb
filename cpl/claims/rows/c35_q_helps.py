"""Row 35: observing the quantile helps RL (pi_RL against pi_RL^nq)."""

from cpl.claims.claim import Claim, Reader
from cpl.claims.rows._table1 import TOPS, cells_of, finding
from cpl.claims.verdict import Finding, rule_r

__all__ = ["CLAIM"]


def _decide(read: Reader) -> Finding:
    source, cells = cells_of(read)
    gaps = [cells.difference("duration_s", "rl", "rl_nq", top)[0] for top in TOPS]
    verdict = rule_r(gaps, [None] * len(gaps))
    return finding(verdict, min(gaps, key=lambda gap: gap.value), source)


CLAIM = Claim(
    row=35,
    claim="observing the quantile helps RL (pi_RL against pi_RL^nq)",
    where="Section IV-F",
    rule="paired difference over training seeds; rule R in three ranges",
    chapter="table1",
    decide=_decide,
)
