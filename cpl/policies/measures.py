"""What is measured of a drive, as ratios of sums, so that it can be resampled and added up.

The paper's figure shows the mean duration and "the average speed". Both words have two readings,
and signs of differences flip between them, so all of them are kept: a speed averaged within each
episode and then over episodes (which counts a short episode as much as a long one) or over all
steps; with the step of the crash, at whose end the car is already being braked, or without it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

__all__ = [
    "AXES",
    "MEASURES",
    "READINGS",
    "SUMS",
    "Axes",
    "block_sums",
    "cube",
    "measure",
    "table_of",
]

Floats = NDArray[np.float64]

SUMS = (
    "episodes", "steps", "crashes", "speed_sum", "clean_steps", "clean_speed_sum",
    "episode_speed_sum", "clean_episodes", "clean_episode_speed_sum", "distance_km", "overtaken",
    "safe_steps", "changes", "u_sum", "u_steps", "scored", "missed",
)  # fmt: skip
"""What is added up over the episodes of a block; `clean` leaves the step of a crash out."""

MEASURES: dict[str, tuple[str, str]] = {
    "duration_s": ("steps", "episodes"),  # one decision a second
    "crash_rate": ("crashes", "episodes"),
    "crashes_per_km": ("crashes", "distance_km"),
    "crashes_per_overtaken": ("crashes", "overtaken"),
    "episode_speed_mps": ("episode_speed_sum", "episodes"),
    "step_speed_mps": ("speed_sum", "steps"),
    "clean_episode_speed_mps": ("clean_episode_speed_sum", "clean_episodes"),
    "clean_step_speed_mps": ("clean_speed_sum", "clean_steps"),
    "distance_km": ("distance_km", "episodes"),
    "overtaken": ("overtaken", "episodes"),
    "duty": ("safe_steps", "steps"),
    "changes": ("changes", "episodes"),
    "mean_u": ("u_sum", "u_steps"),
    "error_rate": ("missed", "scored"),
}
"""Each measure as the ratio of two sums."""


class Axes(NamedTuple):
    """A plane in which methods are compared: how safe against how fast.

    `sign` turns the first into something of which more is better: 1 for a duration, -1 for a rate
    of collisions. `worst` is where the hypervolume is counted from.
    """

    safety: str
    sign: int
    speed: str
    worst: tuple[float, float]


AXES: dict[str, Axes] = {
    "paper": Axes("duration_s", 1, "episode_speed_mps", (0.0, 20.0)),
    "exposure": Axes("crashes_per_km", -1, "step_speed_mps", (-3.0, 20.0)),
    "duration, step": Axes("duration_s", 1, "step_speed_mps", (0.0, 20.0)),
    "per km, episode": Axes("crashes_per_km", -1, "episode_speed_mps", (-3.0, 20.0)),
}
"""The planes of the first edition, fixed before any result was seen."""

_SAFETY = {
    "duration": ("duration_s", 1, 0.0),
    "crashes per episode": ("crash_rate", -1, -1.0),
    "crashes per km": ("crashes_per_km", -1, -3.0),
    "crashes per overtaken car": ("crashes_per_overtaken", -1, -1.0),
}
_SPEED = {"episode speed": "episode_speed_mps", "step speed": "step_speed_mps"}

READINGS: dict[str, Axes] = {
    f"{safety}, {speed}": Axes(name, sign, column, (worst, 20.0))
    for safety, (name, sign, worst) in _SAFETY.items()
    for speed, column in _SPEED.items()
}
"""All that "average speed at the same collision frequency" can mean: each way to count collisions,
and the duration of the figure's own axis, by each way to average a speed."""


