"""Row 33: RL underperforms the switch out of distribution."""

from cpl.claims.claim import Claim, Reader
from cpl.claims.judging import Condition, found
from cpl.claims.margins import DURATION
from cpl.claims.rows._table1 import SHIFTED, cells_of, driven
from cpl.claims.verdict import Finding
from cpl.policies.table1 import SWITCH

__all__ = ["CLAIM"]


def _decide(read: Reader) -> Finding:
    source, cells = cells_of(read)
    conditions = [
        Condition(
            name=f"up to {top:g} m/s",
            effect=cells.difference("duration_s", SWITCH, "rl", top)[0],
            margin=DURATION.value,
        )
        for top in SHIFTED
    ]
    return found(conditions, n=driven(source))


CLAIM = Claim(
    row=33,
    claim="RL underperforms the switch out of distribution",
    where="Section I, Section IV-F",
    rule="difference of mean durations, switch minus pi_RL; in both ranges beyond training",
    formula=r"D_{\mathrm{switch}}-D_{\pi_{RL}}>0",
    unit="s",
    margin=str(DURATION),
    revised="A margin.",
    chapter="table1",
    decide=_decide,
)
