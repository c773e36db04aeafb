"""Pictures of the look-ahead: margin and error in time, one episode twice, trade-offs, coverage."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd

from cpl.figures.style import (
    BLUE,
    GREEN,
    GREY,
    INK,
    RED,
    Card,
    card,
    cards,
    drawn,
    note,
    span,
)

__all__ = ["coverage", "episode", "frontier", "margins", "rates"]

_LANE_M = 4.0
_NAMES = {"constant": "a constant margin", "quantile": "the tracked quantile"}


def rates(table: pd.DataFrame, *by: str) -> pd.DataFrame:
    """Add up sums by some columns and divide.

    Args:
        table: Rows of `gate_stream`, `gate_controls` or `gate_attempts`.
        by: Columns that stay apart.

    Returns:
        Those columns and `episodes`, `crash_rate`, `speed_mps`, `coverage` (NaN where nothing was
        scored).

    Example:
        >>> rows = pd.DataFrame({"method": ["a", "a"], "episodes": [2, 2], "crashes": [1, 0],
        ...     "steps": [10, 30], "speed_sum": [200.0, 900.0], "scored": [4, 4], "missed": [1, 0]})
        >>> found = rates(rows, "method").to_dict("list")
        >>> found["crash_rate"], found["speed_mps"], found["coverage"]
        ([0.25], [27.5], [0.875])
    """
    columns = ["episodes", "crashes", "steps", "speed_sum", "scored", "missed"]
    grouped: Any = table.groupby(list(by), sort=False)[columns].sum()
    sums = grouped.reset_index()
    scored = sums["scored"].where(sums["scored"] > 0)
    return sums[[*by, "episodes"]].assign(
        crash_rate=sums["crashes"] / sums["episodes"],
        speed_mps=sums["speed_sum"] / sums["steps"],
        coverage=1 - sums["missed"] / scored,
    )


@drawn
def margins(ride: pd.DataFrame) -> Card:
    """Margin and errors of a stream of episodes, under a constant and under the quantile.

    Args:
        ride: What `gate_ride` returns.
    """
    figure, panels = cards(2, 5.6)
    for axes, (method, name) in zip(panels, _NAMES.items(), strict=True):
        own: Any = ride[(ride["method"] == method) & (ride["car"] == 0)].reset_index(drop=True)
        error, margin = own["error_m"].to_numpy(), own["margin_m"].to_numpy()
        axes.plot(error, ".", color=GREY, markersize=3)
        axes.plot(margin, color=BLUE if method == "quantile" else GREEN)
        crashes = np.flatnonzero(own["crashed"])
        axes.plot(crashes, margin[crashes], "X", color=RED, markersize=8)
        changed = own.index[own["world"] != own["world"].iloc[0]]
        if len(changed):
            span(axes, changed[0], len(own), str(own["world"].iloc[-1]))
        axes.set(ylabel="[m]", title=f"{name}: {len(crashes)} crashes", ylim=(-8, 45))
    panels[-1].set_xlabel("decisions of the stream (dots: errors; crosses: crashes)")
    return figure


@drawn
def episode(ride: pd.DataFrame, number: int | None = None) -> Card:
    """One episode twice: where the seen cars are along the road, those in the own lane marked.

    Args:
        ride: What `gate_ride` returns.
        number: Which episode; by default the last that the constant margin ended in a crash, or
            the last of all.
    """
    figure, panels = cards(2, 5.6)
    if number is None:
        ends = np.asarray(ride["crashed"] & (ride["method"] == "constant"))
        number = int(np.asarray(ride["episode"])[ends if ends.any() else ~ends].max())
    for axes, (method, name) in zip(panels, _NAMES.items(), strict=True):
        rows: Any = ride[(ride["method"] == method) & (ride["episode"] == number)]
        ego = rows[rows["car"] == 0]
        others = rows[rows["car"] > 0].merge(
            ego[["step", "y_m"]].rename(columns={"y_m": "own_y_m"}), on="step"
        )
        near = (others["y_m"] - others["own_y_m"]).abs() < 0.5 * _LANE_M
        axes.plot(others["step"][~near], others["x_m"][~near], ".", color=GREY, markersize=4)
        axes.plot(others["step"][near], others["x_m"][near], "s", color=RED, markersize=4)
        crashed = bool(ego["crashed"].any())
        last = int(ego["step"].max()) + 1
        speed = float(ego["speed_mps"].mean())
        ending = f"crash after {last} s" if crashed else f"{last} s without a crash"
        axes.set(ylabel="ahead [m]", ylim=(-15, 100), xlim=(-1, 41))
        axes.set_title(f"{name}: {ending}, {speed:.1f} m/s")
        axes.axhline(0, color=INK, linewidth=1)
        if crashed:
            axes.plot([last - 1], [0], "X", color=RED, markersize=11)
    panels[-1].set_xlabel("time [s] (squares: in the own lane)")
    return figure


@drawn
def frontier(
    constants: pd.DataFrame, others: pd.DataFrame, places: Mapping[str, str] | None = None
) -> Card:
    """Crash rate over mean speed: the curve of constants, and single methods.

    Args:
        constants: Rows with `value` (the margin [m]), `speed_mps` and `crash_rate`.
        others: Rows with `method`, `speed_mps` and `crash_rate`.
        places: On which side of its point a method's name stands, "left" or "right".
    """
    figure, axes = card(4.4)
    line = constants.sort_values("speed_mps")
    axes.plot(line["speed_mps"], line["crash_rate"], "o-", color=GREEN, markersize=4)
    for row in line.iloc[:: max(1, len(line) // 4)].to_dict("records"):
        note(axes, row["speed_mps"], row["crash_rate"] + 0.012, f"{row['value']:g} m", GREEN)
    for row in others.to_dict("records"):
        hue = BLUE if row["method"] == "quantile" else INK
        axes.plot([row["speed_mps"]], [row["crash_rate"]], "D", color=hue, markersize=6)
        side = (places or {}).get(row["method"], "right")
        away = 0.25 if side == "right" else -0.25
        ha = "left" if side == "right" else "right"
        note(axes, row["speed_mps"] + away, row["crash_rate"], row["method"], hue, ha=ha)
    axes.set(xlabel="mean speed [m/s]", ylabel="episodes that crash", ylim=(0, None))
    return figure


@drawn
def coverage(windows: pd.DataFrame) -> Card:
    """Coverage of frozen margins after they were frozen, with intervals.

    Args:
        windows: Rows with `log`, `part`, `coverage`, `low`, `high` and `nominal`.
    """
    logs = list(dict.fromkeys(windows["log"]))
    sizes = [len(windows[windows["log"] == log]) for log in logs]
    figure, panels = cards(
        len(logs), 1.0 + 0.27 * sum(sizes) + 0.5 * len(logs), ratios=sizes, share_x=True
    )
    for axes, log in zip(panels, logs, strict=True):
        rows: Any = windows[windows["log"] == log].reset_index(drop=True)
        places = np.arange(len(rows))[::-1]
        off = [rows["coverage"] - rows["low"], rows["high"] - rows["coverage"]]
        wrong = (rows["high"] < rows["nominal"]) | (rows["low"] > rows["nominal"])
        for chosen, hue in ((wrong, RED), (~wrong, BLUE)):
            axes.errorbar(
                rows["coverage"][chosen],
                places[chosen],
                xerr=[part[chosen] for part in off],
                fmt="o",
                color=hue,
                markersize=4,
                capsize=3,
            )
        axes.axvline(float(rows["nominal"].iloc[0]), color=INK, linestyle=(0, (5, 3)))
        axes.set_yticks(places, list(rows["part"]))
        axes.set_title(log)
        axes.set_ylim(-0.7, len(rows) - 0.3)
    panels[-1].set_xlabel("coverage (dashed: what it was frozen to)")
    return figure
