"""Row 58: the switch drives as fast with the quantile of another episode."""

from dataclasses import replace

from cpl.claims.claim import Claim, Reader
from cpl.claims.judging import found
from cpl.claims.margins import SPEED
from cpl.claims.rows._pareto import control_leads
from cpl.claims.verdict import Finding

__all__ = ["CLAIM"]


def _decide(read: Reader) -> Finding:
    source = read("controls")
    return found(
        [replace(one, same=True) for one in control_leads(source)],
        n=source.total("episodes"),
    )


CLAIM = Claim(
    row=58,
    claim="the switch drives as fast with the quantile of another episode, or with the mean one",
    where="this book, Is the switch better?",
    rule="lead of the switch over itself with another episode's quantile, and with the mean "
    "quantile at each step, averaged over the collision levels in common; within the margin in "
    "all readings of collision frequency and speed",
    formula=r"v_{\mathrm{switch}}(c)=v_{\mathrm{donor}}(c)",
    unit="m/s",
    margin=str(SPEED),
    revised="New in this edition: the control that explains row 20's lead gets a row.",
    chapter="switch",
    ours=True,
    decide=_decide,
)
