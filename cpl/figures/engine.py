"""Pictures of the engine: the same ride in two engines, blind drivers, and the speed cap."""

from collections.abc import Mapping

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from cpl.figures.style import (
    BLUE,
    GREEN,
    GREY,
    INK,
    PURPLE,
    RED,
    Card,
    card,
    cards,
    drawn,
    level,
    note,
)

__all__ = ["blind", "overlay", "top_speeds"]

_MARKERS = ("o", "s", "^")


@drawn
def overlay(table: pd.DataFrame, *, thick: str, thin: str, speed_mps: float) -> Card:
    """The same ride in two engines, one drawn over the other, in a frame that moves along.

    Args:
        table: one row an engine, step and car: `engine`, `step`, `vehicle`, `x_m`, `y_m`.
        thick: engine drawn below, as wide pale lines.
        thin: engine drawn above, as narrow dark lines.
        speed_mps: speed of the moving frame [m/s].
    """
    figure, (along, across) = cards(2, 5.0)
    start = float(table.loc[(table["vehicle"] == 0) & (table["step"] == 0), "x_m"].min())
    for engine, width, shade in ((thick, 5.0, "#a9cfe6"), (thin, 1.0, INK)):
        for number, car in table.loc[table["engine"] == engine].groupby("vehicle"):
            own = number == 0
            color = (RED if width < 2 else "#e8bfa5") if own else shade
            step = car["step"].to_numpy()
            moved = car["x_m"].to_numpy() - start - speed_mps * step
            named = f"{engine}, {'own car' if own else 'others'}" if int(str(number)) < 2 else None
            order = (2 if width < 2 else 1) + 0.5 * own
            for axes, values in ((along, moved), (across, car["y_m"].to_numpy())):
                axes.plot(
                    step, values, color=color, linewidth=width, zorder=order,
                    label=named if axes is along else None,
                )  # fmt: skip
    along.set_ylabel(f"place along the road,\nseen from {speed_mps:g} m/s [m]")
    across.set(ylabel="place across the road [m]", xlabel="time [s]")
    across.invert_yaxis()
    along.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2)
    return figure


@drawn
def blind(speed_mps: ArrayLike, rate: ArrayLike, low: ArrayLike, high: ArrayLike) -> Card:
    """The share of episodes that crash when one speed is held blindly.

    Args:
        speed_mps: the speed held [m/s], shape (n,).
        rate: share of episodes that crashed, shape (n,).
        low: lower end of its interval, shape (n,).
        high: upper end of its interval, shape (n,).
    """
    v, share = np.asarray(speed_mps, dtype=float), np.asarray(rate, dtype=float)
    figure, axes = card()
    axes.fill_between(v, np.asarray(low), np.asarray(high), color="#b9dcf0", linewidth=0)
    axes.plot(v, share, "o-", color=BLUE, markersize=4)
    axes.axvspan(21, 24, color=GREY, alpha=0.15, linewidth=0)
    note(axes, 24.3, 0.06, "the others start at 21 to 24 m/s", GREY)
    axes.set(xlabel="speed held [m/s]", ylabel="share of episodes that crash", ylim=(-0.03, 1.05))
    return figure


@drawn
def top_speeds(speeds: Mapping[str, ArrayLike], *, unit_s: float, cap_mps: float) -> Card:
    """Speed on an empty road at full throttle, by speed range.

    Args:
        speeds: speed after each step [m/s] by name of the range, each of shape (T,).
        unit_s: seconds a step [s].
        cap_mps: highway-env's limit [m/s].
    """
    figure, axes = card()
    hues = (BLUE, GREEN, PURPLE)
    for (name, values), hue, marker in zip(speeds.items(), hues, _MARKERS, strict=False):
        v = np.asarray(values, dtype=float)
        axes.plot(unit_s * np.arange(len(v)), v, color=hue, marker=marker, markersize=5, label=name)
    level(axes, cap_mps, f"the cap of every car: {cap_mps:g} m/s", x=0.98)
    axes.set(xlabel="time at full throttle [s]", ylabel="speed [m/s]")
    axes.set_ylim(top=axes.get_ylim()[1] + 2.5)
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=3)
    return figure
