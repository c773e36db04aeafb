"""What the claims about the family share: rows 54 to 57.

Statements and rules were committed before any seed of `gate_family` was driven.
"""

from dataclasses import replace

import numpy as np
from scipy import stats as sp

from cpl.claims.claim import Source
from cpl.claims.rows._gate import beside, weights_of
from cpl.claims.verdict import Finding, Verdict
from cpl.conformal.family import MEMBERS
from cpl.stats import Estimate, holm
from cpl.stats.matched import Ratio, apart, ratio

__all__ = ["MARGIN", "finding", "members", "of_method", "significant", "versus"]

MARGIN = 0.03  # [-] of crash share: a difference that one would drive differently for


def members(source: Source, setting: str, names: tuple[str, ...] = ()) -> dict[str, Estimate]:
    """Return how far members' crash shares lie above the constants' at their own mean speed.

    Args:
        source: The table of `gate_family`.
        setting: "gate" or "switch".
        names: Which members; all by default.
    """
    table = source.where(source["setting"] == setting)
    constants = table.where(table["method"] == "constant")
    return {
        name: beside(of_method(table, name), constants, constants["value"])
        for name in names or tuple(MEMBERS)
    }


def of_method(table: Source, name: str) -> Source:
    """Return a method's rows."""
    return table.where(table["method"] == name)


def versus(source: Source, first: str, second: str) -> Estimate:
    """Return how much farther above the constants' curve one method lies than another."""
    table = source.where(source["setting"] == "gate")
    constants = table.where(table["method"] == "constant")
    a, b = (_ratios(of_method(table, name)) for name in (first, second))
    pair, unit, point = constants["pair"], constants["stream"], constants["value"]
    curve = (
        ratio(constants["crashes"], constants["episodes"], pair, unit, point),
        ratio(constants["speed_sum"], constants["steps"], pair, unit, point),
    )
    return apart(a, b, curve, weights_of(a[0].over))


def significant(found: dict[str, Estimate], sign: int) -> set[str]:
    """Return who differs from 0 in a direction, after Holm's correction over all, at 5 %."""
    adjusted = holm([_p(estimate) for estimate in found.values()])
    return {
        name
        for (name, estimate), p in zip(found.items(), adjusted, strict=True)
        if p < 0.05 and estimate.value * sign > 0
    }


def finding(verdict: Verdict, shown: Estimate, source: Source, setting: str) -> Finding:
    """Return a verdict with the estimate that is shown beside it."""
    table = source.where(source["setting"] == setting)
    found = Finding.of(verdict, shown, n=table.total("episodes"))
    return replace(found, n_seeds=len(np.unique(table["pair"])))


def _ratios(own: Source) -> tuple[Ratio, Ratio]:
    labels = own["pair"], own["stream"]
    return (
        ratio(own["crashes"], own["episodes"], *labels),
        ratio(own["speed_sum"], own["steps"], *labels),
    )


def _p(estimate: Estimate) -> float:
    """Return the two-sided p-value that belongs to a 95 % interval of Student's t."""
    half, degrees = (estimate.high - estimate.low) / 2, max(estimate.n - 1, 1)
    if half == 0.0:
        return float(estimate.value == 0.0)
    spread = half / float(sp.t.ppf(0.975, degrees))
    return 2.0 * float(sp.t.sf(abs(estimate.value) / spread, degrees))
