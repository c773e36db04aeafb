"""How did a run go? Numbers of one run, from its log rows.

The paper's tracking error is the distance between start and end (contradiction 13); a twin knows
the truth, so the true distance to the path and the estimator's trajectory error are beside it.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from cpl.quadruped.paths import Path

__all__ = ["coverage", "path_distance", "summary", "trajectory_error", "windowed_coverage"]

STEP_S = 0.1  # [s]


def path_distance(points: NDArray[np.float64], path: Path) -> NDArray[np.float64]:
    """Return each point's distance to the nearest leg of a path.

    Args:
        points: x, y [m], shape (T, 2).
        path: The path.

    Returns:
        Distances [m], shape (T,).

    >>> path_distance(np.array([[0.5, 2.0]]), Path(name="x", waypoints=np.diag([0.0, 0, 0])))
    array([2.06155281])
    """
    a, b = path.waypoints[:-1, :2], path.waypoints[1:, :2]
    along = b - a
    square = np.maximum((along**2).sum(axis=1), 1e-12)
    offset = points[:, None] - a
    share = np.clip((offset * along).sum(axis=2) / square, 0, 1)
    return np.linalg.norm(offset - share[..., None] * along, axis=2).min(axis=1)


def trajectory_error(estimate: NDArray[np.float64], truth: NDArray[np.float64]) -> float:
    """Return the absolute trajectory error: the root mean square distance, nothing aligned.

        ATE = sqrt( mean_t | x_hat_t - x_t |^2 )

    The run starts at a known pose, so there is no transformation to be fitted away.

    Args:
        estimate: x, y [m], shape (T, 2).
        truth: x, y [m], shape (T, 2).

    >>> round(trajectory_error(np.array([[0.0, 0.0], [3.0, 4.0]]), np.zeros((2, 2))) ** 2, 9)
    12.5
    """
    return float(np.sqrt(((estimate - truth) ** 2).sum(axis=1).mean()))


def coverage(err: NDArray[Any]) -> float:
    """Return the share of known scores that were covered; -1 marks unknown ones.

    >>> round(coverage(np.array([-1, -1, 0, 0, 1])), 3)
    0.667
    """
    known = err[err >= 0]
    return float(1 - known.mean()) if len(known) else float("nan")


def windowed_coverage(err: NDArray[Any], W: int = 40) -> NDArray[np.float64]:
    """Return the coverage of every full window of W known scores (40 is the paper's 4 s).

    Args:
        err: 1 missed, 0 covered, -1 unknown, shape (T,).
        W: Window [steps].

    Returns:
        Shape (number of known scores - W + 1,), empty if there are fewer than W.

    >>> windowed_coverage(np.array([-1, 0, 0, 1, 1]), W=2).tolist()
    [1.0, 0.5, 0.0]
    """
    if W < 1:
        raise ValueError(f"W must be at least 1, not {W}")
    known = err[err >= 0]
    if len(known) < W:
        return np.empty(0)
    total = np.concatenate([[0], np.cumsum(known)])
    return 1 - (total[W:] - total[:-W]) / W


def summary(
    rows: list[dict[str, Any]] | pd.DataFrame, path: Path, *, floor_half_width_m: float
) -> dict[str, Any]:
    """Return one run's numbers; what needs the truth is NaN where nobody knows it.

    Args:
        rows: The run's log.
        path: The path it followed.
        floor_half_width_m: |x| and |y| of the floor that was meant to be used [m].

    Returns:
        `outcome`, `duration_s`, `start_end_m` (true end to the last waypoint,
        which is the start of a closed path: the paper's metric), `estimated_start_end_m`,
        `path_error_m` (mean true distance to the path), `ate_m`, `slam_error_rate`, `vision_rate`,
        `speed_rate`, `other_rate`, `outside_s`, `supervised_s`, `mean_kp`, `mean_q`, `coverage`,
        `min_window_coverage`, `steps`.
    """
    table = pd.DataFrame(rows)
    truth, estimate = _columns(table, "true_x_m", "true_y_m"), _columns(table, "x_m", "y_m")
    numbers = _columns(table, "t_s", "slam_error", "kp", "q", "err")
    t_s, code, kp, q, err = numbers.T
    windows = windowed_coverage(err)
    outside = np.abs(truth).max(axis=1) > floor_half_width_m
    stopped = [reason not in ("", "speed_clamp") for reason in table["supervisor"].tolist()]
    return {
        "outcome": table["outcome"].tolist()[-1],
        "duration_s": float(t_s[-1]),
        "start_end_m": float(np.linalg.norm(truth[-1] - path.waypoints[-1, :2])),
        "estimated_start_end_m": float(np.linalg.norm(estimate[-1] - path.waypoints[-1, :2])),
        "path_error_m": float(path_distance(truth, path).mean()),
        "ate_m": trajectory_error(estimate, truth),
        "slam_error_rate": float((code != 0).mean()),
        "vision_rate": float((code == 1).mean()),
        "speed_rate": float((code == 2).mean()),
        "other_rate": float((code == 3).mean()),
        "outside_s": float(outside.sum() * STEP_S),
        "supervised_s": sum(stopped) * STEP_S,
        "mean_kp": float(kp.mean()),
        "mean_q": float(q.mean()),
        "coverage": coverage(err),
        "min_window_coverage": float(windows.min()) if len(windows) else float("nan"),
        "steps": len(table),
    }


def _columns(table: pd.DataFrame, *names: str) -> NDArray[np.float64]:
    return table[list(names)].to_numpy(dtype=np.float64)
