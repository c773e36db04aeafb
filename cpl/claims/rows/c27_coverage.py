"""Row 27: 90 % coverage is verified empirically."""

from cpl.claims.claim import Claim, Reader
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
    near: list[bool] = []
    enough = True
    for _, part in rows.groupby("carry"):
        steps = total(part, "n")
        near.append(abs(1 - total(part, "value") / steps - target) <= _NEAR)
        enough &= steps >= _ENOUGH
    reset = rows[~rows["carry"]]
    estimate = mean_interval(1 - reset["value"] / reset["n"])
    if all(near) and len(near) == 2:
        verdict = Verdict.HOLDS if enough else Verdict.UNDECIDED
    else:
        verdict = Verdict.IN_PART if any(near) else Verdict.FAILS
    return Finding.of(verdict, estimate, n=total(reset, "n"))


CLAIM = Claim(
    row=27,
    claim="90 % coverage is verified empirically",
    where="Section IV-F, Figure 3",
    paper_value="0.90",
    rule="pooled coverage over at least 1e5 steps; 0.90 +- 0.01 with q reset and with q carried on",
    chapter="trust",
    decide=_decide,
)
