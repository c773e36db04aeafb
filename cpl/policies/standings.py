"""Where one way to drive stands beside the others: in every speed range and plane at once."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import pandas as pd

from cpl.policies.comparison import chosen, compare
from cpl.policies.measures import Axes
from cpl.stats import Estimate

__all__ = ["marked", "standings"]

_ENDS = ({"method": "safe", "calibrated": False}, {"method": "never", "calibrated": False})


def standings(
    table: pd.DataFrame,
    first: str,
    others: Sequence[str],
    planes: Mapping[str, Axes],
    *,
    calibrated: bool = False,
) -> pd.DataFrame:
    """Compare one method with the others in every speed range and plane.

    Args:
        table: Block sums with `top_mps`, `method`, `calibrated`, `pair`, `level`, `block`.
        first: The method whose leads they are, as published.
        others: The methods beside it.
        planes: The planes by name.
        calibrated: Whether the others' uncertainties are the calibrated ones; ranges and methods
            in which there are none are left out.

    Returns:
        One row a range and plane: `top_mps`, `plane`, and for each of the others an Estimate of
        the speed [m/s] that the first is ahead at equal safety, averaged over the levels.
    """
    rows: list[dict[str, object]] = []
    for top, part in table.groupby("top_mps"):
        there = set(part.loc[part["calibrated"] == calibrated, "method"]) & set(others)
        if not there:
            continue
        for plane, axes in planes.items():
            row: dict[str, object] = {"top_mps": top, "plane": plane}
            for other in (name for name in others if name in there):
                row[other] = compare(
                    chosen(part, {"top_mps": top}),
                    {"method": first, "calibrated": False},
                    {"method": other, "calibrated": calibrated},
                    axes,
                    ends=_ENDS,
                ).mean
            rows.append(row)
    return pd.DataFrame(rows)


def marked(estimate: Estimate) -> str:
    """Write an estimate with its sign, and a star if its interval leaves 0 out.

    Examples:
        >>> marked(Estimate(value=0.234, low=0.1, high=0.4, n=10))
        '+0.23*'
        >>> marked(Estimate(value=-0.1, low=-0.3, high=0.1, n=10))
        '-0.10'
    """
    star = "*" if estimate.low > 0 or estimate.high < 0 else ""
    return f"{estimate.value:+.2f}{star}"
