"""Row 19: evaluation mixes states in and out of distribution."""

from cpl.claims.claim import Claim, Reader
from cpl.claims.rows._forecast import DRIVER, total
from cpl.claims.verdict import Finding, Verdict
from cpl.stats import mean_interval

__all__ = ["CLAIM"]

_MIXED = (0.05, 0.95)  # "both in and out of distribution"


def _decide(read: Reader) -> Finding:
    table = read("coverage_episodes").table
    rows = table[(table["quantity"] == "too fast") & (table["driver"] == DRIVER)]
    wide = rows[rows["top_speed_mps"] > rows["top_speed_mps"].min()]  # [20, 40], the evaluation
    share = mean_interval(wide["value"] / wide["n"])
    low, high = _MIXED
    if share.low > low and share.high < high:
        verdict = Verdict.HOLDS
    elif share.high <= low or share.low >= high:
        verdict = Verdict.FAILS
    else:
        verdict = Verdict.UNDECIDED
    return Finding.of(verdict, share, n=total(wide, "n"))


CLAIM = Claim(
    row=19,
    claim="evaluation mixes states in and out of distribution",
    where="Section IV-F",
    rule="share of the switch's steps in [20, 40] that are faster than any in training; strictly "
    "between 5 and 95 %",
    chapter="forecast",
    decide=_decide,
)
