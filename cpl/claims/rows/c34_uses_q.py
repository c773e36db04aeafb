"""Row 34: no RL agent uses the quantile as well as the switch."""

from cpl.claims.claim import Claim, Reader
from cpl.claims.judging import Condition, found
from cpl.claims.margins import DURATION
from cpl.claims.rows._table1 import TOPS, cells_of, driven
from cpl.claims.verdict import Finding
from cpl.policies.table1 import SWITCH, beside_hull

__all__ = ["CLAIM"]


def _decide(read: Reader) -> Finding:
    source, cells = cells_of(read)
    conditions = [
        Condition(
            name=f"{told}, up to {top:g} m/s",
            effect=beside_hull(cells, top, name),
            margin=DURATION.value,
        )
        for top in TOPS
        for name, told in ((SWITCH, "q_safe 0.3"), ("switch", "q_safe chosen"))
    ]
    return found(conditions, n=driven(source))


CLAIM = Claim(
    row=34,
    claim="no RL agent uses the quantile as well as the switch",
    where="Section IV-F",
    rule=(
        "seconds that the switch lasts longer than the best coin of its speed between "
        "agents, pi_safe and a car that only slows down; in three ranges, at 0.3 and at "
        "the threshold chosen"
    ),
    formula=r"D_{\mathrm{switch}}-D_{\mathrm{coin}}>0",
    unit="s",
    margin=str(DURATION),
    revised=(
        "Four of six conditions lay wholly below 0 and the row was called undecided; a "
        "refuted member now refutes."
    ),
    chapter="table1",
    decide=_decide,
)
