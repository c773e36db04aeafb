"""The cells of Table I: sums over episodes, and measures of them with intervals over both seeds.

All numbers rest on one set of resamples of training seeds (pairs) and blocks of environment seeds,
the same for everybody, so that differences and ranks are those of paired drives.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy import stats as sp

from cpl.rng import stream
from cpl.stats import Estimate, hierarchical_weights, interval, p_value, sums

__all__ = ["MEASURES", "Cells", "tabulate"]

Floats = NDArray[np.float64]

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
