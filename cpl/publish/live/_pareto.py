"""The published points of the switch's limit, for the explorer and its picture."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd

from cpl.experiments import published
from cpl.figures.live import missing
from cpl.figures.switch import fronts
from cpl.highway import PAPER
from cpl.policies.measures import cube, measure, table_of
from cpl.publish.live._script import as_script
from cpl.rng import stream
from cpl.stats.bootstrap import hierarchical_weights, interval, sums

__all__ = ["pareto_files", "points"]

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
    "collisions": "crashes_per_km",
}
_MOST = {"duration": PAPER.duration}
"""What no mean exceeds, though the end of a symmetric interval may."""
_RESAMPLES = 500


def pareto_files() -> tuple[dict[str, str], str]:
    """Return the script of the explorer, and the picture that stands in for it."""
    try:
        result = published("pareto", "paper")
    except FileNotFoundError:
        picture = missing("No results on the limit of the switch are published yet.").svg()
        return {"pareto.js": as_script("pareto", None)}, picture
    return {"pareto.js": as_script("pareto", _packed(result.table))}, _picture(result.table)


def points(table: pd.DataFrame) -> list[dict[str, Any]]:
    """Average the curves over pairs and seeds, with 95 % intervals.

    Methods are taken as they were published, without calibration. Thresholds were chosen pair by
    pair, so a point's limit is the mean of theirs.

    Args:
        table: What `cpl.experiments.switch.pareto` returns.

    Returns:
        One entry a range, method and level: `range`, `method`, `q_safe`, and `speed`, `duration`
        and `collisions`, each as value, low, high; None where nothing was counted.
    """
    found = []
    plain = table.loc[~table["calibrated"] & table["method"].isin(list(_WORDS))]
    tops = sorted(set(plain["top_mps"].tolist()))
    for top in tops:
        for name in _WORDS:
            curve = plain.loc[(plain["top_mps"] == top) & (plain["method"] == name)]
            if len(curve):
                found += [{"range": _range(top), "method": name, **p} for p in _curve(curve)]
    return found


def _curve(curve: pd.DataFrame) -> list[dict[str, Any]]:
    blocks = cube(curve)
    groups, units, levels, _ = blocks.shape
    rng = stream(0, "live", "pareto")
    weights = hierarchical_weights(groups, units, rng, resamples=_RESAMPLES)
    plain, resampled = sums(blocks, weights)
    limits = [curve.loc[curve["level"] == k, "value"].mean() for k in np.unique(curve["level"])]
    made: list[dict[str, Any]] = [{"q_safe": round(float(limit), 3)} for limit in limits]
    for name, column in _MEASURES.items():
        values, drawn = measure(plain, column), measure(resampled, column)
        for k in range(levels):
            most = _MOST.get(name, np.inf)
            made[k][name] = _estimate(values[k], drawn[:, k], groups, most)
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
    ends = np.clip([estimate.value, estimate.low, estimate.high], 0.0, most)
    return [round(x, 4) for x in ends.tolist()]


def _range(top: float) -> str:
    return f"20 to {top:g} m/s"


def _packed(table: pd.DataFrame) -> dict[str, Any]:
    found = points(table)
    names = {point["method"] for point in found}
    pairs = len(set(table["pair"].tolist()))
    return {
        "ranges": list(dict.fromkeys(point["range"] for point in found)),
        "methods": [{"name": n, "words": w} for n, w in _WORDS.items() if n in names],
        "points": found,
        "note": f"Simulated. Means over {pairs} training seeds, the same test seeds for all; bars"
        " and brackets are 95 % intervals over training seeds and test seeds.",
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
