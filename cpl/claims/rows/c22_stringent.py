"""Row 22: its gain is larger for more stringent q_safe."""

import numpy as np
import pandas as pd

from cpl.claims.claim import Claim, Reader
from cpl.claims.judging import Condition, found
from cpl.claims.margins import SPEED
from cpl.claims.rows._pareto import BASELINES, least, widest
from cpl.claims.verdict import Finding
from cpl.policies.comparison import chosen, curve_of, weights_for
from cpl.policies.measures import READINGS, Axes
from cpl.stats import Estimate, at_levels, common_levels, interval

__all__ = ["CLAIM"]


def _decide(read: Reader) -> Finding:
    source = read("pareto")
    conditions = [
        Condition(name=reading, effect=_growth(widest(source), axes), margin=SPEED.value)
        for reading, axes in READINGS.items()
    ]
    return found(conditions, n=source.total("episodes"), shown=least(conditions))


def _growth(table: pd.DataFrame, axes: Axes) -> Estimate:
    """Return by how much the mean gain over the baselines grows to the most stringent q_safe."""
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
    scale = float(np.ptp(q_safe)) / float(centred @ centred)
    return interval(scale * float(gain @ centred), scale * (gains @ centred), groups=weights.groups)


CLAIM = Claim(
    row=22,
    claim="its gain is larger for more stringent q_safe",
    where="Section IV-F",
    rule=(
        "growth of the gain over the mean of the baselines from the laxest to the most "
        "stringent q_safe, by its slope, in every reading; shown: by collisions per "
        "episode and episode speed"
    ),
    formula=r"\partial_{q_{\mathrm{safe}}}\,(v_{\mathrm{switch}}-\bar v_k)<0",
    unit="m/s",
    margin=str(SPEED),
    revised=(
        "A slope in m/s per unit of threshold had no margin that one could justify; its "
        "product with the range of thresholds has the unit of the gain, and its margin."
    ),
    chapter="switch",
    decide=_decide,
)
