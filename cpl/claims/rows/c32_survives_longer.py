"""Row 32: pi_RL survives 25 % longer at 20-40 than the other ablations."""

from dataclasses import replace

from cpl.claims.claim import INCONSISTENT, Claim, Reader
from cpl.claims.rows._table1 import cells_of, finding
from cpl.claims.verdict import Finding, rule_r
from cpl.policies.table1 import ROWS, SWITCH

__all__ = ["CLAIM"]

_CLAIMED_RATIO = 0.25


def _decide(read: Reader) -> Finding:
    source, cells = cells_of(read)
    others = [row for row in ROWS if row not in ("rl", SWITCH)]
    found = [cells.ratio("duration_s", "rl", other, 40.0) for other in others]
    gains = [replace(r, value=r.value - 1, low=r.low - 1, high=r.high - 1) for r in found]
    verdict = rule_r(gains, [_CLAIMED_RATIO] * len(gains))
    return finding(verdict, min(found, key=lambda ratio: ratio.value), source)


CLAIM = Claim(
    row=32,
    claim="pi_RL survives 25 % longer at 20-40 than the other ablations",
    where="Section IV-F",
    paper_value="1.25",
    rule="ratio of mean durations; interval against 1 and 1.25",
    chapter="table1",
    flags=(INCONSISTENT,),
    decide=_decide,
)
