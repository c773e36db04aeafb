"""Row 14: alpha is one interpretable knob between greedy and conservative."""

from dataclasses import replace

import numpy as np
import pandas as pd
from scipy import stats as sp

from cpl.claims.claim import Claim, Reader
from cpl.claims.judging import Condition, found
from cpl.claims.margins import PER_KM, SPEED
from cpl.claims.verdict import Finding, Verdict
from cpl.policies.comparison import weights_for
from cpl.policies.measures import SUMS, cube, measure
from cpl.stats import interval, sums

__all__ = ["CLAIM"]

_MARGINS = {"step_speed_mps": SPEED, "crashes_per_km": PER_KM}


def _decide(read: Reader) -> Finding:
    source = read("switch_ablation")
    names = source["variant"].astype(str)
    table = source.where((names == "default") | np.char.startswith(names, "alpha")).table
    named = table.assign(level=table["alpha"])
    pooled = pd.DataFrame(named.groupby(["pair", "level", "block"])[list(SUMS)].sum())
    weights = weights_for(table)
    total, drawn = sums(cube(pooled.reset_index()), weights)
    alphas = np.unique(table["alpha"])
    ranks, spans = [], []
    for name, margin in _MARGINS.items():
        values, resampled = measure(total, name), measure(drawn, name)
        span = resampled[:, -1] - resampled[:, 0]
        gain = interval(float(values[-1] - values[0]), span, groups=weights.groups)
        spans.append(Condition(name=name, effect=gain, margin=margin.value))
        ranks.append(_rank_correlation(alphas, values))
    made = found(spans, n=source.total("episodes"), shown=spans[0].effect)
    if made.verdict is Verdict.HOLDS and (min(ranks) < 1 or len(alphas) < 5):
        return replace(made, verdict=Verdict.IN_PART, flags=("not monotone",))
    return made


def _rank_correlation(x: np.ndarray, y: np.ndarray) -> float:
    """Return Spearman's coefficient, without the last bits that keep it from being 1."""
    return round(float(np.corrcoef(sp.rankdata(x), sp.rankdata(y))[0, 1]), 12)


CLAIM = Claim(
    row=14,
    claim="alpha is one interpretable knob between greedy and conservative",
    where="Section II",
    rule=(
        "change of the step speed, and of collisions per km, from the least alpha to the "
        "greatest of five; both monotone"
    ),
    formula=r"\alpha\mapsto(\text{speed},\text{collisions})\ \text{increasing}",
    unit="m/s",
    margin=f"{SPEED}; {PER_KM}",
    revised=(
        "The number was a rank correlation of five points, which has no interval. It is "
        "now the change of the speed over the range of alpha; both must still rise at "
        "every step."
    ),
    chapter="switch",
    decide=_decide,
)
