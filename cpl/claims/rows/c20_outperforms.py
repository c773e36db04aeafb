"""Row 20: the switch outperforms five uncertainty baselines."""

from cpl.claims.claim import Claim, Reader
from cpl.claims.rows._pareto import BASELINES, PLANES, lead
from cpl.claims.verdict import Finding, rule_r
from cpl.stats import Estimate, holm

__all__ = ["CLAIM"]

_LEVEL = 0.05  # of the family of five tests


def _decide(read: Reader) -> Finding:
    source = read("pareto")
    conditions, estimates = [], []
    for plane in PLANES:
        leads = {name: lead(source, name, plane) for name in BASELINES}
        adjusted = holm([one.p for one in leads.values()])
        for one, p in zip(leads.values(), adjusted, strict=True):
            larger = one.volume.value > 0 and p < _LEVEL
            low = one.least.low if larger else min(one.least.low, 0.0)
            conditions.append(Estimate(value=one.least.value, low=low, high=one.least.high, n=1))
            estimates.append(one.least)
    least = min(estimates, key=lambda estimate: estimate.value)
    verdict = rule_r(conditions, [None] * len(conditions))
    return Finding.of(verdict, least, n=source.total("episodes"))


CLAIM = Claim(
    row=20,
    claim="the switch outperforms five uncertainty baselines",
    where="Section IV-F, Figure 2",
    rule="least speed difference over the common collision levels; simultaneous band above 0 and "
    "hypervolume larger (Holm over five), by duration and by collisions per km",
    chapter="switch",
    decide=_decide,
)
