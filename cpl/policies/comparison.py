"""Which of two ways to drive is faster at the same level of safety, over training seeds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy import stats as sp

from cpl.policies.measures import SUMS, Axes, cube, measure
from cpl.rng import stream
from cpl.stats import (
    Curve,
    Estimate,
    Lead,
    Weights,
    hierarchical_weights,
    interval,
    lead,
    sums,
)

__all__ = [
    "chosen",
    "compare",
    "curve_of",
    "estimates",
    "foretold",
    "leads",
    "standing",
    "weights_for",
]

_RESAMPLES = 2_000
_COLUMNS = ("pair", "block", "level", *SUMS)


def chosen(table: pd.DataFrame, values: Mapping[str, object]) -> pd.DataFrame:
    """Return the rows in which the named columns have the named values.

    Raises:
        ValueError: If there is none.

    Examples:
        >>> len(chosen(pd.DataFrame({"method": ["none", "hau"]}), {"method": "hau"}))
        1
    """
    return pd.DataFrame(table.loc[_where(table, values)])


def _where(table: pd.DataFrame, values: Mapping[str, object]) -> NDArray[np.bool_]:
    mask = np.ones(len(table), dtype=np.bool_)
    for name, value in values.items():
        mask &= (table[name] == value).to_numpy()
    if not mask.any():
        raise ValueError(f"values must be in the table, got {dict(values)!r}")
    return mask


def weights_for(table: pd.DataFrame, *, seed: int = 0) -> Weights:
    """Draw resamples of the pairs and blocks of a table: the same for all of its curves."""
    groups, units = (len(np.unique(table[name])) for name in ("pair", "block"))
    return _weights(groups, units, seed)


@lru_cache(maxsize=4)
def _weights(groups: int, units: int, seed: int) -> Weights:
    rng = stream(seed, "comparison", groups, units)
    return hierarchical_weights(groups, units, rng, resamples=_RESAMPLES)


def curve_of(table: pd.DataFrame, axes: Axes, weights: Weights) -> Curve:
    """Return one curve in a plane, more is better on both axes, with its resamples.

    Args:
        table: Block sums of one curve.
        axes: The plane.
        weights: From `weights_for`.
    """
    columns = table[list(_COLUMNS)].to_numpy(np.float64)
    total, drawn = _summed(_Part(columns.tobytes(), table, weights))
    # A resample without a crash or a step leaves no measure undefined: every sum below a fraction
    # line counts steps, episodes or kilometres.
    return Curve(
        x=axes.sign * measure(total, axes.safety),
        y=measure(total, axes.speed),
        x_drawn=axes.sign * measure(drawn, axes.safety),
        y_drawn=measure(drawn, axes.speed),
    )


@dataclass(frozen=True, eq=False)
class _Part:
    """Block sums of one curve that are known by what they say."""

    content: bytes
    table: pd.DataFrame
    weights: Weights

    def __hash__(self) -> int:
        return hash(self.content)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, _Part):
            return NotImplemented
        return self.content == other.content and self.weights is other.weights


@lru_cache(maxsize=24)
def _summed(part: _Part) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Add a curve up and resample it, once for all planes and rivals that ask."""
    return sums(cube(part.table), part.weights)


def compare(
    table: pd.DataFrame,
    first: Mapping[str, object],
    second: Mapping[str, object],
    axes: Axes,
    *,
    ends: tuple[Mapping[str, object], ...] = (),
    count: int = 12,
    seed: int = 0,
) -> Lead:
    """Say how much faster the first way to drive is than the second, at equal safety.

    Pairs of policies and environment seeds are resampled together for both. If one of the two was
    driven on fewer blocks of environment seeds, the other's surplus is left out.

    Args:
        table: Block sums with `pair`, `level`, `block`.
        first: Columns and values that choose the first curve.
        second: The same for the second.
        axes: In which plane.
        ends: The same for points that belong to both curves.
        count: Number of levels.
        seed: Of the resamples.

    Returns:
        The lead; its levels are durations, or negative rates of collisions.

    Raises:
        ValueError: If a curve is not in the table or the two have no level in common.
    """
    numbers = table[list(_COLUMNS)]  # texts, once they have chosen the rows, are in the way
    parts = [numbers.loc[_where(table, which)] for which in (first, second, *ends)]
    shared = set.intersection(*(set(part["block"]) for part in parts))
    kept = [part.loc[part["block"].isin(sorted(shared))] for part in parts]
    weights = weights_for(kept[0], seed=seed)
    curves = [curve_of(part, axes, weights) for part in kept]
    return lead(
        curves[0],
        curves[1],
        groups=weights.groups,
        worst=axes.worst,
        ends=_joined(curves[2:]),
        count=count,
    )


