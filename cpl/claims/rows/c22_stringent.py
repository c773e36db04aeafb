"""Row 22: its gain is larger for more stringent q_safe."""

import numpy as np
import pandas as pd

from cpl.claims.claim import Claim, Reader
from cpl.claims.rows._pareto import BASELINES, PLANES, widest
from cpl.claims.verdict import Finding, rule_r
from cpl.policies.comparison import chosen, curve_of, weights_for
from cpl.policies.measures import AXES, Axes
from cpl.stats import Estimate, at_levels, common_levels, interval

__all__ = ["CLAIM"]


def _decide(read: Reader) -> Finding:
    source = read("pareto")
    slopes = [_slope(widest(source), AXES[plane]) for plane in PLANES]
    verdict = rule_r(slopes, [None, None])
    least = min(slopes, key=lambda slope: slope.value)
    return Finding.of(verdict, least, n=source.total("episodes"))


def _slope(table: pd.DataFrame, axes: Axes) -> Estimate:
    """Return how much the gain over the mean of the baselines grows as q_safe gets smaller."""
    ours = chosen(table, {"method": "conformal"})
    weights = weights_for(ours)
    curves = [
        curve_of(chosen(table, {"method": name, "calibrated": False}), axes, weights)
        for name in ("conformal", *BASELINES)
    ]
    levels = common_levels(*[curve.x for curve in curves], count=12)
    threshold = np.asarray(ours.groupby("level")["value"].mean(), np.float64)
    q_safe = at_levels(curves[0].x, threshold, levels)
    read = [at_levels(curve.x, curve.y, levels) for curve in curves]
    drawn = [at_levels(curve.x_drawn, curve.y_drawn, levels) for curve in curves]
    gain, gains = (part[0] - np.mean(part[1:], axis=0) for part in (read, drawn))
    centred = -(q_safe - q_safe.mean())
    scale = float(centred @ centred)
    return interval(float(gain @ centred) / scale, gains @ centred / scale, groups=weights.groups)


CLAIM = Claim(
    row=22,
    claim="its gain is larger for more stringent q_safe",
    where="Section IV-F",
    rule="slope of the gain over q_safe; interval above 0",
    chapter="switch",
    decide=_decide,
)
