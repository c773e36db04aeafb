"""Who is better at the same level? Two trade-off curves, with bands and hypervolume."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cpl.stats.bootstrap import Band, band, interval, p_value
from cpl.stats.estimates import Estimate
from cpl.stats.fronts import at_levels, common_levels, hypervolume

__all__ = ["Curve", "Lead", "lead"]

Floats = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Curve:
    """A curve of k points in a plane, more is better on both axes, with its resamples.

    Attributes:
        x: What is held equal, shape (k,).
        y: What is compared, shape (k,).
        x_drawn: x in every resample, shape (resamples, k).
        y_drawn: y in every resample, from the same resamples.
    """

    x: Floats
    y: Floats
    x_drawn: Floats
    y_drawn: Floats


@dataclass(frozen=True, kw_only=True)
class Lead:
    """How far one curve is ahead of another.

    Attributes:
        levels: Levels of x that both reach.
        gain: Difference in y at each, with a simultaneous band.
        least: The least gain over the levels; its interval follows from the band.
        mean: The gain averaged over the levels.
        volume: Difference of the hypervolumes.
        p: Two-sided p-value of "the hypervolumes are equal".
        drawn: The gain at each level in every resample.
    """

    levels: Floats
    gain: Band
    least: Estimate
    mean: Estimate
    volume: Estimate
    p: float
    drawn: Floats


def lead(
    first: Curve,
    second: Curve,
    *,
    groups: int,
    worst: ArrayLike,
    ends: Curve | None = None,
    count: int = 12,
) -> Lead:
    """Compare two curves at common levels of x, and by the area that they dominate.

    "Outperforms at the same level" means that the lower end of the simultaneous band is above zero
    at every level, and that the hypervolume is larger.

    Args:
        first: The one whose lead it is.
        second: The other, from the same resamples.
        groups: Number of independent groups.
        worst: Reference point of the hypervolume, shape (2,).
        ends: Points that belong to both curves (where nothing or everything is dangerous). They
            count for the hypervolume, but not as levels: the curves agree there by definition.
        count: Number of levels.

    Returns:
        The lead.

    Raises:
        ValueError: If the curves have no level in common.
    """
    levels = common_levels(first.x, second.x, count=count)
    value = at_levels(first.x, first.y, levels) - at_levels(second.x, second.y, levels)
    drawn = at_levels(first.x_drawn, first.y_drawn, levels) - at_levels(
        second.x_drawn, second.y_drawn, levels
    )
    gain = band(value, drawn, groups=groups)
    here, there = _volumes(first, ends, worst), _volumes(second, ends, worst)
    area, areas = float(here[0] - there[0]), here[1] - there[1]
    return Lead(
        levels=levels,
        gain=gain,
        least=Estimate(
            value=float(value.min()),
            low=float(gain.low.min()),
            high=float(gain.high.min()),
            n=groups,
        ),
        mean=interval(float(value.mean()), drawn.mean(axis=1), groups=groups),
        volume=interval(area, areas, groups=groups),
        p=p_value(area, areas, groups=groups),
        drawn=drawn,
    )


def _volumes(curve: Curve, ends: Curve | None, worst: ArrayLike) -> tuple[Floats, Floats]:
    parts = [curve] if ends is None else [curve, ends]
    once, drawn = (
        np.stack([np.concatenate([getattr(part, axis + kind) for part in parts], axis=-1)
                  for axis in "xy"], axis=-1)
        for kind in ("", "_drawn")
    )  # fmt: skip
    return hypervolume(once, worst), hypervolume(drawn, worst)
