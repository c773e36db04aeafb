"""Row 15: four lanes, fifty cars, speed ranges 20-30, 20-40 and 20-50 m/s."""

import numpy as np

from cpl.claims.claim import INCONSISTENT, Claim, Reader
from cpl.claims.verdict import Finding, Verdict

__all__ = ["CLAIM"]

_NEAR = 1.0  # [m/s] a speed level counts as reached; cars approach it exponentially


def _decide(read: Reader) -> Finding:
    throttle = read("speed_cap")
    as_stated = bool(
        (throttle["lanes_count"] == 4).all() and (throttle["vehicles_count"] == 50).all()
    )
    tops = np.unique(throttle["top_mps"])
    reached = [throttle.where(throttle["top_mps"] == top)["speed_mps"].max() for top in tops]
    possible = [speed >= top - _NEAR for speed, top in zip(reached, tops, strict=True)]
    some = Verdict.IN_PART if any(possible) else Verdict.FAILS
    return Finding(
        verdict=Verdict.HOLDS
        if all(possible) and as_stated
        else some
        if as_stated
        else Verdict.FAILS,
        value=float(reached[-1]),
        n=len(throttle),
        n_seeds=0,
    )


CLAIM = Claim(
    row=15,
    claim="four lanes, fifty cars, speed ranges 20-30, 20-40 and 20-50 m/s",
    where="Section IV-A, IV-F",
    paper_value="up to 50 m/s",
    rule="highest speed in the widest range; the configuration must match and every range be "
    "reachable (in part: some are)",
    formula=r"4\ \text{lanes},\ 50\ \text{cars},\ v\in[20,50]\,\mathrm{m/s}",
    unit="m/s",
    margin="1 m/s: cars approach a speed exponentially",
    chapter="road",
    flags=(INCONSISTENT,),
    decide=_decide,
)
