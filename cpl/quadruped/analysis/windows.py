"""What was covered in a window of a few seconds, and what was guaranteed of it?"""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from scipy import stats as sp

from cpl.quadruped.analysis._cells import said
from cpl.quadruped.analysis.resample import resampled
from cpl.quadruped.metrics import windowed_coverage
from cpl.rng import stream

__all__ = ["both_by_chance", "coverage_beside_bound", "guaranteed_coverage", "windows_covered"]


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
        tracker = [
            float(said(of_run[run], f"config.tracker.{name}", "nan"))
            for name in ("alpha", "c", "delay")
        ]
        if not {"err", "score"} <= set(rows) or np.isnan(tracker).any():
            continue
        alpha, c, delay = tracker
        err, score = (rows[name].to_numpy(dtype=np.float64) for name in ("err", "score"))
        covered = windowed_coverage(err, W)
        maximum = np.maximum.accumulate(score[err >= 0])[: len(covered)]
        bound = guaranteed_coverage(maximum, alpha=alpha, c=c, W=W, delay=int(delay))
        part = {"run": run, "window": range(len(covered))}
        parts.append(pd.DataFrame(part | {"coverage": covered, "guaranteed": bound}))
    return pd.concat([part for part in parts if len(part)] or parts, ignore_index=True)


def windows_covered(
    covered: pd.DataFrame,
    summary: pd.DataFrame,
    seed: int,
    *,
    level: float = 0.8,
    policy: str = "paper",
    resamples: int = 400,
) -> pd.DataFrame:
    """Ask in how many windows the coverage reached a level, with runs as the bootstrap's blocks.

    Paper: Section V-D and its last figure, two curves on the hexagon that stay above 0.8.

    Args:
        covered: What `coverage_beside_bound` returned.
        summary: One row a run.
        seed: Draws the resamples.
        level: The level [-]; the paper's 0.8.
        policy: Whose runs.
        resamples: How many.

    Returns:
        One row a shape and range, and one a range for all shapes (`all`): `shape`, `range`,
        `coverage` (mean over windows), `reached` (share of windows at the level or above), `low`,
        `high` (95 %, of `reached`), `whole` (share of runs all of whose windows reach it) and `n`
        runs.
    """
    columns = ["shape", "range", "coverage", "reached", "low", "high", "whole", "n"]
    rows = covered.assign(reached=(covered["coverage"] >= level - 1e-9).astype(np.float64))
    of_run = {row["run"]: row for row in summary.to_dict("records")}
    for name in ("shape", "range", "policy"):
        known = {run: said(row, f"config.{name}", "") for run, row in of_run.items()}
        rows[name] = [known[run] for run in rows["run"]]
    rows = rows.query("policy == @policy")
    groups = [(str(gains), "all", part) for gains, part in rows.groupby("range")]
    for gains, _, of_range in list(groups):
        groups += [(gains, str(shape), part) for shape, part in of_range.groupby("shape")]
    found: list[dict[str, Any]] = []
    for gains, shape, part in groups:
        rng = stream(seed, "windows", gains, shape)
        told = resampled(part, _mean_reached, rng, resamples=resamples, stratum="shape")
        whole = np.mean([each["reached"].to_numpy().min() for _, each in part.groupby("run")])
        mean = float(np.mean(part["coverage"].to_numpy()))
        row: dict[str, Any] = {"shape": shape, "range": gains, "coverage": mean}
        row |= {"reached": told.value, "low": told.low, "high": told.high}
        found.append(row | {"whole": float(whole), "n": told.n})
    return pd.DataFrame(found, columns=columns)


def both_by_chance(*, alpha: float = 0.2, W: int = 40, rollouts: int = 2) -> float:
    r"""Return how often some rollouts of one window each all reach 1 - alpha by chance alone.

    $$\Pr(\mathrm{Bin}(W, \alpha) \le \alpha W)^{r}$$

    for independent errors at exactly the rate that is allowed: what a perfect tracker would show.

    Args:
        alpha: Rate of errors [-].
        W: Steps of a rollout [steps].
        rollouts: How many rollouts `r`; the paper shows two.

    Raises:
        ValueError: An argument outside its range.

    A single step without an error reaches everything: 1 - 0.2 = 0.8, squared 0.64.

    >>> round(both_by_chance(W=1), 2), round(both_by_chance(), 2)
    (0.64, 0.35)
    """
    if not 0 < alpha < 1:
        raise ValueError(f"alpha must lie between 0 and 1, not {alpha}")
    if W < 1 or rollouts < 1:
        raise ValueError(f"W and rollouts must be at least 1, not {W} and {rollouts}")
    return float(sp.binom.cdf(np.floor(alpha * W + 1e-9), W, alpha) ** rollouts)


def _mean_reached(rows: pd.DataFrame, weight: NDArray[np.float64]) -> float:
    return float(np.average(rows["reached"], weights=weight))
