"""Row 30: the switch is the safest agent by a significant margin, in all three ranges."""

from dataclasses import replace

from cpl.claims.claim import Claim, Reader
from cpl.claims.judging import Condition, found
from cpl.claims.margins import DURATION
from cpl.claims.rows._table1 import LEVEL, TOPS, cells_of, driven
from cpl.claims.verdict import Finding
from cpl.policies.table1 import ROWS, SWITCH
from cpl.stats import holm

__all__ = ["CLAIM"]

_CLAIMED_LEADS = {30.0: 4.3, 40.0: 12.8, 50.0: 14.6}  # [s] least differences in the printed table


def _decide(read: Reader) -> Finding:
    source, cells = cells_of(read)
    rivals = [row for row in ROWS if row != SWITCH]
    conditions = []
    for top in TOPS:
        pairs = [cells.difference("duration_s", SWITCH, rival, top) for rival in rivals]
        adjusted = holm([p for _, p in pairs])
        # A difference that Holm does not leave standing is none.
        held = {
            rival: gap if p < LEVEL else replace(gap, low=min(gap.low, 0.0))
            for rival, (gap, _), p in zip(rivals, pairs, adjusted, strict=True)
        }
        least = min(held, key=lambda rival: held[rival].value)
        conditions.append(
            Condition(
                name=f"over {least}, up to {top:g} m/s",
                effect=held[least],
                margin=DURATION.value,
                size=_CLAIMED_LEADS[top],
            )
        )
    return found(conditions, n=driven(source))


CLAIM = Claim(
    row=30,
    claim="the switch is the safest agent by a significant margin, in all three ranges",
    where="Section IV-F, Table I",
    paper_value="4.3, 12.8, 14.6 s",
    rule=(
        "least paired difference of mean durations, Holm over six, 10 training seeds, in "
        "three ranges; shown: the least (the gain over an episode-level coin flip is row "
        "34's)"
    ),
    formula=r"D_{\mathrm{switch}}-\max_k D_k>0",
    unit="s",
    margin=str(DURATION),
    revised="A margin.",
    chapter="table1",
    decide=_decide,
)
