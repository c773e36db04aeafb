"""What the rules about the forecast and its quantile share.

A pair of base policies with its forecasters is one training seed; intervals are Student's over the
pairs, since steps and episodes of one pair share its networks.
"""

from typing import Any

import numpy as np
import pandas as pd

from cpl.claims.claim import Source
from cpl.claims.verdict import Finding, Verdict

__all__ = ["DRIVER", "RULE", "cost_of", "in_range", "multiples", "time_and_operations", "total"]

RULE, DRIVER = "P, running maximum", "switch"  # the book's default tracker; the paper's policy


def in_range(source: Source, quantity: str) -> pd.DataFrame:
    """Rows of the default tracker under the switch, in the range of training (Figure 3)."""
    table = source.table
    chosen = (table["quantity"] == quantity) & (table["driver"] == DRIVER)
    chosen &= (table["rule"] == RULE) & (table["top_speed_mps"] == table["top_speed_mps"].min())
    return pd.DataFrame(table[chosen])


def total(rows: Any, column: str) -> int:  # noqa: ANN401 - pandas says too little of a selection
    """Return the sum of a column."""
    return int(np.sum(np.asarray(rows[column])))


def cost_of(cost: Source, method: str, column: str) -> float:
    """Return what a method costs, in the unit of the column."""
    return float(cost[column][cost["method"] == method][0])


def multiples(cost: Source, method: str) -> list[float]:
    """Seconds and operations of a method, as multiples of one forecast."""
    names = ("seconds", "operations")
    return [cost_of(cost, method, name) / cost_of(cost, "none", name) for name in names]


def time_and_operations(values: list[float], fine: list[bool]) -> Finding:
    """Time first, then operations: both, one, or neither as claimed."""
    verdict = Verdict.HOLDS if all(fine) else Verdict.IN_PART if any(fine) else Verdict.FAILS
    return Finding(verdict=verdict, value=values[0], n=2, n_seeds=1)
