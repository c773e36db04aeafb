"""Row 17: DQN with two layers of 256, 200,000 steps and the stated rewards."""

import numpy as np

from cpl.claims.claim import Claim, Reader
from cpl.claims.verdict import Finding, Verdict
from cpl.stats import mean_interval

__all__ = ["CLAIM"]


def _decide(read: Reader) -> Finding:
    curves = read("base_policies")
    told = curves.parameters
    as_stated = (
        told["steps"] == 200_000
        and list(told["hidden"]) == [256, 256]
        and told["collision_reward"] == -1.0
        and told["high_speed_reward"] == 0.5
    )
    late = curves.where(curves["step"] > told["steps"] / 2).table
    found = {}
    for kind, rows in late.groupby("kind"):
        slopes = [
            np.polyfit(one["step"] / 1e5, one["episode_return"], 1)[0]
            for _, one in rows.groupby("pair")
        ]
        found[kind] = mean_interval(slopes)
    level = all(estimate.low <= 0 <= estimate.high for estimate in found.values())
    verdict = Verdict.FAILS if not as_stated else Verdict.HOLDS if level else Verdict.IN_PART
    if verdict is Verdict.HOLDS and found["speed"].n < 10:
        verdict = Verdict.UNDECIDED
    return Finding.of(verdict, found["speed"], n=len(curves))


CLAIM = Claim(
    row=17,
    claim="DQN with two layers of 256, 200,000 steps and the stated rewards",
    where="Section IV-B",
    paper_value="200,000 steps",
    rule="slope of the learning curve at the end, 10 seeds; the specification must match and the "
    "interval contain 0",
    chapter="switch",
    decide=_decide,
)
