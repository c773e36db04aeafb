"""Row 26: the safe policy alone is slow and safe (the star)."""

from dataclasses import replace

import numpy as np

from cpl.claims.claim import Claim, Reader
from cpl.claims.verdict import Finding, rule_r
from cpl.policies.comparison import chosen, weights_for
from cpl.policies.measures import cube, measure
from cpl.stats import interval, sums

__all__ = ["CLAIM"]


def _decide(read: Reader) -> Finding:
    source = read("pareto")
    found, durations = [], {}
    for top in np.unique(source["top_mps"]):
        part = source.where(source["top_mps"] == top).table
        safe, fast = (chosen(part, {"method": name}) for name in ("safe", "speed"))
        weights = weights_for(safe)
        both = [sums(cube(rows), weights) for rows in (safe, fast)]
        for name, sign in (("duration_s", 1), ("step_speed_mps", -1)):
            values, drawn = ([measure(pair[k], name) for pair in both] for k in (0, 1))
            gap, gaps = sign * (values[0] - values[1]), sign * (drawn[0] - drawn[1])
            found.append(interval(float(gap[0]), gaps[:, 0], groups=weights.groups))
        values, drawn = (measure(both[0][k], "duration_s") for k in (0, 1))
        durations[float(top)] = interval(float(values[0]), drawn[:, 0], groups=weights.groups)
    verdict = rule_r(found, [None] * len(found))
    main, clock = (float(source.parameters[name]) for name in ("top_speed_mps", "duration_s"))
    # The interval is symmetric about the mean; no episode lasts longer than the clock lets it.
    star = replace(durations[main], high=min(durations[main].high, clock))
    return Finding.of(verdict, star, n=source.total("episodes"))


CLAIM = Claim(
    row=26,
    claim="the safe policy alone is slow and safe (the star)",
    where="Figure 2",
    rule="mean duration of the safe policy; longer and slower than the fast one in every range",
    chapter="switch",
    decide=_decide,
)
