"""Row 19: evaluation mixes states in and out of distribution."""

from cpl.claims.claim import Claim, Reader
from cpl.claims.judging import at_least, found
from cpl.claims.rows._forecast import DRIVER, total
from cpl.claims.verdict import Finding
from cpl.stats import mean_interval

__all__ = ["CLAIM"]

_LEAST, _MOST = 0.05, 0.95  # "both in and out of distribution"


def _decide(read: Reader) -> Finding:
    table = read("coverage_episodes").table
    rows = table[(table["quantity"] == "too fast") & (table["driver"] == DRIVER)]
    wide = rows[rows["top_speed_mps"] > rows["top_speed_mps"].min()]  # [20, 40], the evaluation
    share = mean_interval(wide["value"] / wide["n"])
    if share.value < (_LEAST + _MOST) / 2:  # the nearer end decides
        mixed = at_least("share out of distribution", share, _LEAST)
    else:
        mixed = at_least("share out of distribution", share, _MOST, below=True)
    return found([mixed], n=total(wide, "n"), shown=share)


CLAIM = Claim(
    row=19,
    claim="evaluation mixes states in and out of distribution",
    where="Section IV-F",
    rule="share of the switch's steps in [20, 40] that are faster than any in training; strictly "
    "between 5 and 95 %",
    formula=r"5\,\%<P(\text{out of distribution})<95\,\%",
    unit="1",
    margin="none: 5 % and 95 % are the levels",
    chapter="forecast",
    decide=_decide,
)
