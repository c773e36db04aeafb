"""What the rules about the trade-off share, from block sums over training and environment seeds.

"Average speed at the same collision frequency" has eight readings: collisions per episode, per km
or per overtaken car, or the duration that the figure's axis shows, each by a speed averaged within
episodes or over steps. All decide. A lead is the mean difference of the speeds over the collision
levels that two curves have in common. The baselines are those of the paper, as published.
"""

from collections.abc import Sequence
from functools import lru_cache

import pandas as pd

from cpl.claims.claim import Source
from cpl.claims.judging import Condition
from cpl.claims.margins import SPEED
from cpl.policies.comparison import compare
from cpl.policies.measures import READINGS
from cpl.stats import Estimate, Lead

__all__ = ["BASELINES", "CONTROLS", "PLAINEST", "control_leads", "lead", "least", "widest"]

BASELINES = ("none", "dropout", "ensemble", "hau", "certificates")
CONTROLS = {"donor": "the quantile of another episode", "mean profile": "the mean quantile"}
PLAINEST = "crashes per episode, episode speed"
_ENDS = ("safe", "never")


@lru_cache(maxsize=64)
def lead(source: Source, baseline: str, reading: str) -> Lead:
    """Compare the switch with a baseline, once for all rows that ask."""
    return compare(
        widest(source),
        {"method": "conformal"},
        {"method": baseline, "calibrated": False},
        READINGS[reading],
        ends=tuple({"method": end} for end in _ENDS),
    )


@lru_cache(maxsize=4)
def control_leads(source: Source) -> tuple[Condition, ...]:
    """Return the switch's leads over controls that have all of its quantile but the information."""
    return tuple(
        Condition(
            name=f"over {told}: {reading}",
            effect=compare(
                source.table,
                {"control": "conformal"},
                {"control": control},
                axes,
                ends=tuple({"control": end} for end in _ENDS),
            ).mean,
            margin=SPEED.value,
        )
        for reading, axes in READINGS.items()
        for control, told in CONTROLS.items()
    )


def least(conditions: Sequence[Condition]) -> Estimate:
    """Return the least effect in the plainest reading: a row shows one number."""
    plain = [one.effect for one in conditions if one.name.endswith(PLAINEST)]
    return min(plain, key=lambda effect: effect.value)


def widest(source: Source) -> pd.DataFrame:
    """Return the rows in the range of the paper's figure."""
    return source.where(source["top_mps"] == source.parameters["top_speed_mps"]).table
