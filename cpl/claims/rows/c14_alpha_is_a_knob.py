"""Row 14: alpha is one interpretable knob between greedy and conservative."""

import numpy as np
import pandas as pd
from scipy import stats as sp

from cpl.claims.claim import Claim, Reader
from cpl.claims.verdict import Finding, Verdict, rule_r
from cpl.policies.comparison import weights_for
from cpl.policies.measures import SUMS, cube, measure
from cpl.stats import interval, sums

__all__ = ["CLAIM"]


def _decide(read: Reader) -> Finding:
    source = read("switch_ablation")
    names = source["variant"].astype(str)
    table = source.where((names == "default") | np.char.startswith(names, "alpha")).table
    named = table.assign(level=table["alpha"])
    pooled = pd.DataFrame(named.groupby(["pair", "level", "block"])[list(SUMS)].sum())
    weights = weights_for(table)
    total, drawn = sums(cube(pooled.reset_index()), weights)
    groups, alphas = weights.groups, np.unique(table["alpha"])
    wanted = ("step_speed_mps", "crashes_per_km")
    ranks = [_rank_correlation(alphas, measure(total, name)) for name in wanted]
    spans = []
    for name in wanted:
        values, resampled = measure(total, name), measure(drawn, name)
        span = resampled[:, -1] - resampled[:, 0]
        spans.append(interval(float(values[-1] - values[0]), span, groups=groups))
    verdict = rule_r(spans, [None, None])
    if verdict is Verdict.HOLDS and (min(ranks) < 1 or len(alphas) < 5):
        verdict = Verdict.IN_PART
    return Finding(
        verdict=verdict,
        value=min(ranks),
        n=source.total("episodes"),
        n_seeds=groups,
    )


def _rank_correlation(x: np.ndarray, y: np.ndarray) -> float:
    """Return Spearman's coefficient, without the last bits that keep it from being 1."""
    return round(float(np.corrcoef(sp.rankdata(x), sp.rankdata(y))[0, 1]), 12)


CLAIM = Claim(
    row=14,
    claim="alpha is one interpretable knob between greedy and conservative",
    where="Section II",
    rule="rank correlation of alpha with speed and collisions over five values; both monotone",
    chapter="switch",
    decide=_decide,
)