def block_sums(episodes: pd.DataFrame, blocks: int) -> pd.DataFrame:
    """Add up episodes by setting and block of consecutive environment seeds.

    Args:
        episodes: `Rides.episodes`.
        blocks: Into how many blocks the seeds of each setting are cut; they have the same seeds in
            all settings.

    Returns:
        One row a setting and block: `setting`, `block` and the `SUMS`.

    Raises:
        ValueError: If the number of seeds is no multiple of `blocks`.
    """
    seeds = np.unique(episodes["seed"])
    if blocks < 1 or len(seeds) % blocks:
        raise ValueError(f"blocks must divide the {len(seeds)} seeds, got {blocks!r}")
    crashed = episodes["crashed"].to_numpy()
    steps = episodes["steps"].to_numpy()
    speed = episodes["speed_sum"].to_numpy()
    clean_speed = speed - np.where(crashed, episodes["last_speed"], 0.0)
    clean = steps - crashed
    each = {
        "episodes": np.ones(len(episodes), dtype=np.int64),
        "steps": steps,
        "crashes": crashed.astype(np.int64),
        "speed_sum": speed,
        "clean_steps": clean,
        "clean_speed_sum": clean_speed,
        "episode_speed_sum": speed / steps,
        "clean_episodes": (clean > 0).astype(np.int64),
        "clean_episode_speed_sum": np.where(clean > 0, clean_speed / np.maximum(clean, 1), 0.0),
        "distance_km": episodes["distance_m"].to_numpy() / 1000,
    }
    kept = {name: episodes[name].to_numpy() for name in SUMS[10:]}
    block = np.searchsorted(seeds, episodes["seed"]) // (len(seeds) // blocks)
    frame = pd.DataFrame({"setting": episodes["setting"], "block": block, **each, **kept})
    return pd.DataFrame(frame.groupby(["setting", "block"]).sum()).reset_index()


def cube(table: pd.DataFrame, *, group: str = "pair", level: str = "level") -> Floats:
    """Arrange the block sums of one curve for resampling.

    Args:
        table: Rows with `group`, `level`, `block` and the `SUMS`, each combination once.
        group: Column of the independent groups.
        level: Column of the curve's points.

    Returns:
        Shape (groups, blocks, levels, sums).

    Raises:
        ValueError: If a combination is missing or there twice.
    """
    counts = [len(np.unique(table[name])) for name in (group, "block", level)]
    if len(table) != math.prod(counts) or table.duplicated([group, "block", level]).any():
        raise ValueError(f"table must have {counts} groups, blocks and levels, got {len(table)}")
    rows = pd.DataFrame(table.sort_values([group, "block", level])[list(SUMS)])
    return rows.to_numpy(np.float64).reshape(*counts, len(SUMS))


def measure(sums: Floats, name: str) -> Floats:
    """Form a measure from sums.

    Args:
        sums: Shape (..., sums), in the order of `SUMS`.
        name: One of `MEASURES`.

    Returns:
        Shape (...); NaN where nothing was counted.

    Raises:
        ValueError: If there is no such measure.

    Examples:
        >>> sums = np.zeros(len(SUMS))
        >>> sums[[SUMS.index("steps"), SUMS.index("episodes")]] = 90, 3
        >>> float(measure(sums, "duration_s"))
        30.0
    """
    if name not in MEASURES:
        raise ValueError(f"name must be one of {tuple(MEASURES)}, got {name!r}")
    above, below = (sums[..., SUMS.index(column)] for column in MEASURES[name])
    return np.divide(above, below, out=np.full(np.shape(above), np.nan), where=below > 0)


def table_of(table: pd.DataFrame, by: Sequence[str]) -> pd.DataFrame:
    """Pool the blocks of a table of sums and form every measure.

    Args:
        table: Rows with the columns of `by` and the `SUMS`.
        by: What tells the pooled rows apart.

    Returns:
        The columns of `by` and one for each of the `MEASURES`.
    """
    pooled = pd.DataFrame(table.groupby(list(by), sort=False)[list(SUMS)].sum()).reset_index()
    sums = pooled[list(SUMS)].to_numpy(np.float64)
    named = {name: measure(sums, name) for name in MEASURES}
    return pd.DataFrame({**{name: pooled[name] for name in by}, **named})
