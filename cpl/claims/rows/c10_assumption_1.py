"""Row 10: the switching policy satisfies Assumption 1 by design."""

from functools import lru_cache

import numpy as np
import pandas as pd

from cpl.claims.claim import Claim, Reader
from cpl.claims.judging import at_least, found
from cpl.claims.verdict import Finding
from cpl.rng import stream
from cpl.stats import Estimate, Weights, hierarchical_weights, interval, sums

__all__ = ["CLAIM"]


def _decide(read: Reader) -> Finding:
    rides = read("switch_choice")
    alpha = float(rides.parameters["alpha"])
    switched = np.char.startswith(rides["policy"].astype(str), "switch")
    rows = rides.where(switched).table
    rates = {
        f"{policy}, up to {top:g} m/s": rate
        for (policy, top), part in rows.groupby(["policy", "top_mps"])  # pyright: ignore[reportGeneralTypeIssues]
        if (rate := _share(part, "floor_missed", "floor_scored")) is not None
    }
    return found(
        [at_least(name, rate, alpha, below=True) for name, rate in rates.items()],
        n=rides.where(switched).total("floor_scored"),
        shown=max(rates.values(), key=lambda rate: rate.high),
    )


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
    rule=(
        "error rate on windows with q >= q_floor, for each threshold and range; each below alpha"
    ),
    formula=r"q_t\ge q_{\mathrm{floor}}\;\Rightarrow\;\overline{\mathrm{err}}<\alpha",
    unit="1",
    margin="none: alpha is the level, and any distance from it counts",
    revised=(
        "Each policy and range is a condition of its own; before, only the worst was looked at."
    ),
    chapter="switch",
    decide=_decide,
)
