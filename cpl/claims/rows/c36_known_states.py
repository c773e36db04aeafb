"""Row 36: the penalty on q keeps pi_RL^1 in known states."""

from cpl.claims.claim import Claim, Reader
from cpl.claims.judging import Condition, found
from cpl.claims.margins import QUANTILE, SHARE
from cpl.claims.rows._table1 import SHIFTED, cells_of, driven
from cpl.claims.verdict import Finding

__all__ = ["CLAIM"]


def _decide(read: Reader) -> Finding:
    source, cells = cells_of(read)
    conditions = [
        Condition(
            name=f"{told}, up to {top:g} m/s",
            effect=cells.difference(name, "rl", "rl_1", top)[0],
            margin=margin.value,
        )
        for name, told, margin in (
            ("mean_q", "mean quantile", QUANTILE),
            ("fast_share", "steps out of distribution", SHARE),
        )
        for top in SHIFTED
    ]
    return found(conditions, n=driven(source), shown=conditions[0].effect)


CLAIM = Claim(
    row=36,
    claim="the penalty on q keeps pi_RL^1 in known states",
    where="Section IV-F",
    rule=(
        "difference of the mean quantile, pi_RL minus pi_RL^1, and of the share of steps "
        "out of distribution, in the two ranges beyond training"
    ),
    formula=r"\mathrm E[q]_{\pi_{RL}}-\mathrm E[q]_{\pi^1_{RL}}>0",
    unit="1",
    margin=f"{QUANTILE}; {SHARE}",
    revised="Margins, and only the ranges in which a state can be unknown.",
    chapter="table1",
    decide=_decide,
)
