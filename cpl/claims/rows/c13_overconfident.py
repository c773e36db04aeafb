"""Row 13: other uncertainty estimates are over-confident."""

from cpl.claims.claim import Claim, Reader
from cpl.claims.judging import Condition, at_least, found
from cpl.claims.margins import SHARE
from cpl.claims.rows._forecast import total
from cpl.claims.verdict import Finding
from cpl.stats import mean_interval

__all__ = ["CLAIM"]

_NOMINAL = 0.9


def _decide(read: Reader) -> Finding:
    table = read("forecasts").table
    rows = table.loc[(table["quantity"] == "coverage_raw") & (table["policy"] == "both")]
    wide = rows.loc[rows["top_speed_mps"] > rows["top_speed_mps"].min()]
    claimed = wide.loc[wide["subject"].isin(["dropout", "ensemble", "hau"])]
    covered = {
        f"{subject}, up to {top:g} m/s": mean_interval(part["value"])
        for (subject, top), part in claimed.groupby(["subject", "top_speed_mps"])
    }
    return found(
        [
            Condition(
                name=name,
                effect=at_least(name, each, _NOMINAL, below=True).effect,
                margin=SHARE.value,
            )
            for name, each in covered.items()
        ],
        n=total(claimed, "n"),
        shown=max(covered.values(), key=lambda estimate: estimate.high),
    )


CLAIM = Claim(
    row=13,
    claim="other uncertainty estimates are over-confident",
    where="Section I",
    rule=(
        "coverage of nominal 90 % sets out of distribution (HAU, dropout, ensemble); "
        "below 0.9 for each, by the margin"
    ),
    formula=r"P(s\le q_{90\%}\mid\text{shift})<0.9",
    unit="1",
    margin=str(SHARE),
    revised="A margin: coverage has to be missed by a twentieth.",
    chapter="forecast",
    decide=_decide,
)
