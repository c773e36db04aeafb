"""Row 41: a hand-set threshold makes tuning hard."""

from cpl.claims.claim import Claim, Reader
from cpl.claims.judging import Condition, found
from cpl.claims.margins import CRASH
from cpl.claims.rows._table1 import SHIFTED, cells_of, driven
from cpl.claims.verdict import Finding

__all__ = ["CLAIM"]


def _decide(read: Reader) -> Finding:
    source, cells = cells_of(read)
    conditions = [
        Condition(
            name=f"up to {top:g} m/s",
            effect=cells.difference("crash_rate", "switch above", "switch below", top)[0],
            margin=CRASH.value,
        )
        for top in SHIFTED
    ]
    return found(conditions, n=driven(source))


CLAIM = Claim(
    row=41,
    claim="a hand-set threshold makes tuning hard",
    where="Section I",
    rule=(
        "paired change of the crash share when q_safe moves from 0.1 below to 0.1 above "
        "the chosen one; in both ranges beyond training"
    ),
    formula=r"\mathrm{crash}(q_{\mathrm{safe}}+0.1)-\mathrm{crash}(q_{\mathrm{safe}}-0.1)>0",
    unit="1",
    margin=str(CRASH),
    revised=(
        "The row failed although moving the threshold moves the crashes, because seeds "
        "differ by more. It asks now for the paired change itself, and in crashes."
    ),
    chapter="table1",
    decide=_decide,
)
