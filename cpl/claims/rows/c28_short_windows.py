"""Row 28: coverage in windows of 5 steps is above 0.9 most of the time."""

from cpl.claims.claim import Claim, Reader
from cpl.claims.rows._forecast import in_range, total
from cpl.claims.verdict import Finding, rule_r
from cpl.stats import mean_interval

__all__ = ["CLAIM"]


def _decide(read: Reader) -> Finding:
    source = read("coverage_episodes")
    rows = in_range(source, "window")
    chance = (1 - float(source.parameters["alpha"])) ** int(source.parameters["window"])
    gaps = {
        bool(str(carry) == "True"): mean_interval(part["value"] / part["n"] - chance)
        for carry, part in rows.groupby("carry")
    }
    verdict = rule_r(gaps.values(), [None] * len(gaps))
    return Finding.of(verdict, gaps[False], n=total(rows, "n"))


CLAIM = Claim(
    row=28,
    claim="coverage in windows of 5 steps is above 0.9 most of the time",
    where="Figure 3",
    paper_value="most of the time",
    rule="share of windows at or above 0.9, minus the 59 % of an exact independent 90 % process; "
    "rule R",
    chapter="trust",
    decide=_decide,
)
