"""The published points of the switch's limit, for the explorer and its picture."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from cpl.experiments import published
from cpl.figures.live import missing
from cpl.figures.switch import fronts
from cpl.highway import PAPER
from cpl.policies.measures import cube, measure, table_of
from cpl.publish.live._script import as_script
from cpl.rng import stream
from cpl.stats import Curve, Estimate, hierarchical_weights, interval, sums
from cpl.stats.matched import along

__all__ = ["pareto_files", "pareto_picture", "points"]

Floats = NDArray[np.float64]

_WORDS = {
    "conformal": "quantile (conformal)",
    "none": "no quantile",
    "dropout": "dropout",
    "ensemble": "ensemble",
    "hau": "learned variance (HAU)",
    "certificates": "certificates",
}
_MEASURES = {
    "speed": "episode_speed_mps",
    "duration": "duration_s",
    "crashes": "crash_rate",
    "collisions": "crashes_per_km",
}
_COMPARED = ("duration", "crashes", "collisions")
_MOST = {"duration": PAPER.duration, "crashes": 1.0}
"""What no mean exceeds, though the end of a symmetric interval may."""
_RESAMPLES = 500


def pareto_files() -> tuple[dict[str, str], str]:
    """Return the script of the explorer, and the picture that stands in for it."""
    try:
        table = published("pareto", "paper").table
    except FileNotFoundError:
        return {"pareto.js": as_script("pareto", None)}, pareto_picture()
    return {"pareto.js": as_script("pareto", _packed(table))}, pareto_picture()


def pareto_picture() -> str:
    """Return the picture alone: the curves of the middle range of speeds."""
    try:
        return _picture(published("pareto", "paper").table)
    except FileNotFoundError:
        return missing("No results on the limit of the switch are published yet.").svg()


def points(table: pd.DataFrame) -> list[dict[str, Any]]:
    """Average the curves over pairs and seeds, and compare them at equal speed, with intervals.

    Methods are taken as they were published, without calibration. Thresholds were chosen pair by
    pair, so a point's limit is the mean of theirs. Pairs and test seeds are resampled together for
    all methods. All intervals are of 95 % and hold one by one.

    Args:
        table: What `cpl.experiments.switch.pareto` returns.

    Returns:
        One entry a range, method and level: `range`, `method`, `q_safe`, and `speed`, `duration`,
        `crashes` and `collisions`, each as value, low, high; None where nothing was counted.
        `beside` has by rival and measure how far the point lies above the rival's curve at the
        point's speed; None where that curve does not reach the speed.
    """
    plain = table.loc[~table["calibrated"] & table["method"].isin(list(_WORDS))]
    found = []
    for top in sorted(set(plain["top_mps"].tolist())):
        here = plain.loc[plain["top_mps"] == top]
        names = [name for name in _WORDS if (here["method"] == name).any()]
        ways = {name: _Way.of(here.loc[here["method"] == name]) for name in names}
        for name, way in ways.items():
            rivals = {other: ways[other] for other in names if other != name}
            found += [{"range": _range(top), "method": name, **p} for p in _curve(way, rivals)]
    return found


@dataclass(frozen=True)
class _Way:
    """One method's curve: its limits, and what was counted, once and in every resample."""

    limits: list[float]
    total: Floats
    drawn: Floats
    groups: int

    @classmethod
    def of(cls, curve: pd.DataFrame) -> _Way:
        blocks = cube(curve)
        groups, units, _, _ = blocks.shape
        rng = stream(0, "live", "pareto")
        weights = hierarchical_weights(groups, units, rng, resamples=_RESAMPLES)
        level, value = curve["level"].to_numpy(), curve["value"].to_numpy()
        limits = [float(value[level == k].mean()) for k in np.unique(level)]
        return cls(limits, *sums(blocks, weights), groups)

    def against_speed(self, column: str) -> Curve:
        speed = _MEASURES["speed"]
        return Curve(
            x=measure(self.total, speed),
            y=measure(self.total, column),
            x_drawn=measure(self.drawn, speed),
            y_drawn=measure(self.drawn, column),
        )


def _curve(way: _Way, rivals: Mapping[str, _Way]) -> list[dict[str, Any]]:
    made: list[dict[str, Any]] = [{"q_safe": round(limit, 3)} for limit in way.limits]
    for name, column in _MEASURES.items():
        values, drawn = measure(way.total, column), measure(way.drawn, column)
        for k, point in enumerate(made):
            most = _MOST.get(name, np.inf)
            point[name] = _estimate(values[k], drawn[:, k], way.groups, most)
    for point in made:
        point["beside"] = {rival: {} for rival in rivals}
    for rival, other in rivals.items():
        for name in _COMPARED:
            own, line = (one.against_speed(_MEASURES[name]) for one in (way, other))
            for point, gap in zip(made, along(own, line, groups=way.groups), strict=True):
                point["beside"][rival][name] = None if gap is None else _rounded(gap)
    return made


def _estimate(
    value: float,
    drawn: Any,  # noqa: ANN401
    groups: int,
    most: float,
) -> list[float] | None:
    if not np.isfinite(value):
        return None
    estimate = interval(float(value), drawn[np.isfinite(drawn)], groups=groups)
    low, high = max(estimate.low, 0.0), min(estimate.high, most)
    return _rounded(Estimate(value=estimate.value, low=low, high=high, n=groups))


def _rounded(estimate: Estimate) -> list[float]:
    return [round(x, 6) for x in (estimate.value, estimate.low, estimate.high)]


def _range(top: float) -> str:
    return f"20 to {top:g} m/s"


def _packed(table: pd.DataFrame) -> dict[str, Any]:
    found = points(table)
    names = {point["method"] for point in found}
    pairs = table.groupby("top_mps")["pair"].nunique().to_dict()
    seeds = ", ".join(f"{count} ({_range(float(top))})" for top, count in pairs.items())
    return {
        "ranges": list(dict.fromkeys(point["range"] for point in found)),
        "methods": [{"name": n, "words": w} for n, w in _WORDS.items() if n in names],
        "points": found,
        "note": f"Simulated. Means over training seeds, {seeds}, the same test seeds for all; bars"
        " and brackets are 95 % intervals over training seeds and test seeds, each for itself."
        " A difference compares a point with the rival's curve at the point's own speed, read by"
        " straight lines between the rival's points; both are resampled together. A dash: the"
        " rival's curve does not reach that speed.",
    }


def _picture(table: pd.DataFrame) -> str:
    plain = table.loc[~table["calibrated"] & table["method"].isin(list(_WORDS))]
    tops = sorted(set(plain["top_mps"].tolist()))
    here = plain.loc[plain["top_mps"] == tops[len(tops) // 2]]
    measures = table_of(here, ["method", "level"])
    curves = {
        name: measures.loc[measures["method"] == name].sort_values("level")
        for name in _WORDS
        if name in set(measures["method"].tolist())
    }
    return fronts(curves, [("duration_s", "episode_speed_mps")]).svg()
