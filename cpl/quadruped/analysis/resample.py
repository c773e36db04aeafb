"""How sure is a number that many runs gave? Runs are resampled, not steps.

Two steps of a run are nearly the same step, and two windows of a run share most of it; the runs are
what chance drew anew. So a run is the block: it comes into a resample whole, or not, or twice.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from cpl.stats import Estimate

__all__ = ["resampled"]

Floats = NDArray[np.float64]


def resampled(
    rows: pd.DataFrame,
    statistic: Callable[[pd.DataFrame, Floats], float],
    rng: np.random.Generator,
    *,
    resamples: int = 400,
    stratum: str | None = None,
) -> Estimate:
    """Return a statistic of weighted rows with its interval over resampled runs (percentiles).

    Args:
        rows: One row a step, a window or a run, with `run`.
        statistic: Takes the rows and a weight for each, 1 if the run was drawn once, 0 if it was
            not; NaN where a resample has no answer, and it is then left out.
        rng: Draws the resamples.
        resamples: How many.
        stratum: Column within whose values runs are drawn, so that each resample has as many of
            them as the data; the runs of one stratum are one cell of the design.

    Returns:
        Value, 95 % interval, and `n`, the number of runs.

    Raises:
        ValueError: No rows.

    The mean of two runs' steps, one all 0 and one all 1, is 0 or 1/2 or 1 in a resample:

    >>> rows = pd.DataFrame({"run": ["a", "a", "b", "b"], "x": [0.0, 0.0, 1.0, 1.0]})
    >>> mean = lambda rows, w: float((rows["x"] * w).sum() / w.sum())
    >>> resampled(rows, mean, np.random.default_rng(0))
    Estimate(value=0.5, low=0.0, high=1.0, n=2)
    """
    if not len(rows):
        raise ValueError(f"rows must not be empty, got {len(rows)}")
    number, names = pd.factorize(rows["run"])
    groups = _strata(rows, number, len(names), stratum)
    found: list[float] = []
    for _ in range(resamples):
        weight = np.zeros(len(names))
        for members in groups:
            np.add.at(weight, rng.choice(members, size=len(members)), 1.0)
        value = statistic(rows, weight[number])
        found.extend([] if np.isnan(value) else [value])
    low, high = np.quantile(found, [0.025, 0.975]) if found else (np.nan, np.nan)
    value = statistic(rows, np.ones(len(rows)))
    return Estimate(value=value, low=float(low), high=float(high), n=len(names))


def _strata(
    rows: pd.DataFrame, number: NDArray[np.intp], runs: int, stratum: str | None
) -> list[NDArray[np.intp]]:
    """Return the runs of each stratum."""
    if stratum is None:
        return [np.arange(runs)]
    first = np.zeros(runs, dtype=np.intp)
    first[number[::-1]] = np.arange(len(rows))[::-1]
    code = pd.factorize(rows[stratum].to_numpy()[first])[0]
    return [np.flatnonzero(code == each) for each in range(code.max() + 1)]
