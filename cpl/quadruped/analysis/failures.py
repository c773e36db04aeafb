"""When does SLAM fail? Over how fast the robot truly moved and turned, and on which path."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from cpl.quadruped.analysis._cells import said
from cpl.quadruped.paths import SHAPES
from cpl.rng import stream
from cpl.stats import mean_interval

__all__ = ["Logistic", "failure_odds", "failure_shares", "logistic"]

BINS = {"speed [m/s]": 0.2, "turning [rad/s]": 0.4}  # widths
TERMS = {
    "0.1 m/s faster": ("speed [m/s]", 0.1),
    "0.1 rad/s more turning": ("turning [rad/s]", 0.1),
}
LEAST_RUNS = 5  # for a bin to be shown


def failure_shares(table: pd.DataFrame, *, least_steps: int = 5) -> pd.DataFrame:
    """Return the share of steps with a SLAM error over how fast the robot truly moved and turned.

    Steps of one run depend on each other, so a run counts once in a bin, with its own share.

    Args:
        table: Rows of runs with the truth, with `run`.
        least_steps: A run with fewer steps than this in a bin does not count there.

    Returns:
        One row a bin: `motion` (`speed [m/s]`, `turning [rad/s]`), `middle`, `value`, `low`, `high`
        (95 %) and `n` runs. Bins with fewer than five runs are left out.
    """
    steps = _moves(table)
    found: list[dict[str, Any]] = []
    for motion, width in BINS.items():
        steps["bin"] = np.floor(steps[motion] / width).astype(int)
        cells = steps.groupby(["bin", "run"])["error"].agg(["mean", "size"]).reset_index()
        for number, cell in cells[cells["size"] >= least_steps].groupby("bin"):
            if len(cell) < LEAST_RUNS:
                continue
            told = mean_interval(cell["mean"].tolist())
            middle = (float(str(number)) + 0.5) * width
            ends = {"value": told.value, "low": max(0.0, told.low), "high": min(1.0, told.high)}
            found.append({"motion": motion, "middle": middle, **ends, "n": told.n})
    return pd.DataFrame(found)


@dataclass(frozen=True, kw_only=True)
class Logistic:
    """A logistic regression.

    Args:
        coefficients: Intercept first, in logits per unit, shape (1 + k,).
        converged: Whether the gradient vanished; False where the classes can be separated.
    """

    coefficients: NDArray[np.float64]
    converged: bool


def logistic(
    x: NDArray[np.float64], y: NDArray[np.float64], weight: NDArray[np.float64] | None = None
) -> Logistic:
    r"""Fit a logistic regression by Newton's method with halved steps.

    $$\max_\beta \sum_i w_i \left( y_i \eta_i - \log(1 + e^{\eta_i}) \right),
    \quad \eta = \beta_0 + X\beta$$

    Args:
        x: Columns without the intercept, shape (n, k).
        y: 0 or 1, shape (n,).
        weight: How often each row counts, shape (n,); once unless given.

    Raises:
        ValueError: Numbers that are not finite, or labels other than 0 and 1.

    With one column of two values the fit is the table of counts: odds 1/3 and 3/1.

    >>> fit = logistic(np.array([[0.0]] * 4 + [[1.0]] * 4), np.array([1.0, 0, 0, 0, 1, 1, 1, 0]))
    >>> np.exp(fit.coefficients).round(6).tolist(), fit.converged
    ([0.333333, 9.0], True)
    """
    if not (np.isfinite(x).all() and np.isin(y, (0, 1)).all()):
        raise ValueError(f"x must be finite and y 0 or 1, got y in {np.unique(y).tolist()}")
    w = np.ones(len(y)) if weight is None else weight
    columns = np.column_stack([np.ones(len(y)), x])
    beta, best = np.zeros(columns.shape[1]), -np.inf
    for _ in range(50):
        eta = columns @ beta
        p = 0.5 * (1 + np.tanh(0.5 * eta))
        gradient = columns.T @ (w * (y - p))
        best = float(w @ (y * eta - np.logaddexp(0, eta)))
        curvature = (columns * (w * p * (1 - p))[:, None]).T @ columns
        if np.abs(gradient).max() < 1e-8 * max(1.0, w.sum()):
            # Where a plane separates the classes the maximum lies at infinity, and is flat.
            sharp = curvature.diagonal() > 1e-7 * (w @ columns**2)
            return Logistic(coefficients=beta, converged=bool(sharp.all()))
        step = np.linalg.lstsq(curvature, gradient, rcond=None)[0]
        for _ in range(30):
            eta = columns @ (beta + step)
            if float(w @ (y * eta - np.logaddexp(0, eta))) >= best:
                break
            step = step / 2
        beta = beta + step
    return Logistic(coefficients=beta, converged=False)


def failure_odds(
    table: pd.DataFrame, summary: pd.DataFrame, seed: int, *, resamples: int = 200
) -> pd.DataFrame:
    """Fit SLAM errors on speed, turning rate and path, with intervals over resampled runs.

    Paper: Section V-A, errors "are correlated to the quadruped planned path and speed".

    Args:
        table: Rows of runs with the truth.
        summary: One row a run, with the path as `config.shape`.
        seed: Draws the resamples of runs, within each shape.
        resamples: How many.

    Returns:
        One row a term: `term` (`0.1 m/s faster`, `0.1 rad/s more turning`, and each shape but the
        first by name), its `odds_ratio`, other things being equal, `low`, `high` (95 %), and `n`
        runs. Empty where truth or errors are missing.
    """
    columns = ["term", "odds_ratio", "low", "high", "n"]
    if not {"true_x_m", "true_y_m", "true_yaw_rad", "slam_error"} <= set(table):
        return pd.DataFrame(columns=columns)
    of_run = {row["run"]: said(row, "config.shape", "") for row in summary.to_dict("records")}
    steps = _moves(table).dropna()
    if not len(steps):
        return pd.DataFrame(columns=columns)
    path = np.array([of_run[run] for run in steps["run"]])
    order = (*SHAPES, *sorted(set(path)))
    shapes = sorted(set(path), key=order.index)
    terms = {name: steps[of].to_numpy() / unit for name, (of, unit) in TERMS.items()}
    terms |= {name: (path == name).astype(np.float64) for name in shapes[1:]}
    x, y = np.column_stack(list(terms.values())), steps["error"].to_numpy(dtype=np.float64)
    number, runs = pd.factorize(steps["run"])
    of_shape = [np.flatnonzero([of_run[run] == name for run in runs]) for name in shapes]
    rng = stream(seed, "failure odds")
    drawn: list[NDArray[np.float64]] = []
    for _ in range(resamples):
        weight = np.zeros(len(runs))
        for members in of_shape:
            np.add.at(weight, rng.choice(members, size=len(members)), 1.0)
        fit = logistic(x, y, weight[number])
        drawn.extend([fit.coefficients[1:]] if fit.converged else [])
    value = np.exp(logistic(x, y).coefficients[1:])
    nan = np.full(len(value), np.nan)
    low, high = np.exp(np.quantile(drawn, [0.025, 0.975], axis=0)) if drawn else (nan, nan)
    numbers = {"odds_ratio": value, "low": low, "high": high, "n": len(runs)}
    return pd.DataFrame({"term": list(terms)} | numbers)


def _moves(table: pd.DataFrame) -> pd.DataFrame:
    """Return one row a step: `run`, `error`, and how fast it truly moved and turned."""
    parts: list[pd.DataFrame] = []
    for run, rows in table.groupby("run"):
        x, y, yaw, t_s = (
            np.diff(rows[name].to_numpy(dtype=np.float64))
            for name in ("true_x_m", "true_y_m", "true_yaw_rad", "t_s")
        )
        turned = np.abs((yaw + np.pi) % (2 * np.pi) - np.pi)
        part = {"run": run, "error": rows["slam_error"].to_numpy()[1:] != 0}
        motion = {"speed [m/s]": np.hypot(x, y) / t_s, "turning [rad/s]": turned / t_s}
        parts.append(pd.DataFrame(part | motion))
    return pd.concat(parts, ignore_index=True)
