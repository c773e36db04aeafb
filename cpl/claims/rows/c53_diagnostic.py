"""Row 53: the coverage of a frozen margin tells where the quantile makes a difference."""

import numpy as np

from cpl.claims.claim import Claim, Reader, Source
from cpl.claims.judging import Condition, found
from cpl.claims.rows._gate import changing, without
from cpl.claims.verdict import Finding
from cpl.stats import rank_correlation

__all__ = ["CLAIM"]

_MARGIN = 0.1  # a twentieth of the way from -1 to 1


def _decide(read: Reader) -> Finding:
    table, windows = changing(read("gate_stream")), read("gate_diagnostic")
    conditions = [
        _agreement("eight worlds", table, windows),
        _agreement("without noise and braking", without(table, "noise", "braking"), windows),
    ]
    own = table.where(table["method"] == "quantile")
    return found(conditions, n=own.total("episodes"), shown=conditions[0].effect)


def _agreement(name: str, table: Source, windows: Source) -> Condition:
    """Return the rank correlation over worlds."""
    road = windows.where(windows["log"] == "road")
    worlds = sorted(set(table["world"]) & set(road["part"]))
    missing = [
        float(np.mean((road["nominal"] - road["coverage"])[road["part"] == world]))
        for world in worlds
    ]
    frozen, tracked = (
        [part.where(part["world"] == world).total("crashes") for world in worlds]
        for part in (table.where(table["method"] == method) for method in ("frozen", "quantile"))
    )
    effect = rank_correlation(missing, np.subtract(frozen, tracked))
    return Condition(name=name, effect=effect, margin=_MARGIN)


CLAIM = Claim(
    row=53,
    claim="the coverage of a frozen margin tells where the quantile makes a difference",
    where="this book, Where the quantile earns its place",
    rule=(
        "rank correlation over the worlds of what a frozen margin fails to cover (other "
        "episodes) and of how much less often the quantile's gate crashes than the frozen"
        " one's; in all worlds, and without noise and braking (seeds are worlds)"
    ),
    formula=r"\rho\bigl(1-\alpha-C_w,\ c^{\mathrm{frozen}}_w-c^{\mathrm{quantile}}_w\bigr)>0",
    unit="1",
    margin=f"{_MARGIN:g}: a twentieth of the way from -1 to 1",
    revised="The interval ignored that there are eight worlds; it is over worlds now.",
    chapter="earns",
    ours=True,
    decide=_decide,
)
