"""How good were the predictions that a run was steered by? AUC, Brier score, false alarms."""

from __future__ import annotations

from typing import Any, cast

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from cpl.quadruped.analysis._cells import said
from cpl.quadruped.analysis.resample import resampled
from cpl.quadruped.features import HORIZON
from cpl.rng import stream

__all__ = ["foreseen", "judged", "weighted_auc"]

Floats = NDArray[np.float64]
NUMBERS = ("auc", "brier", "false_positive_rate", "false_alarms", "base_rate")


def foreseen(table: pd.DataFrame, summary: pd.DataFrame) -> pd.DataFrame:
    """Put beside every prediction what came of it two steps later.

    Args:
        table: Rows of all runs, with `run` and `step`.
        summary: One row a run.

    Returns:
        One row a prediction whose outcome the log holds: `run`, `step`, `shape`, `range`, `policy`,
        `l_hat`, `q`, `error` (0 or 1). Empty if the logs do not say.
    """
    columns = ["run", "step", "shape", "range", "policy", "l_hat", "q", "error"]
    if not {"l_hat", "q", "slam_error", "step"} <= set(table):
        return pd.DataFrame(columns=columns)
    now = table[["run", "step", "l_hat", "q"]]
    later = table[["run", "step", "slam_error"]].assign(step=table["step"] - HORIZON)
    rows = now.merge(later, on=["run", "step"]).dropna()
    of_run = {row["run"]: row for row in summary.to_dict("records")}
    for name in ("shape", "range", "policy"):
        known = {run: said(row, f"config.{name}", "") for run, row in of_run.items()}
        rows[name] = [known[run] for run in rows["run"]]
    rows["error"] = (rows["slam_error"] != 0).astype(np.float64)
    return rows.reindex(columns=columns)


def judged(
    table: pd.DataFrame,
    summary: pd.DataFrame,
    seed: int,
    *,
    q_safe: float = 0.8,
    resamples: int = 400,
) -> pd.DataFrame:
    """Judge the predictions of each shape and range, over all policies that made any.

    Paper: Section V-D calls the predictor bad on the rectangle and overly conservative on the
    hexagon out of distribution, without a number.

    Args:
        table: Rows of all runs.
        summary: One row a run.
        seed: Draws the resamples.
        q_safe: A prediction from here on is an alarm of the predictor itself [-].
        resamples: How many.

    Returns:
        One row a shape, range and number: `shape`, `range`, `number` (`auc`, `brier`,
        `false_positive_rate`: alarms where no error came, of all steps where none came;
        `false_alarms`: those of all alarms; `base_rate`: share of errors), `value`, `low`, `high`
        (95 % over runs) and `n` runs. Empty if the logs do not say.
    """
    rows = foreseen(table, summary)
    found: list[dict[str, Any]] = []
    for key, part in rows.groupby(["shape", "range"]):
        shape, gains = cast("tuple[str, str]", key)
        for number in NUMBERS:
            rng = stream(seed, "judged", shape, gains, number)
            told = resampled(part, _STATISTIC[number](q_safe), rng, resamples=resamples)
            ends = {"value": told.value, "low": told.low, "high": told.high, "n": told.n}
            found.append({"shape": shape, "range": gains, "number": number} | ends)
    return pd.DataFrame(found, columns=["shape", "range", "number", "value", "low", "high", "n"])


def weighted_auc(score: Floats, label: Floats, weight: Floats) -> float:
    """Return the probability that a positive scores above a negative, ties counted half.

    Args:
        score: Shape (T,).
        label: 0 or 1, shape (T,).
        weight: How often each counts, shape (T,).

    Returns:
        In [0, 1]; NaN where one kind is missing.

    >>> score, label = np.array([0.1, 0.4, 0.4, 0.9]), np.array([0.0, 0.0, 1.0, 1.0])
    >>> weighted_auc(score, label, np.ones(4)), weighted_auc(score, label, np.array([0, 1, 1, 0]))
    (0.875, 0.5)
    """
    _, place = np.unique(score, return_inverse=True)
    positive = np.bincount(place, weights=weight * label)
    negative = np.bincount(place, weights=weight * (1 - label))
    if not positive.sum() or not negative.sum():
        return float("nan")
    below = np.cumsum(negative) - negative / 2
    return float((positive * below).sum() / positive.sum() / negative.sum())


def _share(part: pd.Series, of: pd.Series, weight: Floats) -> float:
    total = float((of * weight).sum())
    return float((part * of * weight).sum() / total) if total else float("nan")


_STATISTIC = {
    "auc": lambda q_safe: (
        lambda rows, w: weighted_auc(rows["l_hat"].to_numpy(), rows["error"].to_numpy(), w)
    ),
    "brier": lambda q_safe: (
        lambda rows, w: float(np.average((rows["l_hat"] - rows["error"]) ** 2, weights=w))
    ),
    "false_positive_rate": lambda q_safe: (
        lambda rows, w: _share((rows["l_hat"] >= q_safe).astype(float), 1 - rows["error"], w)
    ),
    "false_alarms": lambda q_safe: (
        lambda rows, w: _share(1 - rows["error"], (rows["l_hat"] >= q_safe).astype(float), w)
    ),
    "base_rate": lambda q_safe: lambda rows, w: float(np.average(rows["error"], weights=w)),
}
