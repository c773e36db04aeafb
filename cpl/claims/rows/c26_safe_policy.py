"""Row 26: the safe policy alone is slow and safe (the star)."""

import numpy as np

from cpl.claims.claim import Claim, Reader
from cpl.claims.judging import Condition, at_least, found
from cpl.claims.margins import DURATION, SPEED
from cpl.claims.verdict import Finding
from cpl.policies.comparison import chosen, estimates, weights_for
from cpl.policies.measures import cube, measure
from cpl.stats import interval, sums

__all__ = ["CLAIM"]

_MARGINS = (("duration_s", 1, DURATION), ("step_speed_mps", -1, SPEED))


def _decide(read: Reader) -> Finding:
    source = read("pareto")
    alpha = float(source.parameters["alpha"])
    conditions, crashes = [], {}
    for top in np.unique(source["top_mps"]).tolist():
        part = source.where(source["top_mps"] == top).table
        safe, fast = (chosen(part, {"method": name}) for name in ("safe", "speed"))
        weights = weights_for(safe)
        both = [sums(cube(rows), weights) for rows in (safe, fast)]
        for name, sign, margin in _MARGINS:
            values, drawn = ([measure(pair[k], name) for pair in both] for k in (0, 1))
            gap, gaps = sign * (values[0] - values[1]), sign * (drawn[0] - drawn[1])
            effect = interval(float(gap[0]), gaps[:, 0], groups=weights.groups)
            said = "longer" if sign > 0 else "slower"
            conditions.append(
                Condition(name=f"{said}, up to {top:g} m/s", effect=effect, margin=margin.value)
            )
        (crashes[top],) = estimates(safe, "crash_rate")
        conditions.append(at_least(f"crashes, up to {top:g} m/s", crashes[top], alpha, below=True))
    main = float(source.parameters["top_speed_mps"])
    return found(conditions, n=source.total("episodes"), shown=crashes[main])


CLAIM = Claim(
    row=26,
    claim="the safe policy alone is slow and safe (the star)",
    where="Figure 2",
    rule=(
        "crash share of pi_safe in [20, 40]; below alpha in every range, and pi_safe "
        "lasts longer and drives slower than pi_speed"
    ),
    formula=r"\pi_{\mathrm{safe}}:\ \text{slow and safe}",
    unit="1",
    margin=(
        f"{DURATION}; {SPEED}; alpha for the crash share: the rate of failures that the method "
        "is asked for"
    ),
    revised=(
        "The first rule was satisfied although three of ten safe policies crash in 21 to "
        "70 % of the episodes. Safe means now that fewer than alpha crash."
    ),
    chapter="switch",
    decide=_decide,
)
