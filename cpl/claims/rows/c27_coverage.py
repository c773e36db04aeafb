"""Row 27: 90 % coverage is verified empirically."""

import numpy as np

from cpl.claims.claim import Claim, Reader
from cpl.claims.judging import Condition, at_least, found
from cpl.claims.rows._forecast import in_range, total
from cpl.claims.verdict import Finding, Verdict
from cpl.stats import mean_interval

__all__ = ["CLAIM"]

_ENOUGH, _NEAR = 100_000, 0.01  # [steps]; how near to 1 - alpha coverage must be


def _decide(read: Reader) -> Finding:
    source = read("coverage_episodes")
    rows = in_range(source, "miss")
    rows = rows[rows["group"] == "all"]
    target = 1 - float(source.parameters["alpha"])
    covered = {
        "carried on" if carry else "reset": mean_interval(1 - part["value"] / part["n"])
        for carry, part in rows.groupby("carry")
    }
    conditions = [
        Condition(name=f"q {name}", effect=at_least(name, each, target).effect, margin=_NEAR,
                  same=True)
        for name, each in covered.items()
    ]  # fmt: skip
    n = total(rows[~rows["carry"]], "n")
    made = found(conditions, n=n, shown=covered["reset"])
    steps = [total(part, "n") for _, part in rows.groupby("carry")]
    if made.verdict is Verdict.HOLDS and np.min(steps) < _ENOUGH:
        return Finding.of(Verdict.UNDECIDED, covered["reset"], n=n)
    return made


CLAIM = Claim(
    row=27,
    claim="90 % coverage is verified empirically",
    where="Section IV-F, Figure 3",
    paper_value="0.90",
    rule="pooled coverage over at least 1e5 steps; 0.90 +- 0.01 with q reset and with q carried on",
    formula=r"\hat P(s_t\le q_t)=0.90",
    unit="1",
    margin=f"{_NEAR:g}: the two digits that the paper prints",
    revised="Intervals decide, not the pooled number alone.",
    chapter="trust",
    decide=_decide,
)
