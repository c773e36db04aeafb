"""What is said about Table I: cells with intervals, ranks, differences, and what a coin would do.

All numbers rest on one set of resamples of training seeds (pairs) and blocks of environment seeds,
the same for everybody, so that differences and ranks are those of paired drives.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy import stats as sp

from cpl.rng import stream
from cpl.stats import Estimate, hierarchical_weights, holm, interval, p_value, sums

__all__ = [
    "CARRIED",
    "LEARNED",
    "MARGINS",
    "MEASURES",
    "PRINTED",
    "ROWS",
    "SWITCH",
    "Cells",
    "Printed",
    "against_print",
    "agreement",
    "beside_hull",
    "differences",
    "equivalent",
    "ranks",
    "tabulate",
]

Floats = NDArray[np.float64]

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

MEASURES: dict[str, tuple[str, str]] = {
    "duration_s": ("steps", "episodes"),  # one decision a second
    "episode_speed_mps": ("episode_speed", "episodes"),
    "clean_speed_mps": ("clean_speed", "clean_episodes"),
    "step_speed_mps": ("speed_sum", "steps"),
    "crash_rate": ("crashed", "episodes"),
    "crashes_per_km": ("crashed", "distance_km"),
    "mean_q": ("q_sum", "q_steps"),
    "fast_share": ("fast_steps", "steps"),
    "error_rate": ("missed", "scored"),
    "as_speed": ("as_speed", "episodes"),
}
"""Each measure as a ratio of two sums; `clean` leaves the second of a crash out."""

_SUMS = (
    "episodes", "steps", "episode_speed", "clean_speed", "clean_episodes", "speed_sum", "crashed",
    "distance_km", "q_sum", "q_steps", "fast_steps", "missed", "scored", "as_speed",
)  # fmt: skip
_RESAMPLES = 2_000


@dataclass(frozen=True, kw_only=True)
class Cells:
    """Every measure of every policy in every range, as it is, by pair, and resampled.

    Attributes:
        policies: Names of the policies.
        tops: Tops of the speed ranges [m/s].
        groups: Pairs.
        total: Sums, (policies, tops, sums).
        pairs: Sums of each pair, (pairs, policies, tops, sums).
        drawn: Sums of each resample, (resamples, policies, tops, sums).
    """

    policies: tuple[str, ...]
    tops: tuple[float, ...]
    groups: int
    total: Floats
    pairs: Floats
    drawn: Floats

    def value(self, name: str, policy: str, top: float) -> float:
        """Return a measure."""
        return float(self._read(self.total, name, policy, top))

    def resampled(self, name: str, policy: str, top: float) -> Floats:
        """Return a measure in every resample."""
        return self._read(self.drawn, name, policy, top)

    def by_pair(self, name: str, policy: str, top: float) -> Floats:
        """Return a measure of every pair."""
        return self._read(self.pairs, name, policy, top)

    def estimate(self, name: str, policy: str, top: float) -> Estimate:
        """Estimate a measure over training and environment seeds."""
        value, drawn = self.value(name, policy, top), self.resampled(name, policy, top)
        return interval(value, drawn, groups=self.groups)

    def difference(self, name: str, first: str, second: str, top: float) -> tuple[Estimate, float]:
        """Estimate how much larger a measure of the first is, with the p-value of "no larger"."""
        value = self.value(name, first, top) - self.value(name, second, top)
        drawn = self.resampled(name, first, top) - self.resampled(name, second, top)
        return (
            interval(value, drawn, groups=self.groups),
            p_value(value, drawn, groups=self.groups),
        )

    def ratio(self, name: str, first: str, second: str, top: float) -> Estimate:
        """Estimate the ratio of a measure of the first to that of the second."""
        value = self.value(name, first, top) / self.value(name, second, top)
        drawn = self.resampled(name, first, top) / self.resampled(name, second, top)
        return interval(value, drawn, groups=self.groups)

    def foretold(self, name: str, policy: str, top: float, *, confidence: float = 0.95) -> Estimate:
        r"""Say where the measure of one more training seed is to be expected.

        $$ \bar v \pm t_{G-1} \sqrt{1 + 1/G}\; s $$

        with s the spread between the pairs. With one pair nothing is foretold.
        """
        each = self.by_pair(name, policy, top)
        n = len(each)
        if n < 2:
            return Estimate(value=float(each.mean()), low=-np.inf, high=np.inf, n=n)
        half = sp.t.ppf((1 + confidence) / 2, n - 1) * np.sqrt(1 + 1 / n) * each.std(ddof=1)
        return Estimate(value=each.mean(), low=each.mean() - half, high=each.mean() + half, n=n)

    def _read(self, sums_: Floats, name: str, policy: str, top: float) -> Floats:
        if name not in MEASURES:
            raise ValueError(f"name must be one of {tuple(MEASURES)}, got {name!r}")
        if policy not in self.policies or top not in self.tops:
            raise ValueError(f"policy and top must be in the table, got {policy!r} and {top!r}")
        place = sums_[..., self.policies.index(policy), self.tops.index(top), :]
        above, below = (place[..., _SUMS.index(column)] for column in MEASURES[name])
        return np.divide(above, below, out=np.full(np.shape(above), np.nan), where=below > 0)


def tabulate(table: pd.DataFrame, *, block: int = 20, seed: int = 0) -> Cells:
    """Add the episodes of `table1` up, and resample them.

    Args:
        table: What the experiment returns.
        block: Environment seeds in a block.
        seed: Of the resamples.

    Raises:
        ValueError: If somebody has not driven all blocks with all pairs.
    """
    crashed = table["crashed"].to_numpy(np.float64)
    steps = table["steps"].to_numpy(np.float64)
    speed = table["speed_sum"].to_numpy(np.float64)
    clean = steps - crashed
    clean_speed = np.where(
        clean > 0,
        (speed - crashed * table["last_speed"].to_numpy(np.float64)) / np.maximum(clean, 1.0),
        0.0,
    )
    seeds = table["seed"].to_numpy()
    each = {
        "pair": table["pair"].to_numpy(),
        "policy": table["policy"].astype(str).to_numpy(),
        "top": table["top_mps"].to_numpy(np.float64),
        "block": (seeds - seeds.min()) // block,
        "episodes": np.ones(len(table)),
        "episode_speed": speed / steps,
        "clean_speed": clean_speed,
        "clean_episodes": (clean > 0).astype(np.float64),
        "distance_km": table["distance_m"].to_numpy(np.float64) / 1000,
    }
    rest = {name: table[name].to_numpy(np.float64) for name in _SUMS if name not in each}
    keys = ["pair", "block", "policy", "top"]
    added = pd.DataFrame(pd.DataFrame({**each, **rest}).groupby(keys)[list(_SUMS)].sum())
    levels = [np.unique(each[key]) for key in keys]
    whole = pd.MultiIndex.from_product(levels, names=keys)
    present = added.index.droplevel(["pair", "block"]).nunique()
    if len(added) != present * len(levels[0]) * len(levels[1]):
        raise ValueError("table must have everybody in all blocks of all pairs")
    # Who is not driven in a range has nothing there, and every measure of it is NaN.
    values = added.reindex(whole, fill_value=0.0).to_numpy(np.float64)
    values = values.reshape(*(len(level) for level in levels), len(_SUMS))
    rng = stream(seed, "table1", *values.shape[:2])
    weights = hierarchical_weights(len(values), values.shape[1], rng, resamples=_RESAMPLES)
    total, drawn = sums(values, weights)
    return Cells(
        policies=tuple(levels[2].tolist()),
        tops=tuple(levels[3].tolist()),
        groups=len(levels[0]),
        total=total,
        pairs=values.sum(axis=1),
        drawn=drawn,
    )


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
    best = np.full(len(own[0]), -np.inf)
    for (v, d), (w, e) in combinations(others, 2):
        apart = w - v
        share = np.divide(own[0] - v, apart, out=np.full_like(v, np.nan), where=apart != 0)
        mixed = np.where((share >= 0) & (share <= 1), d + share * (e - d), -np.inf)
        best = np.maximum(best, mixed)
    gain = np.where(np.isfinite(best), own[1] - best, np.nan)
    if np.isnan(gain).any():
        return Estimate(value=np.nan, low=np.nan, high=np.nan, n=cells.groups)
    return interval(float(gain[-1]), gain[:-1], groups=cells.groups)


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
