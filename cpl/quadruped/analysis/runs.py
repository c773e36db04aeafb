"""How did each run go? From logs to one row a run, as far as its channels allow."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd

from cpl.quadruped.analysis._cells import points, said, unknown
from cpl.quadruped.metrics import coverage, path_distance, trajectory_error, windowed_coverage
from cpl.quadruped.paths import Path

__all__ = ["NEEDS", "possible", "score_runs"]

NEEDS: dict[str, tuple[str, ...]] = {
    "distance from start to end, as the robot believes": ("x_m", "y_m"),
    "true distance from start to end": ("true_x_m", "true_y_m"),
    "true distance to the path": ("true_x_m", "true_y_m", "config.waypoints"),
    "share of steps with a SLAM error": ("slam_error",),
    "coverage, and its bound": ("score", "err", "config.tracker.alpha"),
    "what the false-positive rule did": ("l_hat", "q", "slam_error"),
    "policies compared in pairs": ("config.shape", "config.range", "config.policy"),
}


def possible(table: pd.DataFrame, summary: pd.DataFrame) -> pd.DataFrame:
    """Say of each analysis in how many runs it can be made, and what the others lack.

    Args:
        table: Rows of all runs, with `run`.
        summary: One row a run, with `run` and the configuration as `config.NAME`.

    Returns:
        One row an analysis: `analysis`, `runs`, `of`, `missing`.
    """
    there = {
        str(run): {str(name) for name, known in rows.notna().any().items() if known}
        for run, rows in table.groupby("run")
    }
    for row in summary.to_dict("records"):
        there[row["run"]] |= {k for k, v in row.items() if not unknown(v)}
    found: list[dict[str, Any]] = []
    for analysis, needed in NEEDS.items():
        lacking = [name for name in needed if any(name not in have for have in there.values())]
        runs = sum(set(needed) <= have for have in there.values())
        missing = ", ".join(lacking) or "nothing"
        found.append({"analysis": analysis, "runs": runs, "of": len(there), "missing": missing})
    return pd.DataFrame(found)


def score_runs(table: pd.DataFrame, summary: pd.DataFrame, *, W: int = 40) -> pd.DataFrame:
    """Return one row a run with the numbers that its channels allow.

    Args:
        table: Rows of all runs, with `run`.
        summary: One row a run, with `run` and the configuration as `config.NAME`.
        W: Window for the coverage [steps]; the paper's 40.

    Returns:
        `run`, `provenance`, `shape`, `range`, `policy`, `repeat`, `duration_s`, `outcome`,
        `start_end_m` (true), `believed_start_end_m`, `path_error_m`, `ate_m`, `slam_error_rate`,
        `coverage`, `worst_window`, `windows_below` (share of windows under 1 - alpha), `steps`.
    """
    of_run = {row["run"]: row for row in summary.to_dict("records")}
    scored = [
        {
            "run": run,
            "provenance": of_run[run]["provenance"],
            "shape": said(of_run[run], "config.shape", ""),
            "range": said(of_run[run], "config.range", ""),
            "policy": said(of_run[run], "config.policy", ""),
            "repeat": said(of_run[run], "config.repeat", -1),
            **_scored(rows, of_run[run], W),
        }
        for run, rows in table.groupby("run", sort=False)
    ]
    return pd.DataFrame(scored)


def _scored(rows: pd.DataFrame, about: dict[str, Any], W: int) -> dict[str, Any]:
    """Return one run's numbers."""
    here, truth = points(rows, "x_m", "y_m"), points(rows, "true_x_m", "true_y_m")
    nan = float("nan")
    numbers = {
        "duration_s": float(rows["t_s"].iloc[-1] - rows["t_s"].iloc[0]),
        "outcome": rows["outcome"].fillna("").iloc[-1] if "outcome" in rows else "",
        "start_end_m": nan,
        "believed_start_end_m": nan,
        "path_error_m": nan,
        "ate_m": nan,
        "slam_error_rate": nan,
        "coverage": nan,
        "worst_window": nan,
        "windows_below": nan,
        "steps": len(rows),
    }
    if here is not None:
        numbers["believed_start_end_m"] = float(np.linalg.norm(here[-1] - here[0]))
    if truth is not None:
        numbers["start_end_m"] = float(np.linalg.norm(truth[-1] - truth[0]))
    if truth is not None and here is not None:
        numbers["ate_m"] = trajectory_error(here, truth)
    waypoints = about.get("config.waypoints")
    if truth is not None and not unknown(waypoints):
        path = Path(name="logged", waypoints=np.array(waypoints, dtype=np.float64))
        numbers["path_error_m"] = float(path_distance(truth, path).mean())
    if (code := points(rows, "slam_error")) is not None:
        numbers["slam_error_rate"] = float((code != 0).mean())
    if (known := points(rows, "err")) is not None:
        err = known[:, 0]
        windows = windowed_coverage(err, W)
        alpha = float(said(about, "config.tracker.alpha", "nan"))
        numbers["coverage"] = coverage(err)
        if len(windows):
            numbers["worst_window"] = float(windows.min())
        if len(windows) and not np.isnan(alpha):
            numbers["windows_below"] = float((windows < 1 - alpha - 1e-9).mean())
    return numbers
