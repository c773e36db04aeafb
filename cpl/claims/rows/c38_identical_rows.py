"""Row 38: pi_speed and pi_RL^1 agree in all four numbers at 20-50."""

from dataclasses import replace

from cpl.claims.claim import INCONSISTENT, Claim, Reader
from cpl.claims.judging import at_least, found
from cpl.claims.rows._table1 import LEVEL, cells_of, driven
from cpl.claims.verdict import Finding

__all__ = ["CLAIM"]


def _decide(read: Reader) -> Finding:
    source, cells = cells_of(read)
    share = cells.estimate("as_speed", "rl_1", 50.0)
    share = replace(share, low=max(share.low, 0.0), high=min(share.high, 1.0))
    same = at_least("episodes with the same actions", share, 1 - LEVEL)
    return found([same], n=driven(source), shown=share)


CLAIM = Claim(
    row=38,
    claim="pi_speed and pi_RL^1 agree in all four numbers at 20-50",
    where="Table I",
    paper_value="identical",
    rule=(
        "share of episodes in which both take the same actions throughout; above 95 % (a "
        "copied row is the other explanation)"
    ),
    formula=r"(\bar D,s_D,\bar v,s_v)_{\pi_{\mathrm{speed}}}=(\bar D,s_D,\bar v,s_v)_{\pi^1_{RL}}",
    unit="1",
    margin="none: 95 % of the episodes is the level",
    revised="A level that data can miss or reach; half was none.",
    chapter="table1",
    flags=(INCONSISTENT,),
    decide=_decide,
)
