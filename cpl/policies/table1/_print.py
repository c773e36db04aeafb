"""Table I as it is printed, and our cells beside it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pandas as pd

from cpl.policies.table1._cells import Cells
from cpl.stats import Estimate

__all__ = [
    "CARRIED",
    "LEARNED",
    "MARGINS",
    "PRINTED",
    "ROWS",
    "SWITCH",
    "Printed",
    "against_print",
    "agreement",
    "equivalent",
]

SWITCH = "switch 0.3"
"""The switch at the threshold that a commented line of the paper's source gives."""

LEARNED = ("rl_nq", "rl", "rl_1", "rl_2", "rl_3")
ROWS = ("speed", *LEARNED, SWITCH)
"""The rows of Table I, in its order."""

CARRIED = tuple(f"{agent} carried" for agent in LEARNED)


class Printed(NamedTuple):
    """A cell of Table I: means and standard deviations over 500 episodes."""

    duration_s: float
    duration_sd_s: float
    speed_mps: float
    speed_sd_mps: float


_TOPS = (30.0, 40.0, 50.0)
_TABLE = {
    "speed": ((33.6, 11.0, 29.0, 1.2), (19.4, 11.7, 35.1, 2.9), (13.3, 9.0, 36.0, 2.5)),
    "rl_nq": ((32.7, 11.5, 29.3, 0.9), (19.4, 11.3, 34.5, 3.1), (20.3, 11.7, 34.1, 2.6)),
    "rl": ((32.2, 11.3, 29.4, 0.8), (25.0, 11.7, 32.1, 3.0), (20.1, 11.9, 34.0, 2.1)),
    "rl_1": ((33.2, 11.3, 29.3, 0.9), (13.1, 8.6, 36.0, 2.3), (13.3, 9.0, 36.0, 2.5)),
    "rl_2": ((34.4, 10.6, 29.4, 0.9), (16.5, 9.5, 35.6, 2.8), (16.7, 10.6, 36.3, 2.6)),
    "rl_3": ((33.5, 11.6, 28.8, 1.4), (18.0, 10.8, 33.8, 3.5), (19.5, 11.8, 34.2, 3.1)),
    SWITCH: ((38.7, 4.5, 24.2, 1.5), (37.8, 4.7, 23.9, 1.8), (34.9, 8.0, 25.3, 2.3)),
}
PRINTED = {
    (policy, top): Printed(*cell)
    for policy, cells in _TABLE.items()
    for top, cell in zip(_TOPS, cells, strict=True)
}
"""Table I as printed, by row and top of the speed range [m/s]."""

MARGINS = {"duration_s": 2.0, "episode_speed_mps": 1.0}
"""How far a mean may be from the printed one and still count as the same."""


def equivalent(ours: Estimate, printed: float, margin: float) -> str:
    """Say whether our mean is the printed one, give or take a margin.

    Args:
        ours: Our mean with its interval.
        printed: The printed mean.
        margin: How far apart still counts as the same.

    Returns:
        "same" if the whole interval is within the margin of the printed mean, "other" if the whole
        of it is beyond, else "open".

    Examples:
        >>> wide = Estimate(value=30.0, low=27.0, high=33.0, n=10)
        >>> [equivalent(wide, printed, 2.0) for printed in (30.0, 36.0)]
        ['open', 'other']
    """
    if printed - margin <= ours.low and ours.high <= printed + margin:
        return "same"
    apart = ours.low > printed + margin or ours.high < printed - margin
    return "other" if apart else "open"


def against_print(cells: Cells, *, switch: str = SWITCH) -> pd.DataFrame:
    """Set every printed cell beside ours.

    Args:
        cells: Ours.
        switch: Which of our thresholds stands for the printed switch.

    Returns:
        One row a cell and measure: `policy`, `top_mps`, `measure`, `printed`, `ours`, `low`,
        `high`, `verdict` (see `equivalent`), and `foretold`: whether the printed mean is where one
        more training seed of ours is to be expected (95 %).
    """
    rows = []
    for (policy, top), cell in PRINTED.items():
        if top not in cells.tops:
            continue
        name = switch if policy == SWITCH else policy
        for measure, printed in (
            ("duration_s", cell.duration_s),
            ("episode_speed_mps", cell.speed_mps),
        ):
            ours = cells.estimate(measure, name, top)
            expected = cells.foretold(measure, name, top)
            rows.append(
                {
                    "policy": policy,
                    "top_mps": top,
                    "measure": measure,
                    "printed": printed,
                    "ours": ours.value,
                    "low": ours.low,
                    "high": ours.high,
                    "verdict": equivalent(ours, printed, MARGINS[measure]),
                    "foretold": bool(expected.low <= printed <= expected.high),
                }
            )
    return pd.DataFrame(rows)


def agreement(table: pd.DataFrame, first: str, second: str, top: float) -> pd.DataFrame:
    """Compare the four printed numbers of two policies, each training seed with each.

    Args:
        table: What the experiment returns.
        first: One policy.
        second: Another.
        top: The speed range.

    Returns:
        One row a pair of training seeds: `pair`, `other`, and how far apart, rounded as printed,
        `duration_s`, `duration_sd_s`, `speed_mps` and `speed_sd_mps` are; `all` if none is.
    """
    numbers = {}
    for policy in (first, second):
        rows = table.loc[(table["policy"] == policy) & (table["top_mps"] == top)]
        speed = rows["speed_sum"] / rows["steps"]
        for pair in np.unique(rows["pair"]):
            own = (rows["pair"] == pair).to_numpy()
            d, v = rows["steps"].to_numpy(np.float64)[own], speed.to_numpy(np.float64)[own]
            numbers[policy, pair] = np.round([d.mean(), d.std(), v.mean(), v.std()], 1)
    pairs = np.unique(table["pair"]).tolist()
    names = ["duration_s", "duration_sd_s", "speed_mps", "speed_sd_mps"]
    made = pd.DataFrame(
        [
            (k, other, *np.round(np.abs(numbers[first, k] - numbers[second, other]), 1))
            for k in pairs
            for other in pairs
        ],
        columns=["pair", "other", *names],
    )
    made["all"] = (made[names] == 0).all(axis=1)
    return made
