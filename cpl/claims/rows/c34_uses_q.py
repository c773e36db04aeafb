"""Row 34: no RL agent uses the quantile as well as the switch."""

from cpl.claims.claim import Claim, Reader
from cpl.claims.rows._table1 import TOPS, cells_of, finding
from cpl.claims.verdict import Finding, rule_r
from cpl.policies.table1 import SWITCH, beside_hull

__all__ = ["CLAIM"]


def _decide(read: Reader) -> Finding:
    source, cells = cells_of(read)
    gains = [beside_hull(cells, top, name) for top in TOPS for name in (SWITCH, "switch")]
    verdict = rule_r(gains, [None] * len(gains))
    return finding(verdict, min(gains, key=lambda gain: gain.value), source)


CLAIM = Claim(
    row=34,
    claim="no RL agent uses the quantile as well as the switch",
    where="Section IV-F",
    rule="seconds that the switch lasts longer than the best coin of its speed between agents, "
    "pi_safe and a car that only slows down; interval above 0 in three ranges, at 0.3 and at "
    "the threshold chosen",
    chapter="table1",
    decide=_decide,
)
