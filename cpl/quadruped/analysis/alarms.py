"""Which alarms were false, and which of them would the paper's rule have overruled?"""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from cpl.quadruped.analysis._cells import said
from cpl.quadruped.analysis.forecasts import foreseen
from cpl.quadruped.analysis.resample import resampled
from cpl.quadruped.features import HORIZON
from cpl.quadruped.gains import false_positive
from cpl.rng import stream

__all__ = ["alarms", "alarms_by_policy", "overruled"]


def alarms(table: pd.DataFrame, summary: pd.DataFrame, *, q_safe: float = 0.8) -> pd.DataFrame:
    """Ask the logs whether the alarms that the false-positive rule overrules are false.

    Args:
        table: Rows of all runs, with `run`.
        summary: One row a run.
        q_safe: The switch's threshold [score].

    Returns:
        One row a kind of step: `what` (`no alarm`, `alarm kept`, `alarm overruled`), `steps`,
        `slam_errors` (of them two steps later) and `rate`. Empty if the logs do not say. Steps
        whose outcome lies behind the run's end or a gap do not count.
    """
    names = ("no alarm", "alarm kept", "alarm overruled")
    empty = pd.DataFrame(columns=["what", "steps", "slam_errors", "rate"])
    if not {"l_hat", "q", "slam_error", "step"} <= set(table):
        return empty
    known = set(summary["run"])
    parts: list[pd.DataFrame] = []
    for run, rows in table.groupby("run"):
        if run in known:
            later = rows[["step", "slam_error"]].assign(step=rows["step"] - HORIZON)
            parts.append(rows[["step", "l_hat", "q"]].merge(later, on="step"))
    steps = pd.concat(parts).dropna()
    pairs = zip(steps["l_hat"], steps["q"], strict=True)
    overruled = np.array([false_positive(l_hat, q, q_safe=q_safe) for l_hat, q in pairs], bool)
    alarm = (steps["l_hat"] + steps["q"] >= q_safe).to_numpy()
    error = (steps["slam_error"] != 0).to_numpy()
    masks = (~alarm, alarm & ~overruled, alarm & overruled)
    rows_ = [
        {"what": name, "steps": int(mask.sum()), "slam_errors": int(error[mask].sum())}
        for name, mask in zip(names, masks, strict=True)
    ]
    if not len(steps):
        return empty
    return pd.DataFrame([row | {"rate": _share(row)} for row in rows_])


def alarms_by_policy(
    table: pd.DataFrame, summary: pd.DataFrame, *, q_safe: float = 0.8
) -> pd.DataFrame:
    """Do `alarms` for the runs of each policy, with `policy` in front; empty if none is known.

    Args:
        table: Rows of all runs, with `run`.
        summary: One row a run, with the policy as `config.policy`.
        q_safe: The switch's threshold [score].
    """
    of_run = {row["run"]: said(row, "config.policy", "") for row in summary.to_dict("records")}
    parts = [
        alarms(rows, summary, q_safe=q_safe).assign(policy=policy)
        for policy, rows in table.groupby([of_run[run] for run in table["run"]])
    ]
    told = pd.concat([part for part in parts if len(part)] or parts, ignore_index=True)
    return told.reindex(columns=["policy", "what", "steps", "slam_errors", "rate"])


def _share(row: dict[str, Any]) -> float:
    return row["slam_errors"] / row["steps"] if row["steps"] else float("nan")


def overruled(
    table: pd.DataFrame,
    summary: pd.DataFrame,
    seed: int,
    *,
    policy: str = "no_quantile",
    q_safe: float = 0.8,
    resamples: int = 400,
) -> pd.DataFrame:
    """Ask what the false-positive rule would have done where it was not asked.

    Paper: Section V-C. In the runs of a policy that never consults the rule, every alarm of
    pi_switch is sorted by what the rule says of it, and the log knows what came two steps later.

    Args:
        table: Rows of all runs.
        summary: One row a run.
        seed: Draws the resamples of runs.
        policy: Whose runs.
        q_safe: The switch's threshold [score].
        resamples: How many.

    Returns:
        One row a number: `number`, `value`, `low`, `high` (95 % over runs), `n` runs. The numbers:
        `overruled` (share of the alarms), `true` (share of the overruled ones that an error
        followed), `kept` (that of the others), `none` (that of the steps without alarm) and
        `excess` (`true` minus `none`: at or below 0 if the rule finds false alarms). Empty if the
        logs do not say.
    """
    columns = ["number", "value", "low", "high", "n"]
    rows = foreseen(table, summary).query("policy == @policy").reset_index(drop=True)
    if not len(rows):
        return pd.DataFrame(columns=columns)
    l_hat, q = (rows[name].to_numpy(dtype=np.float64) for name in ("l_hat", "q"))
    alarm = l_hat + q >= q_safe
    pairs = zip(l_hat.tolist(), q.tolist(), strict=True)
    over = alarm & np.array([false_positive(*pair, q_safe=q_safe) for pair in pairs])
    kinds = {"true": over, "kept": alarm & ~over, "none": ~alarm}
    error = rows["error"].to_numpy(dtype=np.float64)

    def rate(kind: str, w: NDArray[np.float64]) -> float:
        total = float(w[kinds[kind]].sum())
        return float((w * error)[kinds[kind]].sum()) / total if total else float("nan")

    def share(w: NDArray[np.float64]) -> float:
        total = float(w[alarm].sum())
        return float(w[over].sum()) / total if total else float("nan")

    statistics = {
        "overruled": lambda _, w: share(w),
        "true": lambda _, w: rate("true", w),
        "kept": lambda _, w: rate("kept", w),
        "none": lambda _, w: rate("none", w),
        "excess": lambda _, w: rate("true", w) - rate("none", w),
    }
    found: list[dict[str, Any]] = []
    for number, statistic in statistics.items():
        rng = stream(seed, "overruled", number)
        told = resampled(rows, statistic, rng, resamples=resamples)
        ends = {"value": told.value, "low": told.low, "high": told.high, "n": told.n}
        found.append({"number": number} | ends)
    return pd.DataFrame(found, columns=columns)
