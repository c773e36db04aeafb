"""Row 28: coverage in windows of 5 steps is above 0.9 most of the time."""

from cpl.claims.claim import Claim, Reader
from cpl.claims.judging import Condition, found
from cpl.claims.margins import SHARE
from cpl.claims.rows._forecast import in_range, total
from cpl.claims.verdict import Finding
from cpl.stats import mean_interval

__all__ = ["CLAIM"]


def _decide(read: Reader) -> Finding:
    source = read("coverage_episodes")
    rows = in_range(source, "window")
    chance = (1 - float(source.parameters["alpha"])) ** int(source.parameters["window"])
    gaps = {
        "carried on" if carry else "reset": mean_interval(part["value"] / part["n"] - chance)
        for carry, part in rows.groupby("carry")
    }
    return found(
        [Condition(name=f"q {name}", effect=gap, margin=SHARE.value) for name, gap in gaps.items()],
        n=total(rows, "n"),
    )


CLAIM = Claim(
    row=28,
    claim="coverage in windows of 5 steps is above 0.9 most of the time",
    where="Figure 3",
    paper_value="most of the time",
    rule=(
        "share of windows at or above 0.9, minus the 59 % of an exact independent 90 % "
        "process; with q reset and with q carried on"
    ),
    formula=r"P\Bigl(\tfrac15\sum_{i<5}\mathbf 1[s_{t-i}\le q_{t-i}]\ge0.9\Bigr)",
    unit="1",
    margin=str(SHARE),
    revised="A margin.",
    chapter="trust",
    decide=_decide,
)
