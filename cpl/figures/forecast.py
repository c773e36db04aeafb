"""Pictures of the learned forecast: how it was trained, how it errs, whether it tells danger."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.ticker import MaxNLocator
from numpy.typing import ArrayLike

from cpl.figures.style import (
    BLUE,
    GREEN,
    GREY,
    INK,
    PURPLE,
    RED,
    WIDTH,
    Card,
    card,
    cards,
    drawn,
    level,
    note,
)
from cpl.stats import mean_interval

__all__ = ["Interval", "around", "curves", "dots", "intervals", "profiles", "ride"]

Interval = tuple[float, float, float]
"""A value with the low and the high end of its interval."""

_BAND = "#cfe0ee"  # a pale BLUE: an area
_CLOSE: dict[str, Any] = {"columnspacing": 1.0, "handletextpad": 0.4, "handlelength": 1.6}
_LOOKS: tuple[tuple[str, str, Any], ...] = (
    (BLUE, "o", "-"),
    (RED, "^", (0, (6, 2))),
    (GREEN, "s", (0, (3, 1, 1, 1))),
    (PURPLE, "D", (0, (4, 2))),
    (GREY, "v", (0, (1, 1))),
    (INK, "x", (0, (2, 2))),
)


def intervals(table: pd.DataFrame, *by: str, sums: bool = False) -> pd.DataFrame:
    """Average over pairs of policies, with Student's 95 % interval: a pair is one training seed.

    Args:
        table: rows with `pair`, `value` and `n`, one a pair in each group; values that are not
            known (NaN) are left out.
        by: columns that tell groups apart.
        sums: whether `value` is a sum over `n` things, to be divided by it.

    Returns:
        One row a group: the columns of `by`, `value`, `low`, `high` and `pairs`.

    Example:
        >>> rows = pd.DataFrame({"pair": [0, 1], "policy": "speed", "value": [2.0, 8.0]})
        >>> rows["n"] = [2, 4]
        >>> found = intervals(rows, "policy", sums=True).round(1).to_dict("records")
        >>> found[0]["value"], found[0]["low"], found[0]["pairs"]
        (1.5, -4.9, 2)
    """
    known = table.assign(value=table["value"] / table["n"]) if sums else table
    groups: Any = known.dropna(subset=["value"]).groupby(list(by), sort=False)
    rows: list[dict[str, Any]] = []
    for key, part in groups:
        found = mean_interval(part["value"])
        place = dict(zip(by, key, strict=True))
        numbers = {"value": found.value, "low": found.low, "high": found.high, "pairs": found.n}
        rows.append(place | numbers)
    return pd.DataFrame(rows)


@drawn
def curves(losses: Mapping[str, ArrayLike], *, reference: float, name: str) -> Card:
    """Validation loss by epoch, one line a network, beside a forecast that was not trained.

    Args:
        losses: by network, the validation loss of each epoch.
        reference: the loss of the forecast to beat.
        name: what that is called.
    """
    figure, axes = card(height=3.6)
    for (label, values), (color, _, dash) in zip(losses.items(), _LOOKS, strict=False):
        y = np.asarray(values, dtype=float)
        axes.plot(np.arange(1, len(y) + 1), y, color=color, linestyle=dash, label=label)
        axes.plot(len(y), y[-1], "o", color=color, markersize=4)
    level(axes, reference, name, below=True)
    axes.set(xlabel="epoch", ylabel="validation loss (mean square error)", yscale="log")
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    axes.legend(loc="upper right", bbox_to_anchor=(1.0, 0.86))
    return figure


@drawn
def dots(
    rows: Mapping[str, Mapping[str, Interval]],
    *,
    xlabel: str,
    at: float | None = None,
    name: str = "",
    limits: tuple[float, float] | None = None,
) -> Card:
    """Values with their intervals, a line a subject and a marker a condition.

    Args:
        rows: by subject, then by condition.
        xlabel: what is measured.
        at: a level to compare with.
        name: what that level is.
        limits: of the horizontal axis.
    """
    conditions = list(dict.fromkeys(key for row in rows.values() for key in row))
    figure, axes = card(height=1.3 + 0.42 * len(rows))
    places = np.arange(len(rows))[::-1]
    for k, (condition, (color, marker, _)) in enumerate(zip(conditions, _LOOKS, strict=False)):
        shift = 0.16 * (0.5 * (len(conditions) - 1) - k)
        for y, row in zip(places, rows.values(), strict=True):
            if condition in row:
                value, low, high = row[condition]
                axes.plot([low, high], [y + shift] * 2, color=color, linewidth=2)
                axes.plot(value, y + shift, marker, color=color, markersize=6, zorder=3)
        axes.plot([], [], marker, color=color, label=condition)
    if at is not None:
        axes.axvline(at, color=INK, linestyle=(0, (5, 3)), linewidth=1.1)
        axes.plot([], [], color=INK, linestyle=(0, (5, 3)), linewidth=1.1, label=name)
    axes.set_yticks(places, list(rows))
    axes.set(xlabel=xlabel, ylim=(-0.6, len(rows) - 0.4))
    axes.set_ylabel("")
    if limits:
        axes.set_xlim(*limits)
    axes.legend(loc="lower right", bbox_to_anchor=(1, 1), ncols=3, borderaxespad=0.2, **_CLOSE)
    return figure


@drawn
def ride(
    times: ArrayLike,
    l_tilde: ArrayLike,
    l_hat: ArrayLike,
    q: ArrayLike,
    *,
    window: int,
    target: float,
) -> Card:
    """Figure 3 of the paper: forecast, quantile and what happened, and coverage in short windows.

    Args:
        times: at which each forecast was made [s], shape (n,).
        l_tilde: what happened, shape (n,).
        l_hat: what had been forecast for then, shape (n,).
        q: threshold that the forecast's score met, shape (n,).
        window: forecasts in a window.
        target: the level asked for, 1 - alpha.
    """
    t, truth, guess, threshold = (np.asarray(a, dtype=float) for a in (times, l_tilde, l_hat, q))
    covered = np.abs(truth - guess) <= threshold
    figure, (upper, lower) = cards(2, 5.0, ratios=(3, 2))
    upper.fill_between(
        t, guess - threshold, guess + threshold, step="mid", color=_BAND, label="forecast ± q"
    )
    upper.step(t, guess, where="mid", color=BLUE, linewidth=1.2, label="forecast")
    upper.plot(t[covered], truth[covered], "o", color=GREY, markersize=4, label="covered")
    upper.plot(t[~covered], truth[~covered], "^", color=RED, markersize=6, label="missed")
    upper.set(ylabel="proximity", ylim=(-0.05, 1.1))
    upper.legend(loc="lower left", bbox_to_anchor=(0, 1), ncols=4, borderaxespad=0.2, **_CLOSE)
    share = np.convolve(covered.astype(float), np.ones(window) / window, "valid")
    lower.step(t[window - 1 :], share, where="mid", color=BLUE)
    lower.plot(t[window - 1 :], share, "o", color=BLUE, markersize=3.5)
    level(lower, target, f"target {target:g}", below=True)
    lower.set(xlabel="time of the forecast [s]", ylabel=f"coverage, last {window}")
    lower.set_ylim(-0.05, 1.08)
    return figure


@drawn
def around(
    series: Mapping[str, tuple[ArrayLike, ArrayLike]],
    speed: tuple[ArrayLike, ArrayLike],
    *,
    event: str,
) -> Card:
    """Averages aligned at an event: what was known above, the car's own speed below.

    Args:
        series: by name, times relative to the event [s] and means.
        speed: the same for the speed [m/s].
        event: what happens at 0.
    """
    figure, (upper, lower) = cards(2, 4.8, ratios=(3, 2))
    for (name, (times, means)), (color, marker, dash) in zip(series.items(), _LOOKS, strict=False):
        upper.plot(
            np.asarray(times), np.asarray(means), marker, color=color, linestyle=dash,
            markersize=4, label=name,
        )  # fmt: skip
    upper.set(ylabel="mean")
    upper.legend(loc="lower left", bbox_to_anchor=(0, 1), ncols=3, borderaxespad=0.2)
    lower.plot(*(np.asarray(part) for part in speed), "o-", color=INK, markersize=4)
    lower.set(xlabel=f"seconds from {event} [s]", ylabel="speed [m/s]")
    for axes in (upper, lower):
        axes.axvline(0.0, color=RED, linestyle=(0, (5, 3)), linewidth=1.1)
    note(lower, 0.0, float(np.max(np.asarray(speed[1]))), event, RED, ha="right", va="top")
    return figure


@drawn
def profiles(lines: Mapping[str, tuple[ArrayLike, ArrayLike]], *, ylabel: str) -> Card:
    """Means by the time in the episode, a line a condition, named at its end.

    Args:
        lines: by condition, times [s] and means.
        ylabel: what is averaged.
    """
    figure, axes = card(height=3.4)
    figure.set_figwidth(WIDTH)
    for (name, (times, means)), (color, _, dash) in zip(lines.items(), _LOOKS, strict=False):
        axes.plot(np.asarray(times), np.asarray(means), color=color, linestyle=dash, label=name)
    axes.set(xlabel="time in the episode [s]", ylabel=ylabel)
    axes.set_ylim(bottom=0)
    axes.legend(loc="lower left", bbox_to_anchor=(0, 1), ncols=2, borderaxespad=0.2)
    return figure
