"""Row 10: the switching policy satisfies Assumption 1 by design."""

from functools import lru_cache

import numpy as np
import pandas as pd

from cpl.claims.claim import Claim, Reader
from cpl.claims.verdict import Finding, Verdict
from cpl.rng import stream
from cpl.stats import Estimate, Weights, hierarchical_weights, interval, sums

__all__ = ["CLAIM"]


def _decide(read: Reader) -> Finding:
    rides = read("switch_choice")
    alpha = float(rides.parameters["alpha"])
    switched = np.char.startswith(rides["policy"].astype(str), "switch")
    rows = rides.where(switched).table
    found = [
        estimate
        for _, part in rows.groupby(["policy", "top_mps"])
        if (estimate := _share(part, "floor_missed", "floor_scored")) is not None
    ]
    worst = max(found, key=lambda estimate: estimate.high)
    verdict = Verdict.UNDECIDED
    if worst.high < alpha:
        verdict = Verdict.HOLDS
    elif any(estimate.low >= alpha for estimate in found):
        # Somewhere the error rate is certainly not below alpha.
        some = any(estimate.high < alpha for estimate in found)
        verdict = Verdict.IN_PART if some else Verdict.FAILS
    return Finding.of(verdict, worst, n=rides.where(switched).total("floor_scored"))


def _share(rows: pd.DataFrame, hits: str, of: str) -> Estimate | None:
    """Estimate a share over pairs and blocks of 20 environment seeds; None if nothing counted."""
    seeds = rows["seed"].to_numpy()
    named = rows.assign(block=(seeds - seeds.min()) // 20)
    totals = pd.DataFrame(named.groupby(["pair", "block"])[[hits, of]].sum())
    groups, units = (len(np.unique(named[name])) for name in ("pair", "block"))
    if not np.any(totals[of]) or len(totals) != groups * units or units < 2:
        return None
    weights = _weights(groups, units)
    total, drawn = sums(totals.to_numpy(np.float64).reshape(groups, units, 2), weights)
    kept = drawn[:, 1] > 0
    return interval(
        float(total[0] / total[1]), drawn[kept, 0] / drawn[kept, 1], groups=weights.groups
    )


@lru_cache(maxsize=2)
def _weights(groups: int, units: int) -> Weights:
    return hierarchical_weights(groups, units, stream(0, "share", groups, units))


CLAIM = Claim(
    row=10,
    claim="the switching policy satisfies Assumption 1 by design",
    where="Section IV-D",
    rule="error rate on windows with q >= q_floor; its upper bound must be below alpha",
    chapter="switch",
    decide=_decide,
)
