"""How the claims about the forecast and its quantile are decided, from a number a pair.

A pair of base policies with its forecasters is one training seed; intervals are Student's over the
pairs, since steps and episodes of one pair share its networks.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
import pandas as pd

from cpl.claims._reading import Reader, Source
from cpl.claims._verdicts import Finding, Verdict, rule_r
from cpl.stats import Estimate, mean_interval

__all__ = ["RULES"]

_RULE, _DRIVER = "P, running maximum", "switch"  # the book's default tracker; the paper's policy
_PARAMETERS, _ROLLOUTS = 24_705, 30_000  # of a 125-64-128-64-1 network; Section IV-C
_LATE, _FLAT = 5, 0.01  # [epochs] looked at; relative slope an epoch that counts as none
_ENOUGH, _NEAR = 100_000, 0.01  # [steps]; how near to 1 - alpha coverage must be
_SMALL = 0.01  # "almost no" computation
_FIVE = (4.5, 5.5)  # "five times"
_MIXED = (0.05, 0.95)  # "both in and out of distribution"


def _rises(read: Reader) -> Finding:
    table = read("coverage_episodes").table
    wide = table[(table["quantity"] == "paired q") & (table["driver"] != "safe")]
    gaps = {
        str(driver): mean_interval(part["value"] / part["n"])
        for driver, part in wide.groupby("driver", sort=True)
    }
    verdict = rule_r(gaps.values(), [None] * len(gaps))
    return _finding(verdict, gaps[_DRIVER], n=_total(wide, "n"))


def _overconfident(read: Reader) -> Finding:
    table = read("forecasts").table
    rows = table.loc[(table["quantity"] == "coverage_raw") & (table["policy"] == "both")]
    wide = rows.loc[rows["top_speed_mps"] > rows["top_speed_mps"].min()]
    claimed = wide.loc[wide["subject"].isin(["dropout", "ensemble", "hau"])]
    found = [
        mean_interval(part["value"]) for _, part in claimed.groupby(["subject", "top_speed_mps"])
    ]
    below = [estimate.high < 0.9 for estimate in found]
    if all(below):
        verdict = Verdict.HOLDS
    elif any(below):
        verdict = Verdict.IN_PART
    else:
        sure = all(estimate.low >= 0.9 for estimate in found)
        verdict = Verdict.FAILS if sure else Verdict.UNDECIDED
    largest = max(found, key=lambda estimate: estimate.high)
    return _finding(verdict, largest, n=_total(claimed, "n"))


def _converged(read: Reader) -> Finding:
    source = read("forecasts")
    plain = source.table.loc[source.table["subject"] == "plain"]
    losses = plain.loc[plain["quantity"] == "validation_loss"]
    slopes = [
        float(np.polyfit(part["epoch"][-_LATE:], np.log(part["value"][-_LATE:]), 1)[0])
        for _, part in losses.groupby("pair")
    ]
    slope = mean_interval(slopes)
    counts = plain.loc[plain["quantity"] == "parameters", "value"]
    as_stated = bool((counts == _PARAMETERS).all()) and len(counts) > 0
    as_stated &= source.parameters["rollouts"] == _ROLLOUTS
    if not as_stated or slope.low > _FLAT or slope.high < -_FLAT:
        verdict = Verdict.FAILS
    else:
        inside = slope.low > -_FLAT and slope.high < _FLAT
        verdict = Verdict.HOLDS if inside else Verdict.UNDECIDED
    return _finding(verdict, slope, n=len(losses))


def _mixed(read: Reader) -> Finding:
    table = read("coverage_episodes").table
    rows = table[(table["quantity"] == "too fast") & (table["driver"] == _DRIVER)]
    wide = rows[rows["top_speed_mps"] > rows["top_speed_mps"].min()]  # [20, 40], the evaluation
    share = mean_interval(wide["value"] / wide["n"])
    low, high = _MIXED
    if share.low > low and share.high < high:
        verdict = Verdict.HOLDS
    elif share.high <= low or share.low >= high:
        verdict = Verdict.FAILS
    else:
        verdict = Verdict.UNDECIDED
    return _finding(verdict, share, n=_total(wide, "n"))


def _cheap(read: Reader) -> Finding:
    shares = _times(read("forecast_cost"), "update, compiled")
    return _ratio(shares, [share < _SMALL for share in shares])


def _fivefold(read: Reader) -> Finding:
    low, high = _FIVE
    ratios = _times(read("forecast_cost"), "ensemble")
    return _ratio(ratios, [low <= ratio <= high for ratio in ratios])


def _unchanged(read: Reader) -> Finding:
    source = read("forecast_cost")
    changed = int(_of(source, "conformal", "weights_changed"))
    parameters = int(_of(source, "none", "parameters"))
    same = changed == 0 and _of(source, "conformal", "parameters") == parameters
    return Finding(
        verdict=Verdict.HOLDS if same else Verdict.FAILS,
        value=float(changed),
        low=None,
        high=None,
        n=parameters,
        n_seeds=1,
        flags=("simplicity is judged, not counted",),
    )


def _covers(read: Reader) -> Finding:
    source = read("coverage_episodes")
    rows = _in_range(source, "miss")
    rows = rows[rows["group"] == "all"]
    target = 1 - float(source.parameters["alpha"])
    near: list[bool] = []
    enough = True
    for _, part in rows.groupby("carry"):
        steps = _total(part, "n")
        near.append(abs(1 - _total(part, "value") / steps - target) <= _NEAR)
        enough &= steps >= _ENOUGH
    reset = rows[~rows["carry"]]
    estimate = mean_interval(1 - reset["value"] / reset["n"])
    if all(near) and len(near) == 2:
        verdict = Verdict.HOLDS if enough else Verdict.UNDECIDED
    else:
        verdict = Verdict.IN_PART if any(near) else Verdict.FAILS
    return _finding(verdict, estimate, n=_total(reset, "n"))


def _windows(read: Reader) -> Finding:
    source = read("coverage_episodes")
    rows = _in_range(source, "window")
    chance = (1 - float(source.parameters["alpha"])) ** int(source.parameters["window"])
    gaps = {
        bool(str(carry) == "True"): mean_interval(part["value"] / part["n"] - chance)
        for carry, part in rows.groupby("carry")
    }
    verdict = rule_r(gaps.values(), [None] * len(gaps))
    return _finding(verdict, gaps[False], n=_total(rows, "n"))


RULES: dict[int, Callable[[Reader], Finding]] = {
    12: _rises,
    13: _overconfident,
    18: _converged,
    19: _mixed,
    23: _cheap,
    24: _fivefold,
    25: _unchanged,
    27: _covers,
    28: _windows,
}
"""The rules by row."""


def _in_range(source: Source, quantity: str) -> pd.DataFrame:
    """Rows of the default tracker under the switch, in the range of training (Figure 3)."""
    table = source.table
    chosen = (table["quantity"] == quantity) & (table["driver"] == _DRIVER)
    chosen &= (table["rule"] == _RULE) & (table["top_speed_mps"] == table["top_speed_mps"].min())
    return pd.DataFrame(table[chosen])


def _finding(verdict: Verdict, estimate: Estimate, *, n: int) -> Finding:
    return Finding(
        verdict=verdict,
        value=estimate.value,
        low=estimate.low,
        high=estimate.high,
        n=n,
        n_seeds=estimate.n,
    )


def _total(rows: Any, column: str) -> int:  # noqa: ANN401 - pandas says too little of a selection
    return int(np.sum(np.asarray(rows[column])))


def _of(cost: Source, method: str, column: str) -> float:
    return float(cost[column][cost["method"] == method][0])


def _times(cost: Source, method: str) -> list[float]:
    """Seconds and operations of a method, as multiples of one forecast."""
    names = ("seconds", "operations")
    return [_of(cost, method, name) / _of(cost, "none", name) for name in names]


def _ratio(values: list[float], fine: list[bool]) -> Finding:
    """Time first, then operations: both, one, or neither as claimed."""
    verdict = Verdict.HOLDS if all(fine) else Verdict.IN_PART if any(fine) else Verdict.FAILS
    return Finding(verdict=verdict, value=values[0], low=None, high=None, n=2, n_seeds=1)
