r"""Forecast the drift of the next second from what a machine knows of its own motion.

A drift of $d$ metres is squashed to $l = d / (d + d_0)$ in [0, 1), with $d_0$ the median drift of
the part that the forecaster was trained on: half of those outcomes are above 0.5. The forecast is a
ridge regression on speed, turn rate and acceleration of the last second. It is meant to be plain:
what is asked is what a tracker makes of its errors when it meets another machine.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.stats import rankdata

from cpl.conformal import RunningMax, track_episodes
from cpl.quadruped.analysis import coverage_beside_bound
from cpl.rng import stream

__all__ = ["FEATURES", "DriftForecaster", "Met", "answers", "halves", "meet"]

FEATURES = ("speed_mps", "turn_radps", "hard_mps2")
RIDGE = 1e-2  # [-] of standardised features
BLOCK_S = 5.0  # [s] that are drawn together: neighbouring outcomes share most of their second
Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class DriftForecaster:
    """A fitted forecaster.

    Attributes:
        weights: One for each of `FEATURES`, and the constant.
        mean: Of the features in training.
        spread: Of the features in training.
        scale_m: The drift that counts one half [m].
    """

    weights: tuple[float, ...]
    mean: tuple[float, ...]
    spread: tuple[float, ...]
    scale_m: float

    @classmethod
    def fit(cls, series: pd.DataFrame) -> DriftForecaster:
        """Fit a forecaster.

        Args:
            series: As `cpl.logs.drift` returns it.

        Raises:
            ValueError: Fewer than ten rows, or nothing ever drifts.

        >>> rng = np.random.default_rng(0)
        >>> told = pd.DataFrame(rng.uniform(size=(200, 3)), columns=list(FEATURES))
        >>> fitted = DriftForecaster.fit(told.assign(drift_m=told["speed_mps"]))
        >>> bool(fitted.weights[0] > 10 * abs(fitted.weights[1]))
        True
        """
        drift = series["drift_m"].to_numpy()
        if len(drift) < 10 or not (scale := float(np.median(drift))) > 0:
            msg = f"series must have ten rows or more that drift, got {len(drift)}"
            raise ValueError(msg)
        x = series[list(FEATURES)].to_numpy()
        mean, spread = x.mean(axis=0), x.std(axis=0)
        spread = np.where(spread > 0, spread, 1.0)
        x = np.column_stack([(x - mean) / spread, np.ones(len(x))])
        penalty = np.diag([RIDGE * len(x)] * len(FEATURES) + [0.0])
        weights = np.linalg.solve(x.T @ x + penalty, x.T @ (drift / (drift + scale)))
        return cls(
            weights=tuple(weights.tolist()),
            mean=tuple(mean.tolist()),
            spread=tuple(spread.tolist()),
            scale_m=scale,
        )

    def outcome(self, series: pd.DataFrame) -> Array:
        """Return what happened, squashed."""
        drift = series["drift_m"].to_numpy()
        return drift / (drift + self.scale_m)

    def forecast(self, series: pd.DataFrame) -> Array:
        """Return what is expected to happen."""
        x = (series[list(FEATURES)].to_numpy() - self.mean) / np.array(self.spread)
        return np.clip(x @ np.array(self.weights[:-1]) + self.weights[-1], 0.0, 1.0)


@dataclass(frozen=True, kw_only=True)
class Met:
    """A forecaster that was trained on one part and met another.

    Attributes:
        steps: One row a step of the part that was met: `t_s`, `speed_mps`, `turn_radps`, `drift_m`,
            `l`, `l_hat`, `score`, `q`, `err` of the tracker that was carried over, and
            `err_frozen` of the margin that was fixed in training.
        windows: One row a window: `coverage`, `guaranteed` for the carried tracker.
        frozen: The margin fixed in training [score].
        delay: After how many steps an outcome is known [steps].
    """

    steps: pd.DataFrame
    windows: pd.DataFrame
    frozen: float
    delay: int


def halves(series: pd.DataFrame, *, horizon_s: float) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Return the first half of a series, and the second, with nothing of one in the other.

    The last outcomes of the first half reach into the second by a horizon, and what is known at a
    step was seen in the horizon before it; so the second begins two horizons on.

    Args:
        series: As `cpl.logs.drift` returns it.
        horizon_s: As there [s].
    """
    t_s = series["t_s"].to_numpy()
    middle = t_s[len(t_s) // 2]
    first, second = t_s < middle, t_s >= middle + 2 * horizon_s
    return series.iloc[np.flatnonzero(first)], series.iloc[np.flatnonzero(second)]


def meet(
    trained: pd.DataFrame, met: pd.DataFrame, *, alpha: float, c: float, delay: int, W: int
) -> Met:
    """Train a forecaster on one part, and let it meet another.

    Args:
        trained: The part that it is trained on; its scores also set the frozen margin and the state
            that the tracker is carried over with.
        met: The part that it meets.
        alpha: Miscoverage aimed at [-].
        c: Step of the tracker as a share of the largest score so far [-].
        delay: After how many steps an outcome is known [steps].
        W: Window of the coverage [steps].

    Raises:
        ValueError: As :meth:`DriftForecaster.fit`, or an argument is out of range.
    """
    forecaster = DriftForecaster.fit(trained)
    parts = [trained, met]
    scores = [np.abs(forecaster.outcome(part) - forecaster.forecast(part)) for part in parts]
    frozen = float(np.quantile(scores[0], 1 - alpha))
    before, carried = track_episodes(scores, RunningMax(c=c), alpha=alpha, carry=True, delay=delay)
    both = pd.DataFrame(
        {
            "run": "met",
            "score": np.concatenate(scores),
            "err": np.concatenate([before.err, carried.err]).astype(np.int64),
        }
    )
    said = {f"config.tracker.{k}": v for k, v in (("alpha", alpha), ("c", c), ("delay", delay))}
    windows = coverage_beside_bound(both, pd.DataFrame([{"run": "met", **said}]), W=W)
    steps = met.assign(
        l=forecaster.outcome(met),
        l_hat=forecaster.forecast(met),
        score=scores[1],
        q=carried.q,
        err=carried.err,
        err_frozen=scores[1] > frozen,
    )
    after = np.flatnonzero(windows["window"].to_numpy() >= len(trained))
    windows = windows.iloc[after].reset_index(drop=True)
    return Met(steps=steps, windows=windows, frozen=frozen, delay=delay)


def answers(found: Met, *, alpha: float, seed: int, resamples: int) -> pd.DataFrame:
    """Ask what the chapter on recorded runs asks.

    Args:
        found: What `meet` returned.
        alpha: As there.
        seed: Draws the resamples.
        resamples: Resamples of blocks of 5 s behind an interval.

    Returns:
        One row a number: `number`, `value`, `low`, `high` (95 %; NaN where there is none), `n`
        steps or windows. The numbers: `coverage` of the carried tracker and `coverage_frozen` of
        the frozen margin; `bursts` and `bursts_frozen`, how many times likelier a miss is where the
        one known last was a miss; `windows_below`, the share that covers less than is aimed at;
        `windows_promised_nothing` and `windows_broken`, the shares with a guarantee of 0 and below
        theirs; `with_speed` and `with_turning`, rank correlations of the drift with the machine's
        own motion.
    """
    steps, delay = found.steps, found.delay
    column = {name: steps[name].to_numpy() for name in steps}
    numbers: dict[str, Callable[[NDArray[np.intp]], float]] = {
        "coverage": lambda at: 1 - column["err"][at].mean(),
        "coverage_frozen": lambda at: 1 - column["err_frozen"][at].mean(),
        "bursts": lambda at: _bursts(column["err"][at], delay),
        "bursts_frozen": lambda at: _bursts(column["err_frozen"][at], delay),
        "with_speed": lambda at: _ranked(column["speed_mps"][at], column["drift_m"][at]),
        "with_turning": lambda at: _ranked(column["turn_radps"][at], column["drift_m"][at]),
    }
    step = float(np.median(np.diff(steps["t_s"])))
    block = max(1, round(BLOCK_S / step))
    every = np.arange(len(steps))
    blocks = every[: len(every) // block * block].reshape(-1, block)
    rows: list[dict[str, Any]] = []
    for name, count in numbers.items():
        rng = stream(seed, "recorded", name)
        drawn = [
            count(blocks[rng.integers(len(blocks), size=len(blocks))].ravel())
            for _ in range(resamples if len(blocks) > 3 else 0)
        ]
        told = [each for each in drawn if np.isfinite(each)]
        low, high = np.quantile(told, [0.025, 0.975]) if told else (np.nan, np.nan)
        row = {"number": name, "value": count(every), "low": low, "high": high, "n": len(steps)}
        rows.append(row)
    covered, owed = found.windows["coverage"], found.windows["guaranteed"]
    shares = {
        "windows_below": covered < 1 - alpha - 1e-9,
        "windows_promised_nothing": owed <= 0,
        "windows_broken": covered < owed - 1e-9,
    }
    for name, share in shares.items():
        value = float(np.mean(share.to_numpy())) if len(share) else np.nan
        rows.append(
            {"number": name, "value": value, "low": np.nan, "high": np.nan, "n": len(share)}
        )
    return pd.DataFrame(rows)


def _bursts(err: NDArray[np.bool], delay: int) -> float:
    """Return how many times likelier than usual a miss is where the last known one was a miss."""
    known = err[:-delay]
    if not (known.any() and err.any()):
        return float("nan")
    return float(err[delay:][known].mean() / err.mean())


def _ranked(x: Array, y: Array) -> float:
    """Return Spearman's rank correlation; NaN where one of both is constant."""
    a, b = rankdata(x), rankdata(y)
    if not (a.std() > 0 and b.std() > 0):
        return float("nan")
    return float(np.corrcoef(a, b)[0, 1])
