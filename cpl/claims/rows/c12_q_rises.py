"""Row 12: the quantile rises under distribution shift."""

from cpl.claims.claim import Claim, Reader
from cpl.claims.rows._forecast import DRIVER, total
from cpl.claims.verdict import Finding, rule_r
from cpl.stats import mean_interval

__all__ = ["CLAIM"]


def _decide(read: Reader) -> Finding:
    table = read("coverage_episodes").table
    wide = table[(table["quantity"] == "paired q") & (table["driver"] != "safe")]
    gaps = {
        str(driver): mean_interval(part["value"] / part["n"])
        for driver, part in wide.groupby("driver", sort=True)
    }
    verdict = rule_r(gaps.values(), [None] * len(gaps))
    return Finding.of(verdict, gaps[DRIVER], n=total(wide, "n"))


CLAIM = Claim(
    row=12,
    claim="the quantile rises under distribution shift",
    where="Figure 1",
    rule="paired difference of the quantile, out of distribution minus in; rule R",
    chapter="trust",
    decide=_decide,
)
