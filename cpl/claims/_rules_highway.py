"""How the claims about the switch are decided, from block sums over training and environment seeds.

"Outperforms at the same collision frequency" was defined before any result was seen: the lower end
of a simultaneous band is above zero at every level in common, and the hypervolume is larger (Holm
over five baselines), both in the paper's own plane (duration, speed averaged by episode) and per
kilometre driven (collisions per km, speed averaged over steps). The baselines are those of the
paper, as published; calibrated ones are shown in the chapter.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import lru_cache

import numpy as np
import pandas as pd
from scipy import stats as sp

from cpl.claims._reading import Reader, Source
from cpl.claims._verdicts import Finding, Verdict, rule_r
from cpl.policies.comparison import chosen, compare, curve_of, weights_for
from cpl.policies.measures import AXES, SUMS, Axes, cube, measure
from cpl.rng import stream
from cpl.stats import (
    Estimate,
    Lead,
    at_levels,
    common_levels,
    hierarchical_weights,
    holm,
    interval,
    mean_interval,
    sums,
)
from cpl.store import table_digest

__all__ = ["RULES"]

BASELINES = ("none", "dropout", "ensemble", "hau", "certificates")
PLANES = ("paper", "exposure")
_LEVEL = 0.05  # of the family of five tests


def _assumption(read: Reader) -> Finding:
    rides = read("switch_choice")
    alpha = float(rides.parameters["alpha"])
    switched = np.char.startswith(rides["policy"].astype(str), "switch")
    rows = rides.where(switched).table
    found = [
        estimate
        for _, part in rows.groupby(["policy", "top_mps"])
        if (estimate := _share(part, "floor_missed", "floor_scored")) is not None
    ]
    worst = max(found, key=lambda estimate: estimate.high)
    verdict = Verdict.UNDECIDED
    if worst.high < alpha:
        verdict = Verdict.HOLDS
    elif any(estimate.low >= alpha for estimate in found):
        # Somewhere the error rate is certainly not below alpha.
        some = any(estimate.high < alpha for estimate in found)
        verdict = Verdict.IN_PART if some else Verdict.FAILS
    return _finding(verdict, worst, n=rides.where(switched).total("floor_scored"))


def _exit(read: Reader) -> Finding:
    streams = read("exit_time")
    late = streams["exit"] > streams["allowed"]
    n = len(streams)
    verdict = Verdict.FAILS if late.any() else Verdict.HOLDS if n >= 100 else Verdict.UNDECIDED
    p99 = float(np.quantile(streams["exit"], 0.99))
    seeds = len(np.unique(streams["pair"]))
    return Finding(verdict=verdict, value=p99, low=None, high=None, n=n, n_seeds=seeds)


def _knob(read: Reader) -> Finding:
    source = read("switch_ablation")
    names = source["variant"].astype(str)
    table = source.where((names == "default") | np.char.startswith(names, "alpha")).table
    named = table.assign(level=table["alpha"])
    pooled = pd.DataFrame(named.groupby(["pair", "level", "block"])[list(SUMS)].sum())
    weights = weights_for(table)
    total, drawn = sums(cube(pooled.reset_index()), weights)
    groups, alphas = weights.groups, np.unique(table["alpha"])
    wanted = ("step_speed_mps", "crashes_per_km")
    ranks = [_rank_correlation(alphas, measure(total, name)) for name in wanted]
    spans = []
    for name in wanted:
        values, resampled = measure(total, name), measure(drawn, name)
        span = resampled[:, -1] - resampled[:, 0]
        spans.append(interval(float(values[-1] - values[0]), span, groups=groups))
    verdict = rule_r(spans, [None, None])
    if verdict is Verdict.HOLDS and (min(ranks) < 1 or len(alphas) < 5):
        verdict = Verdict.IN_PART
    return Finding(
        verdict=verdict,
        value=min(ranks),
        low=None,
        high=None,
        n=source.total("episodes"),
        n_seeds=groups,
    )


def _learning(read: Reader) -> Finding:
    curves = read("base_policies")
    told = curves.parameters
    as_stated = (
        told["steps"] == 200_000
        and list(told["hidden"]) == [256, 256]
        and told["collision_reward"] == -1.0
        and told["high_speed_reward"] == 0.5
    )
    late = curves.where(curves["step"] > told["steps"] / 2).table
    found = {}
    for kind, rows in late.groupby("kind"):
        slopes = [
            np.polyfit(one["step"] / 1e5, one["episode_return"], 1)[0]
            for _, one in rows.groupby("pair")
        ]
        found[kind] = mean_interval(slopes)
    level = all(estimate.low <= 0 <= estimate.high for estimate in found.values())
    verdict = Verdict.FAILS if not as_stated else Verdict.HOLDS if level else Verdict.IN_PART
    if verdict is Verdict.HOLDS and found["speed"].n < 10:
        verdict = Verdict.UNDECIDED
    return _finding(verdict, found["speed"], n=len(curves))


def _beats(read: Reader) -> Finding:
    source = read("pareto")
    conditions, estimates = [], []
    for plane in PLANES:
        leads = {name: _lead(source, name, plane) for name in BASELINES}
        adjusted = holm([lead.p for lead in leads.values()])
        for lead, p in zip(leads.values(), adjusted, strict=True):
            larger = lead.volume.value > 0 and p < _LEVEL
            low = lead.least.low if larger else min(lead.least.low, 0.0)
            conditions.append(Estimate(value=lead.least.value, low=low, high=lead.least.high, n=1))
            estimates.append(lead.least)
    least = min(estimates, key=lambda estimate: estimate.value)
    verdict = rule_r(conditions, [None] * len(conditions))
    return _finding(verdict, least, n=source.total("episodes"))


def _always(read: Reader) -> Finding:
    source = read("pareto")
    bands = [_lead(source, name, plane).gain for plane in PLANES for name in BASELINES]
    low, value, high = (
        np.concatenate([getattr(band, end) for band in bands]) for end in ("low", "value", "high")
    )
    if (low > 0).all():
        verdict = Verdict.HOLDS
    elif (low > 0).any():
        verdict = Verdict.IN_PART
    else:
        verdict = Verdict.FAILS if (high < 0).any() else Verdict.UNDECIDED
    return Finding(
        verdict=verdict,
        value=float((value > 0).mean()),
        low=float((low > 0).mean()),
        high=float((high > 0).mean()),
        n=len(value),
        n_seeds=bands[0].n,
    )


def _stringent(read: Reader) -> Finding:
    source = read("pareto")
    slopes = [_slope(_widest(source), AXES[plane]) for plane in PLANES]
    verdict = rule_r(slopes, [None, None])
    least = min(slopes, key=lambda slope: slope.value)
    return _finding(verdict, least, n=source.total("episodes"))


def _slope(table: pd.DataFrame, axes: Axes) -> Estimate:
    """Return how much the gain over the mean of the baselines grows as q_safe gets smaller."""
    ours = chosen(table, {"method": "conformal"})
    weights = weights_for(ours)
    curves = [
        curve_of(chosen(table, {"method": name, "calibrated": False}), axes, weights)
        for name in ("conformal", *BASELINES)
    ]
    levels = common_levels(*[curve.x for curve in curves], count=12)
    threshold = np.asarray(ours.groupby("level")["value"].mean(), np.float64)
    q_safe = at_levels(curves[0].x, threshold, levels)
    read = [at_levels(curve.x, curve.y, levels) for curve in curves]
    drawn = [at_levels(curve.x_drawn, curve.y_drawn, levels) for curve in curves]
    gain, gains = (part[0] - np.mean(part[1:], axis=0) for part in (read, drawn))
    centred = -(q_safe - q_safe.mean())
    scale = float(centred @ centred)
    return interval(float(gain @ centred) / scale, gains @ centred / scale, groups=weights.groups)


def _star(read: Reader) -> Finding:
    source = read("pareto")
    found, durations = [], {}
    for top in np.unique(source["top_mps"]):
        part = source.where(source["top_mps"] == top).table
        safe, fast = (chosen(part, {"method": name}) for name in ("safe", "speed"))
        weights = weights_for(safe)
        both = [sums(cube(rows), weights) for rows in (safe, fast)]
        for name, sign in (("duration_s", 1), ("step_speed_mps", -1)):
            values, drawn = ([measure(pair[k], name) for pair in both] for k in (0, 1))
            gap, gaps = sign * (values[0] - values[1]), sign * (drawn[0] - drawn[1])
            found.append(interval(float(gap[0]), gaps[:, 0], groups=weights.groups))
        values, drawn = (measure(both[0][k], "duration_s") for k in (0, 1))
        durations[float(top)] = interval(float(values[0]), drawn[:, 0], groups=weights.groups)
    verdict = rule_r(found, [None] * len(found))
    main, clock = (float(source.parameters[name]) for name in ("top_speed_mps", "duration_s"))
    # The interval is symmetric about the mean; no episode lasts longer than the clock lets it.
    star = replace(durations[main], high=min(durations[main].high, clock))
    return _finding(verdict, star, n=source.total("episodes"))


RULES: dict[int, Callable[[Reader], Finding]] = {
    10: _assumption,
    11: _exit,
    14: _knob,
    17: _learning,
    20: _beats,
    21: _always,
    22: _stringent,
    26: _star,
}
"""The rules by row."""


@dataclass(frozen=True)
class _Keyed:
    """A table that is known by what it says, so that rows which ask the same share the answer."""

    digest: str
    table: pd.DataFrame = field(compare=False)


def _lead(source: Source, baseline: str, plane: str) -> Lead:
    table = _widest(source)
    return _compared(_Keyed(table_digest(table), table), baseline, plane)


@lru_cache(maxsize=16)
def _compared(keyed: _Keyed, baseline: str, plane: str) -> Lead:
    return compare(
        keyed.table,
        {"method": "conformal"},
        {"method": baseline, "calibrated": False},
        AXES[plane],
        ends=({"method": "safe"}, {"method": "never"}),
    )


def _rank_correlation(x: np.ndarray, y: np.ndarray) -> float:
    """Return Spearman's coefficient, without the last bits that keep it from being 1."""
    return round(float(np.corrcoef(sp.rankdata(x), sp.rankdata(y))[0, 1]), 12)


