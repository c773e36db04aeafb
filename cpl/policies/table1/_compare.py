"""The rows of Table I beside each other: ranks, differences, and what a coin would do."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from cpl.policies.table1._cells import Cells
from cpl.policies.table1._print import LEARNED, PRINTED, ROWS, SWITCH
from cpl.stats import Estimate, holm, interval

__all__ = ["beside_hull", "beside_hull_printed", "differences", "ranks"]

Floats = NDArray[np.float64]


def ranks(
    cells: Cells, top: float, *, rows: Sequence[str] = ROWS, name: str = "duration_s"
) -> pd.DataFrame:
    """Say how probable every rank is, 1 the longest.

    Args:
        cells: The table.
        top: The speed range.
        rows: Who is ranked.
        name: By which measure.

    Returns:
        Shares of resamples; rows are policies, columns ranks.
    """
    drawn = np.stack([cells.resampled(name, policy, top) for policy in rows], axis=1)
    order = np.argsort(np.argsort(-drawn, axis=1, kind="stable"), axis=1, kind="stable")
    shares = np.stack([(order == k).mean(axis=0) for k in range(len(rows))], axis=1)
    return pd.DataFrame(shares, index=list(rows), columns=list(range(1, len(rows) + 1)))


def differences(
    cells: Cells, top: float, *, rows: Sequence[str] = ROWS, name: str = "duration_s"
) -> pd.DataFrame:
    """Compare everybody with everybody in one range, with Holm's correction over all pairs.

    Returns:
        One row a pair of policies: `first`, `second`, `gap`, `low`, `high` (not corrected), `p`
        and `p_holm`.
    """
    found = []
    for first, second in combinations(rows, 2):
        gap, p = cells.difference(name, first, second, top)
        found.append((first, second, gap.value, gap.low, gap.high, p))
    made = pd.DataFrame(found, columns=["first", "second", "gap", "low", "high", "p"])
    made["p_holm"] = holm(made["p"].to_numpy())
    return made


def beside_hull(
    cells: Cells,
    top: float,
    policy: str,
    *,
    family: Sequence[str] = ("slow", "safe", *LEARNED),
) -> Estimate:
    r"""Estimate how much longer a policy lasts than a coin that is as fast.

    A coin flipped before each episode that sends one of two policies on the road has the mixture
    of their durations and of their speeds. Of all such coins with the policy's own mean speed, the
    best is on the upper hull of the family's points,

    $$ \Delta = D(\pi) - \max_{i,j,p} \{ p D_i + (1-p) D_j : p V_i + (1-p) V_j = V(\pi) \} $$

    Args:
        cells: The table.
        top: The speed range.
        policy: The policy, the switch say.
        family: Whom the coin may send.

    Returns:
        The gain [s]; NaN if nobody in the family is as fast, or as slow.
    """
    names = (policy, *family)
    own, *others = (
        (
            np.append(cells.resampled("episode_speed_mps", one, top),
                      cells.value("episode_speed_mps", one, top)),
            np.append(cells.resampled("duration_s", one, top),
                      cells.value("duration_s", one, top)),
        )
        for one in names
    )  # fmt: skip
    gain = own[1] - _best_coin(own[0], others)
    if np.isnan(gain).any():
        return Estimate(value=np.nan, low=np.nan, high=np.nan, n=cells.groups)
    return interval(float(gain[-1]), gain[:-1], groups=cells.groups)


def beside_hull_printed(top: float, *, slow: tuple[float, float] = (40.0, 20.0)) -> float:
    """Return the same gain [s] of the printed switch over a coin among the printed rows.

    Args:
        top: The speed range.
        slow: Duration [s] and speed [m/s] of a car that only brakes, which is not in the table.
    """
    own = PRINTED[SWITCH, top]
    others = [PRINTED[policy, top] for policy in ("speed", *LEARNED)]
    points = [slow, *((cell.duration_s, cell.speed_mps) for cell in others)]
    coin = [(np.array([speed]), np.array([duration])) for duration, speed in points]
    return own.duration_s - float(_best_coin(np.array([own.speed_mps]), coin)[0])


def _best_coin(speed: Floats, points: Sequence[tuple[Floats, Floats]]) -> Floats:
    """Return the longest duration of coins of a speed, NaN where no coin has it."""
    best = np.full(len(speed), -np.inf)
    for (v, d), (w, e) in combinations(points, 2):
        apart = w - v
        share = np.divide(speed - v, apart, out=np.full_like(v, np.nan), where=apart != 0)
        mixed = np.where((share >= 0) & (share <= 1), d + share * (e - d), -np.inf)
        best = np.maximum(best, mixed)
    return np.where(np.isfinite(best), best, np.nan)
