"""Row 12: the quantile rises under distribution shift."""

from cpl.claims.claim import Claim, Reader
from cpl.claims.judging import Condition, found
from cpl.claims.margins import QUANTILE
from cpl.claims.rows._forecast import DRIVER, total
from cpl.claims.verdict import Finding
from cpl.stats import mean_interval

__all__ = ["CLAIM"]


def _decide(read: Reader) -> Finding:
    table = read("coverage_episodes").table
    wide = table[(table["quantity"] == "paired q") & (table["driver"] != "safe")]
    gaps = {
        str(driver): mean_interval(part["value"] / part["n"])
        for driver, part in wide.groupby("driver", sort=True)
    }
    return found(
        [Condition(name=name, effect=gap, margin=QUANTILE.value) for name, gap in gaps.items()],
        n=total(wide, "n"),
        shown=gaps[DRIVER],
    )


CLAIM = Claim(
    row=12,
    claim="the quantile rises under distribution shift",
    where="Figure 1",
    rule=(
        "paired difference of the quantile, out of distribution minus in; for the switch "
        "and the fast policy"
    ),
    formula=r"\mathrm E[q\mid\text{shift}]-\mathrm E[q]>0",
    unit="1",
    margin=str(QUANTILE),
    revised="A margin: a rise that is too small to move the switch does not count.",
    chapter="trust",
    decide=_decide,
)
