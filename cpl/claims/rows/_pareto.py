"""What the rules about the trade-off share, from block sums over training and environment seeds.

"Outperforms at the same collision frequency" was defined before any result was seen: the lower end
of a simultaneous band is above zero at every level in common, and the hypervolume is larger (Holm
over five baselines), both in the paper's own plane (duration, speed averaged by episode) and per
kilometre driven (collisions per km, speed averaged over steps). The baselines are those of the
paper, as published; calibrated ones are shown in the chapter.
"""

from functools import lru_cache

import pandas as pd

from cpl.claims.claim import Source
from cpl.policies.comparison import compare
from cpl.policies.measures import AXES
from cpl.stats import Lead

__all__ = ["BASELINES", "PLANES", "lead", "widest"]

BASELINES = ("none", "dropout", "ensemble", "hau", "certificates")
PLANES = ("paper", "exposure")


@lru_cache(maxsize=16)
def lead(source: Source, baseline: str, plane: str) -> Lead:
    """Compare the switch with a baseline, once for all rows that ask."""
    return compare(
        widest(source),
        {"method": "conformal"},
        {"method": baseline, "calibrated": False},
        AXES[plane],
        ends=({"method": "safe"}, {"method": "never"}),
    )


def widest(source: Source) -> pd.DataFrame:
    """Return the rows in the range of the paper's figure."""
    return source.where(source["top_mps"] == source.parameters["top_speed_mps"]).table