def leads(
    table: pd.DataFrame,
    column: str,
    first: str,
    others: Sequence[str],
    axes: Axes,
    *,
    ends: Sequence[str] = (),
) -> dict[str, Lead]:
    """Compare one way to drive with several others, by their names in a column.

    Args:
        table: Block sums.
        column: Where the names stand.
        first: The one whose leads they are.
        others: The others; those that have no level in common with the first are left out.
        axes: In which plane.
        ends: Names of points that belong to all curves.

    Returns:
        The lead over each.
    """
    safety = {name: _levels(chosen(table, {column: name}), axes) for name in (first, *others)}
    low, high = safety[first].min(), safety[first].max()
    return {
        other: compare(
            table,
            {column: first},
            {column: other},
            axes,
            ends=tuple({column: name} for name in ends),
        )
        for other in others
        if max(low, safety[other].min()) < min(high, safety[other].max())
    }


def estimates(table: pd.DataFrame, name: str, *, seed: int = 0) -> list[Estimate]:
    """Estimate a measure at every level of one curve, over training and environment seeds.

    Args:
        table: Block sums of one curve.
        name: One of `cpl.policies.measures.MEASURES`.
        seed: Of the resamples.

    Returns:
        One estimate a level.
    """
    weights = weights_for(table, seed=seed)
    total, drawn = sums(cube(table), weights)
    values, resampled = np.atleast_1d(measure(total, name)), measure(drawn, name)
    columns = resampled.reshape(len(resampled), -1).T
    return [
        interval(float(value), column, groups=weights.groups)
        for value, column in zip(values, columns, strict=True)
    ]


def foretold(table: pd.DataFrame, name: str, *, confidence: float = 0.95) -> list[Estimate]:
    r"""Say where a measure of one more training seed is to be expected, at every level.

    $$ \bar v \pm t_{G-1} \sqrt{1 + 1/G}\; s $$

    with s the spread of the measure between the pairs, whose environment seeds are all the same.

    Args:
        table: Block sums of one curve, over at least two pairs.
        name: One of `cpl.policies.measures.MEASURES`.
        confidence: How likely the new one lies inside.

    Returns:
        One estimate a level, whose interval is the prediction.

    Raises:
        ValueError: If there is only one pair.
    """
    each = measure(cube(table).sum(axis=1), name)
    groups = len(each)
    if groups < 2:
        raise ValueError(f"table must have at least two pairs, got {groups}")
    reach = sp.t.ppf((1 + confidence) / 2, groups - 1) * np.sqrt(1 + 1 / groups)
    half = reach * each.std(axis=0, ddof=1)
    return [
        Estimate(value=float(v), low=float(v - h), high=float(v + h), n=groups)
        for v, h in zip(each.mean(axis=0), half, strict=True)
    ]


def summary(episodes: pd.DataFrame, by: Sequence[str]) -> pd.DataFrame:
    """Average over episodes and pairs, with the spread between the pairs.

    Args:
        episodes: One row an episode with `pair`, `q_safe`, `steps`, `crashed`, `speed_sum`,
            `distance_m`, `overtaken`.
        by: What tells the averaged rows apart.

    Returns:
        The columns of `by`, `q_safe`, `duration_s`, `duration_sd_s` (between the pairs' means),
        `crash_rate`, `episode_speed_mps`, `step_speed_mps`, `distance_km` and `overtaken`.
    """
    named = episodes.assign(
        duration_s=episodes["steps"].astype(float),
        crash_rate=episodes["crashed"].astype(float),
        episode_speed_mps=episodes["speed_sum"] / episodes["steps"],
        distance_km=episodes["distance_m"] / 1000,
    )
    columns = [
        "q_safe",
        "duration_s",
        "crash_rate",
        "episode_speed_mps",
        "distance_km",
        "overtaken",
    ]
    grouped = named.groupby(list(by), sort=False)
    found = pd.DataFrame(grouped[columns].mean())
    total = pd.DataFrame(grouped[["speed_sum", "steps"]].sum())
    pairs = pd.DataFrame(named.groupby([*by, "pair"], sort=False)[["duration_s"]].mean())
    spread = pd.DataFrame(pairs.groupby(list(by), sort=False).std())
    found.insert(2, "duration_sd_s", spread["duration_s"])
    found.insert(5, "step_speed_mps", total["speed_sum"] / total["steps"])
    return found.reset_index()


def standing(lead: Estimate) -> str:
    """Say in words where somebody with this lead stands.

    Examples:
        >>> standing(Estimate(value=0.5, low=0.1, high=0.9, n=10))
        'ahead of'
        >>> standing(Estimate(value=0.5, low=-0.1, high=1.1, n=10))
        'level with'
    """
    if lead.low > 0:
        return "ahead of"
    return "behind" if lead.high < 0 else "level with"


def _levels(table: pd.DataFrame, axes: Axes) -> NDArray[np.float64]:
    """Return how safe the points of a curve are."""
    return measure(cube(table).sum(axis=(0, 1)), axes.safety)


def _joined(curves: list[Curve]) -> Curve | None:
    if not curves:
        return None
    names = ("x", "y", "x_drawn", "y_drawn")
    return Curve(
        **{name: np.concatenate([getattr(c, name) for c in curves], axis=-1) for name in names}
    )
