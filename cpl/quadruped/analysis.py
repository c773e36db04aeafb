"""How did many runs go? From logs to one row a run, and from there to paired comparisons.

Everything here works on whatever the logs hold: a number whose channel is missing is NaN, and a
comparison that cannot be made has no rows. The tables are those of `cpl.logs.read_runs`.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import combinations
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from cpl.quadruped.features import HORIZON
from cpl.quadruped.gains import false_positive
from cpl.quadruped.metrics import coverage, path_distance, trajectory_error, windowed_coverage
from cpl.quadruped.paths import Path
from cpl.quadruped.permutation import sign_flip
from cpl.rng import stream
from cpl.stats import mean_interval

__all__ = [
    "NEEDS",
    "alarms",
    "alarms_by_policy",
    "compare",
    "comparisons",
    "coverage_beside_bound",
    "failure_shares",
    "guaranteed_coverage",
    "possible",
    "reversals",
    "score_runs",
]

NEEDS: dict[str, tuple[str, ...]] = {
    "distance from start to end, as the robot believes": ("x_m", "y_m"),
    "true distance from start to end": ("true_x_m", "true_y_m"),
    "true distance to the path": ("true_x_m", "true_y_m", "config.waypoints"),
    "share of steps with a SLAM error": ("slam_error",),
    "coverage, and its bound": ("score", "err", "config.tracker.alpha"),
    "what the false-positive rule did": ("l_hat", "q", "slam_error"),
    "policies compared in pairs": ("config.shape", "config.range", "config.policy"),
}
BINS = {"speed [m/s]": 0.2, "turning [rad/s]": 0.4}  # widths
LEAST_RUNS = 5  # for a bin to be shown
PAIR = ("shape", "range", "repeat")


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
        there[row["run"]] |= {k for k, v in row.items() if not _unknown(v)}
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
            "shape": _said(of_run[run], "config.shape", ""),
            "range": _said(of_run[run], "config.range", ""),
            "policy": _said(of_run[run], "config.policy", ""),
            "repeat": _said(of_run[run], "config.repeat", -1),
            **_scored(rows, of_run[run], W),
        }
        for run, rows in table.groupby("run", sort=False)
    ]
    return pd.DataFrame(scored)


def guaranteed_coverage(
    maximum: ArrayLike, *, alpha: float, c: float, W: int, delay: int, B: float = 1.0
) -> NDArray[np.float64]:
    r"""Return what holds for the coverage of a window, whatever the scores.

    $$\mathrm{cov} > 1 - \alpha - \frac{(1 + h c)\,B}{c\,\hat B\,W}$$

    for the step $\eta_t = c\,\max(s_1..s_t)$ and feedback `h` steps late. It is Abel's summation of
    `cpl.conformal.bounds.running_maximum_bound`, over the range that a late quantile lives in,
    whose width is $B + h c B$. A bound below 0 says nothing and is returned as 0.

    Args:
        maximum: The largest score up to the window's first one [score]; 0 if all were 0.
        alpha: Miscoverage aimed at [-].
        c: The step as a share of the maximum [-].
        W: Window [steps].
        delay: Feedback delay `h` [steps].
        B: Largest possible score [score].

    By hand, once a score of 1 was seen: 1 - 0.2 - 1.2 / 4 = 0.5. The paper expects 0.8.

    >>> guaranteed_coverage([1.0, 0.5, 0.0], alpha=0.2, c=0.1, W=40, delay=2).round(3).tolist()
    [0.5, 0.2, 0.0]
    """
    if W < 1:
        raise ValueError(f"W must be at least 1, not {W}")
    seen = np.asarray(maximum, dtype=np.float64)
    slack = np.full_like(seen, np.inf)
    np.divide((1 + delay * c) * B, c * W * seen, out=slack, where=seen > 0)
    return np.maximum(0.0, 1 - alpha - slack)


def coverage_beside_bound(
    table: pd.DataFrame, summary: pd.DataFrame, *, W: int = 40
) -> pd.DataFrame:
    """Return the coverage of every full window of every run, beside what was guaranteed for it.

    Args:
        table: Rows of all runs, with `run`.
        summary: One row a run, with the tracker's `alpha`, `c` and `delay` as
            `config.tracker.NAME`.
        W: Window [steps]; the paper's 40, which is 4 s.

    Returns:
        One row a window: `run`, `window` (number of its first score), `coverage`, `guaranteed`.
        Empty if no run has what it takes.
    """
    parts = [pd.DataFrame({"run": [], "window": [], "coverage": [], "guaranteed": []})]
    of_run = {row["run"]: row for row in summary.to_dict("records")}
    for run, rows in table.groupby("run", sort=False):
        said = [
            float(_said(of_run[run], f"config.tracker.{name}", "nan"))
            for name in ("alpha", "c", "delay")
        ]
        if not {"err", "score"} <= set(rows) or np.isnan(said).any():
            continue
        alpha, c, delay = said
        err, score = (rows[name].to_numpy(dtype=np.float64) for name in ("err", "score"))
        covered = windowed_coverage(err, W)
        maximum = np.maximum.accumulate(score[err >= 0])[: len(covered)]
        bound = guaranteed_coverage(maximum, alpha=alpha, c=c, W=W, delay=int(delay))
        part = {"run": run, "window": range(len(covered))}
        parts.append(pd.DataFrame(part | {"coverage": covered, "guaranteed": bound}))
    return pd.concat([part for part in parts if len(part)] or parts, ignore_index=True)


def compare(
    scored: pd.DataFrame,
    value: str,
    rng: np.random.Generator,
    *,
    treated: str = "paper",
    control: str = "no_quantile",
) -> pd.DataFrame:
    """Compare two policies in pairs that share shape, range and noise.

    Args:
        scored: What `score_runs` returned.
        value: The number that is compared.
        rng: For the permutation tests of more than 20 pairs.
        treated: The policy.
        control: The policy it is compared with.

    Returns:
        One row a shape and range, and one a range for all shapes together, which is the stratified
        test: `range`, `shape`, `n`, `treated`, `control` (means), `difference`, `p` (exact sign
        flips), `least_p`, `better` (share of pairs in which the treated one is lower) and
        `reversed_by_3` (see `reversals`, over repeats). Empty if there is no pair.
    """
    wide = scored.pivot_table(index=list(PAIR), columns="policy", values=value, aggfunc="first")
    columns = ["range", "shape", "n", "treated", "control", "difference", "p", "least_p", "better"]
    if not {treated, control} <= set(wide.columns):
        return pd.DataFrame(columns=[*columns, "reversed_by_3"])
    pairs = wide.dropna(subset=[treated, control]).reset_index()
    groups: list[tuple[str, str, pd.DataFrame]] = []
    for gains, of_range in pairs.groupby("range"):
        groups += [(str(gains), str(shape), part) for shape, part in of_range.groupby("shape")]
        groups.append((str(gains), "all", of_range))
    rows: list[dict[str, Any]] = []
    for gains, shape, part in groups:
        difference = (part[treated] - part[control]).to_numpy(dtype=np.float64)
        test = sign_flip(difference, rng)
        told = (gains, shape, test.n, part[treated].mean(), part[control].mean(), test.value)
        row = dict(zip(columns, (*told, test.p, test.least_p), strict=False))
        row["better"] = float((difference < 0).mean())
        of_repeat = np.bincount(pd.factorize(part["repeat"])[0], weights=difference)
        row["reversed_by_3"] = reversals(of_repeat, 3)
        rows.append(row)
    return pd.DataFrame(rows, columns=[*columns, "reversed_by_3"])


def comparisons(scored: pd.DataFrame, values: Mapping[str, str], seed: int) -> pd.DataFrame:
    """Compare the paper's two policies in several numbers.

    Args:
        scored: What `score_runs` returned.
        values: Column by what it is called.
        seed: Draws the sign patterns where there are too many to count.

    Returns:
        The rows of `compare`, with `what` in front.
    """
    parts = [
        compare(scored, value, stream(seed, "compare", value)).assign(what=what)
        for what, value in values.items()
    ]
    told = pd.concat([part for part in parts if len(part)] or parts[:1], ignore_index=True)
    return told.reindex(columns=["what", *(name for name in told if name != "what")])


def reversals(differences: ArrayLike, repeats: int) -> float:
    """Return how often so few repeats would have shown the other sign than all of them do.

    Args:
        differences: One per pair, shape (n,).
        repeats: Size of the small experiment; the paper's 3.

    Returns:
        The share of all choices of that many pairs, counted exactly; NaN if there are too few.

    Three of four: 5, 5, 1 and 5, 5, -9 keep the sign of the whole, the two with one 5 turn it:

    >>> reversals([5.0, 5.0, 1.0, -9.0], 3)
    0.5
    """
    d = np.asarray(differences, dtype=np.float64)
    if len(d) < repeats:
        return float("nan")
    sign = np.sign(d.sum())
    sums = [sum(chosen) for chosen in combinations(d.tolist(), repeats)]
    return float((np.sign(sums) == -sign).mean())


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
    of_run = {row["run"]: _said(row, "config.policy", "") for row in summary.to_dict("records")}
    parts = [
        alarms(rows, summary, q_safe=q_safe).assign(policy=policy)
        for policy, rows in table.groupby([of_run[run] for run in table["run"]])
    ]
    told = pd.concat([part for part in parts if len(part)] or parts, ignore_index=True)
    return told.reindex(columns=["policy", "what", "steps", "slam_errors", "rate"])


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
    steps = pd.concat(parts, ignore_index=True)
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


def _share(row: dict[str, Any]) -> float:
    return row["slam_errors"] / row["steps"] if row["steps"] else float("nan")


def _scored(rows: pd.DataFrame, said: dict[str, Any], W: int) -> dict[str, Any]:
    """Return one run's numbers."""
    here, truth = _points(rows, "x_m", "y_m"), _points(rows, "true_x_m", "true_y_m")
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
    waypoints = said.get("config.waypoints")
    if truth is not None and not _unknown(waypoints):
        path = Path(name="logged", waypoints=np.array(waypoints, dtype=np.float64))
        numbers["path_error_m"] = float(path_distance(truth, path).mean())
    if (code := _points(rows, "slam_error")) is not None:
        numbers["slam_error_rate"] = float((code != 0).mean())
    if (known := _points(rows, "err")) is not None:
        err = known[:, 0]
        windows = windowed_coverage(err, W)
        alpha = float(_said(said, "config.tracker.alpha", "nan"))
        numbers["coverage"] = coverage(err)
        if len(windows):
            numbers["worst_window"] = float(windows.min())
        if len(windows) and not np.isnan(alpha):
            numbers["windows_below"] = float((windows < 1 - alpha - 1e-9).mean())
    return numbers


def _points(rows: pd.DataFrame, *names: str) -> NDArray[np.float64] | None:
    """Return columns as points, or None where one is missing or nobody knows it."""
    if not set(names) <= set(rows):
        return None
    points = rows[list(names)].to_numpy(dtype=np.float64)
    return None if np.isnan(points).any() else points


def _said(row: dict[str, Any], name: str, otherwise: Any) -> Any:  # noqa: ANN401
    value = row.get(name)
    return otherwise if _unknown(value) else value


def _unknown(value: object) -> bool:
    """Tell whether a cell of a summary holds nothing."""
    return value is None or (isinstance(value, float) and np.isnan(value))
