"""Where one way to drive stands beside the others: in every speed range and plane at once."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import pandas as pd

from cpl.policies.comparison import chosen, compare
from cpl.policies.measures import AXES, Axes, table_of
from cpl.stats import Estimate

__all__ = ["marked", "overview", "sound_pairs", "standings"]

_SOUND = 0.1  # share of episodes in which a sound safe policy may crash when it drives alone
_DECIDE = ("paper", "exposure")
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


def sound_pairs(table: pd.DataFrame, *, most: float = _SOUND) -> list[int]:
    """Return the pairs whose safe policy is safe: alone, it crashes in few of its episodes.

    Args:
        table: Block sums in one speed range, with the method `safe`.
        most: Share of episodes that may crash [-].
    """
    alone = table_of(chosen(table, {"method": "safe"}), ["pair"])
    return sorted(alone.loc[alone["crash_rate"] <= most, "pair"].tolist())


def overview(
    table: pd.DataFrame, first: str, others: Sequence[str], *, top_mps: float
) -> pd.DataFrame:
    """Say in one table of text where a method stands.

    The main range has all planes; the two that decide have rows for the other ranges, for rivals
    that were calibrated, and for the pairs whose safe policy is sound.

    Args:
        table: What `cpl.experiments.switch.pareto` returns.
        first: The method whose leads they are.
        others: The methods beside it.
        top_mps: Upper end of the main range [m/s].

    Returns:
        `top_mps`, `rivals`, `plane`, and for each of the others its lead as `marked` text.
    """
    main = chosen(table, {"top_mps": top_mps})
    deciding = {name: AXES[name] for name in _DECIDE}
    sound = main.loc[main["pair"].isin(sound_pairs(main))]
    sides = table.loc[table["top_mps"] != top_mps]
    parts = [
        standings(main, first, others, AXES).assign(rivals="as published"),
        standings(sound, first, others, deciding).assign(rivals="as published, sound pairs"),
        standings(main, first, others, deciding, calibrated=True).assign(rivals="calibrated"),
        standings(sides, first, others, deciding).assign(rivals="as published"),
    ]
    joined = pd.concat(parts, ignore_index=True)
    texts = joined[list(others)].map(marked, na_action="ignore").fillna("")
    return pd.concat([joined[["top_mps", "rivals", "plane"]], texts], axis=1)


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