def _widest(source: Source) -> pd.DataFrame:
    """Return the rows in the range of the paper's figure."""
    return source.where(source["top_mps"] == source.parameters["top_speed_mps"]).table


def _share(rows: pd.DataFrame, hits: str, of: str) -> Estimate | None:
    """Estimate a share over pairs and blocks of 20 environment seeds; None if nothing counted."""
    seeds = rows["seed"].to_numpy()
    named = rows.assign(block=(seeds - seeds.min()) // 20)
    totals = pd.DataFrame(named.groupby(["pair", "block"])[[hits, of]].sum())
    groups, units = (len(np.unique(named[name])) for name in ("pair", "block"))
    if not np.any(totals[of]) or len(totals) != groups * units or units < 2:
        return None
    weights = hierarchical_weights(groups, units, stream(0, "share", groups, units))
    total, drawn = sums(totals.to_numpy(np.float64).reshape(groups, units, 2), weights)
    kept = drawn[:, 1] > 0
    return interval(
        float(total[0] / total[1]), drawn[kept, 0] / drawn[kept, 1], groups=weights.groups
    )


def _finding(verdict: Verdict, estimate: Estimate, *, n: int) -> Finding:
    return Finding(
        verdict=verdict,
        value=estimate.value,
        low=estimate.low,
        high=estimate.high,
        n=n,
        n_seeds=estimate.n,
    )
