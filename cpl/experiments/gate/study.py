"""What the experiments with the gate share: the margin, its tuning, runs and their sums."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from cpl.conformal import Fixed
from cpl.experiments.gate.streams import Gated, drive
from cpl.experiments.run.spec import Inputs
from cpl.experiments.trained.pairs import Models
from cpl.experiments.trained.policies import base_policy
from cpl.highway import PAPER
from cpl.policies.gate import Averaged, Constant, Gate, GateConfig, Margin, Stacked, Tracked
from cpl.settings.ranges import Count, Probability, Settings

__all__ = [
    "TEST",
    "VALIDATION",
    "Streams",
    "averaged",
    "calibrated",
    "frozen",
    "gated",
    "quantile",
    "run",
    "values",
]

TEST, VALIDATION = 20_000_000, 10_000_000  # environment seeds from here on

EWMA_GRID = (0.0, 0.5, 1.0, 1.5, 2.0, 3.0)  # standard deviations
CONSTANT_GRID = (-1.0, 0.0, 1.0, 2.0, 3.0, 4.0, 6.0, 9.0)  # [m]


@dataclass(frozen=True, kw_only=True)
class Streams(Settings):
    """Streams of episodes that pass through worlds, and the tracker of the margin.

    Attributes:
        pairs: Policy pairs, each a training seed.
        models: Profile of the experiment that trained them.
        worlds: Worlds that the streams pass through.
        streams: Streams of episodes in each pair, a multiple of the number of worlds.
        stay: Episodes that a stream stays in a world.
        margins: Constant margins [m].
        alpha: Miscoverage aimed at [-].
        eta: Step of the quantile, in scales.
        memory: Decisions that the scale remembers.
    """

    pairs: Count
    models: Models = "paper"
    worlds: tuple[str, ...] = (
        "in", "to40", "to50", "noise", "dropout", "braking", "aggressive", "dense",
    )  # fmt: skip
    streams: Count
    stay: Count
    margins: tuple[float, ...]
    alpha: Probability = 0.05
    eta: float = 0.3
    memory: float = 20.0


def quantile(n: int, *, alpha: float, eta: float, memory: float) -> Tracked:
    """Return the headline's margin on n roads: the quantile in units of a running scale."""
    return Tracked(Fixed(eta=eta), n, alpha=alpha, q0=2.0, memory=memory)


def averaged(speed: Any, n: int, *, alpha: float, memory: float) -> Averaged:  # noqa: ANN401
    """Return an EWMA of the error plus as many deviations as cover 1 - alpha in distribution."""
    start = (1.0, 2.0)
    spread = calibrated(
        speed,
        lambda k, m: Averaged(m, memory=memory, deviations=k, start=start),
        EWMA_GRID,
        alpha=alpha,
        streams=2 * n,
    )
    return Averaged(n, memory=memory, deviations=spread, start=start)


def frozen(speed: Any, n: int, *, alpha: float) -> Constant:  # noqa: ANN401
    """Return the constant that covers 1 - alpha in distribution."""
    margin = calibrated(speed, Constant, CONSTANT_GRID, alpha=alpha, streams=2 * n)
    return Constant(margin, n)


def calibrated(
    values: Any,  # noqa: ANN401
    margin: Callable[[float, int], Margin],
    grid: Sequence[float],
    *,
    alpha: float,
    streams: int,
) -> float:
    """Tune one number in distribution, on validation seeds: the error rate is to be alpha.

    Args:
        values: The base policy's.
        margin: The margin for a number, on n roads.
        grid: Numbers to try, ascending; the error rate falls along them.
        alpha: The error rate wanted.
        streams: Episodes of each.
    """
    worlds = np.full((streams, 1), "in")
    parts = [margin(value, streams) for value in grid]
    gate = Gate(PAPER, streams * len(grid), Stacked(parts, [streams] * len(grid)))
    names = [str(k) for k in range(len(grid))]
    table = drive([Gated(names, gate, values)], worlds, first_seed=VALIDATION)
    missed, scored = (
        table[name].to_numpy(np.float64).reshape(1, len(grid), streams).sum(axis=(0, 2))
        for name in ("missed", "scored")
    )
    rate = missed / np.maximum(scored, 1.0)
    return float(np.interp(-alpha, -np.minimum.accumulate(rate), grid))


def _summed(table: pd.DataFrame, setting: str, stay: int) -> pd.DataFrame:
    """Add episodes up over each visit to a world."""
    table = table.assign(visit=(table["round"] // stay).astype(np.int16))
    keys = ["method", "value", "stream", "visit", "world"]
    found = table.groupby(keys, sort=False, as_index=False).agg(
        episodes=("crashed", "size"),
        crashes=("crashed", "sum"),
        **{
            name: (name, "sum")
            for name in (
                "steps", "speed_sum", "scored", "missed", "margin_sum", "changed", "error_sum",
            )
        },
    )  # fmt: skip
    small = dict.fromkeys(("episodes", "crashes", "steps", "scored", "missed", "changed"), "int32")
    found = found.astype({**small, "speed_sum": float, "margin_sum": float, "error_sum": float})
    found.insert(0, "setting", setting)
    return found


def values(inputs: Inputs, kind: str, pair: int) -> Any:  # noqa: ANN401
    """Return a base policy's values as a function of observations."""
    driver = base_policy(inputs, kind, pair)
    return lambda obs: driver.values(obs)


def run(
    drivers: Sequence[Any],
    worlds: Any,  # noqa: ANN401
    *,
    stay: int,
    setting: str = "changing",
    first_seed: int = TEST,
) -> pd.DataFrame:
    """Drive test episodes; take the value out of names such as "constant 5.5"."""
    table = drive(drivers, worlds, first_seed=first_seed)
    parts = table["method"].str.rpartition(" ")
    told = pd.Series(pd.to_numeric(parts[2], errors="coerce"))
    method = np.where(told.notna(), parts[0], table["method"])
    return _summed(table.assign(method=method, value=told.fillna(0.0)), setting, stay)


def gated(
    names: Sequence[str],
    margins: Sequence[Margin],
    streams: int,
    values: Any,  # noqa: ANN401
    look: GateConfig | None = None,
) -> Gated:
    """Return a gate with a margin for each name, each with all streams."""
    n = len(names) * streams
    gate = Gate(PAPER, n, Stacked(list(margins), [streams] * len(names)), look)
    return Gated(names, gate, values)
