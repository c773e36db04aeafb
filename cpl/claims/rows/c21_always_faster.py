"""Row 21: it is always faster at the same collision frequency."""

from cpl.claims.claim import Claim, Reader
from cpl.claims.judging import Condition, found
from cpl.claims.margins import SPEED
from cpl.claims.rows._pareto import BASELINES, lead, least
from cpl.claims.verdict import Finding
from cpl.policies.measures import READINGS
from cpl.stats import Estimate, Lead

__all__ = ["CLAIM"]


def _decide(read: Reader) -> Finding:
    source = read("pareto")
    conditions = [
        Condition(
            name=f"over {name}, level {k + 1} of {len(one.levels)}: {reading}",
            effect=_at(one, k),
            margin=SPEED.value,
        )
        for reading in READINGS
        for name in BASELINES
        for one in [lead(source, name, reading)]
        for k in range(len(one.levels))
    ]
    return found(conditions, n=source.total("episodes"), shown=least(conditions))


def _at(lead: Lead, k: int) -> Estimate:
    """Return the lead at one level; the band holds at all levels together."""
    value, low, high = (float(getattr(lead.gain, end)[k]) for end in ("value", "low", "high"))
    return Estimate(value=value, low=low, high=high, n=lead.gain.n)


CLAIM = Claim(
    row=21,
    claim="it is always faster at the same collision frequency",
    where="Figure 2",
    paper_value="always",
    rule=(
        "lead in speed at each of twelve common collision levels (simultaneous bands), "
        "over five baselines in eight readings; all must hold; shown: the least by "
        "collisions per episode and episode speed"
    ),
    formula=r"v_{\mathrm{switch}}(c)>v_{k}(c)\quad\forall c",
    unit="m/s",
    margin=str(SPEED),
    revised=(
        "Levels are conditions with a margin, in all eight readings; the number was a "
        "share of levels whose interval was none."
    ),
    chapter="switch",
    decide=_decide,
)
