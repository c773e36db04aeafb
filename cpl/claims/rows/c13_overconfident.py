"""Row 13: other uncertainty estimates are over-confident."""

from cpl.claims.claim import Claim, Reader
from cpl.claims.rows._forecast import total
from cpl.claims.verdict import Finding, Verdict
from cpl.stats import mean_interval

__all__ = ["CLAIM"]


def _decide(read: Reader) -> Finding:
    table = read("forecasts").table
    rows = table.loc[(table["quantity"] == "coverage_raw") & (table["policy"] == "both")]
    wide = rows.loc[rows["top_speed_mps"] > rows["top_speed_mps"].min()]
    claimed = wide.loc[wide["subject"].isin(["dropout", "ensemble", "hau"])]
    found = [
        mean_interval(part["value"]) for _, part in claimed.groupby(["subject", "top_speed_mps"])
    ]
    below = [estimate.high < 0.9 for estimate in found]
    if all(below):
        verdict = Verdict.HOLDS
    elif any(below):
        verdict = Verdict.IN_PART
    else:
        sure = all(estimate.low >= 0.9 for estimate in found)
        verdict = Verdict.FAILS if sure else Verdict.UNDECIDED
    largest = max(found, key=lambda estimate: estimate.high)
    return Finding.of(verdict, largest, n=total(claimed, "n"))


CLAIM = Claim(
    row=13,
    claim="other uncertainty estimates are over-confident",
    where="Section I",
    rule="coverage of nominal 90 % sets out of distribution (HAU, dropout, ensemble); upper bound "
    "below 0.9 for each",
    chapter="forecast",
    decide=_decide,
)
