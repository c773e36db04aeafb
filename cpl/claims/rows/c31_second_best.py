"""Row 31: pi_RL is the second best."""

from cpl.claims.claim import INCONSISTENT, Claim, Reader
from cpl.claims.judging import Condition, found
from cpl.claims.margins import DURATION
from cpl.claims.rows._table1 import TOPS, cells_of, driven
from cpl.claims.verdict import Finding
from cpl.policies.table1 import ROWS, SWITCH

__all__ = ["CLAIM"]


def _decide(read: Reader) -> Finding:
    source, cells = cells_of(read)
    others = [row for row in ROWS if row not in ("rl", SWITCH)]
    conditions = []
    for top in TOPS:
        gaps = {one: cells.difference("duration_s", "rl", one, top)[0] for one in others}
        least = min(gaps, key=lambda one: gaps[one].value)
        conditions.append(
            Condition(
                name=f"over {least}, up to {top:g} m/s",
                effect=gaps[least],
                margin=DURATION.value,
            )
        )
    return found(conditions, n=driven(source))


CLAIM = Claim(
    row=31,
    claim="pi_RL is the second best",
    where="Section IV-F",
    paper_value="second in 3 of 3 ranges",
    rule=(
        "least paired difference of mean durations, pi_RL minus each other agent but the "
        "switch, in three ranges; all must hold"
    ),
    formula=r"\operatorname{rank}D_{\pi_{RL}}=2",
    unit="s",
    margin=str(DURATION),
    revised=(
        "The probability of a rank is no effect. The row asks now by how much pi_RL "
        "outlasts the best of the others."
    ),
    chapter="table1",
    flags=(INCONSISTENT,),
    decide=_decide,
)
