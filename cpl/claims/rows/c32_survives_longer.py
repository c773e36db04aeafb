"""Row 32: pi_RL survives 25 % longer at 20-40 than the other ablations."""

from dataclasses import replace

from cpl.claims.claim import INCONSISTENT, Claim, Reader
from cpl.claims.judging import Condition, found
from cpl.claims.margins import RATIO
from cpl.claims.rows._table1 import cells_of, driven
from cpl.claims.verdict import Finding
from cpl.policies.table1 import ROWS, SWITCH

__all__ = ["CLAIM"]

_CLAIMED_RATIO = 0.25


def _decide(read: Reader) -> Finding:
    source, cells = cells_of(read)
    others = [row for row in ROWS if row not in ("rl", SWITCH)]
    ratios = {one: cells.ratio("duration_s", "rl", one, 40.0) for one in others}
    conditions = [
        Condition(
            name=f"over {one}",
            effect=replace(r, value=r.value - 1, low=r.low - 1, high=r.high - 1),
            margin=RATIO.value,
            size=_CLAIMED_RATIO,
        )
        for one, r in ratios.items()
    ]
    return found(
        conditions, n=driven(source), shown=min(ratios.values(), key=lambda ratio: ratio.value)
    )


CLAIM = Claim(
    row=32,
    claim="pi_RL survives 25 % longer at 20-40 than the other ablations",
    where="Section IV-F",
    paper_value="1.25",
    rule=(
        "ratio of mean durations, pi_RL to each other ablation at 20-40; at least half of"
        " 25 % longer than each"
    ),
    formula=r"D_{\pi_{RL}}/D_k=1.25",
    unit="1",
    margin=str(RATIO),
    revised=(
        "A member of the conjunction was refuted and the row called undecided; a refuted "
        "member now refutes."
    ),
    chapter="table1",
    flags=(INCONSISTENT,),
    decide=_decide,
)
