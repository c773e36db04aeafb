"""Row 30: the switch is the safest agent by a significant margin, in all three ranges."""

from dataclasses import replace

from cpl.claims.claim import Claim, Reader
from cpl.claims.rows._table1 import LEVEL, TOPS, cells_of, finding
from cpl.claims.verdict import Finding, rule_r
from cpl.policies.table1 import ROWS, SWITCH
from cpl.stats import Estimate, holm

__all__ = ["CLAIM"]

_CLAIMED_LEADS = {30.0: 4.3, 40.0: 12.8, 50.0: 14.6}  # [s] least differences in the printed table


def _decide(read: Reader) -> Finding:
    source, cells = cells_of(read)
    rivals = [row for row in ROWS if row != SWITCH]
    least: list[Estimate] = []
    for top in TOPS:
        found = [cells.difference("duration_s", SWITCH, rival, top) for rival in rivals]
        adjusted = holm([p for _, p in found])
        # A difference that Holm does not leave standing is none.
        held = [
            gap if p < LEVEL else replace(gap, low=min(gap.low, 0.0))
            for (gap, _), p in zip(found, adjusted, strict=True)
        ]
        least.append(min(held, key=lambda gap: gap.value))
    verdict = rule_r(least, [_CLAIMED_LEADS[top] for top in TOPS])
    return finding(verdict, min(least, key=lambda gap: gap.value), source)


CLAIM = Claim(
    row=30,
    claim="the switch is the safest agent by a significant margin, in all three ranges",
    where="Section IV-F, Table I",
    paper_value="4.3, 12.8, 14.6 s",
    rule="least paired difference of mean durations, Holm over six, 10 training seeds; rule R (the "
    "gain over an episode-level coin flip is reported beside it)",
    chapter="table1",
    decide=_decide,
)
