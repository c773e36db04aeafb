"""Pictures of a tracker at work and of the bounds it obeys (Part I of the book)."""

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import ArrayLike

from cpl.figures.style import (
    BLUE,
    GREEN,
    GREY,
    INK,
    PALE,
    PURPLE,
    RED,
    Card,
    card,
    cards,
    drawn,
    level,
    span,
)

__all__ = [
    "band",
    "delays",
    "episodes",
    "error_rates",
    "integral",
    "thresholds",
    "tracked",
    "worst_case",
]

_HUES = (BLUE, RED, GREEN, PURPLE, INK)
_DASHES = ("-", (0, (6, 2)), (0, (2, 1.5)), (0, (6, 2, 1.5, 2)), (0, (1, 1)))


@drawn
def tracked(scores: ArrayLike, q: ArrayLike, *, shift: int | None = None) -> Card:
    """The scores and the threshold each of them met; those above it are errors.

    Args:
        scores: score of each step, shape (T,).
        q: threshold that the score of the same step met, shape (T,).
        shift: first step of a new regime, shaded up to the end.
    """
    s, threshold = np.asarray(scores), np.asarray(q)
    time, missed = np.arange(len(s)), s > threshold
    figure, axes = card()
    axes.plot(time[~missed], s[~missed], "o", color=GREY, markersize=3, label="covered score")
    axes.plot(time[missed], s[missed], "^", color=RED, markersize=5.5, label="error")
    axes.step(time, threshold, where="mid", color=BLUE, label="q, the threshold")
    if shift is not None:
        span(axes, shift - 0.5, len(s) - 0.5, "after the shift")
    _frame(axes, "time step t", "score")
    axes.set_ylim(top=axes.get_ylim()[1] * 1.12)
    _legend_above(axes, 3)
    return figure


@drawn
def thresholds(paths: Mapping[str, ArrayLike], *, level_at: float, level_name: str) -> Card:
    """Several thresholds over time, and one level to compare them with.

    Args:
        paths: threshold of each step by name of the rule, each of shape (T,).
        level_at: height of the level, such as the score's constant value.
        level_name: what the level is.
    """
    figure, axes = card(height=3.4)
    for (name, path), hue, dash in zip(paths.items(), _HUES, _DASHES, strict=False):
        values = np.asarray(path)
        time = np.arange(len(values))
        axes.step(time, values, where="post", color=hue, linestyle=dash, label=name)
    level(axes, level_at, level_name)
    _frame(axes, "time step t", "threshold q")
    _legend_above(axes, 2)
    return figure


@drawn
def error_rates(curves: Mapping[str, ArrayLike], *, alpha: float) -> Card:
    """Share of errors up to each time, on a logarithmic time axis, against the target.

    Args:
        curves: errors (0 or 1) by name of the rule, each of shape (T,).
        alpha: target rate of errors.
    """
    figure, axes = card(height=3.8)
    for (name, errors), hue, dash in zip(curves.items(), _HUES, _DASHES, strict=False):
        values = np.asarray(errors, dtype=float)
        time = np.arange(1, len(values) + 1)
        axes.plot(time, np.cumsum(values) / time, color=hue, linestyle=dash, label=name)
    level(axes, alpha, "target alpha", below=True)
    axes.set_xscale("log")
    axes.set_ylim(-0.03, 1.05)
    _frame(axes, "number of steps so far", "share of errors")
    _legend_above(axes, 1)
    return figure


@drawn
def band(scores: ArrayLike, q: ArrayLike, *, low: float, high: float) -> Card:
    """A threshold inside the two walls that it cannot leave.

    Args:
        scores: score of each step, shape (T,).
        q: threshold that the score of the same step met, shape (T,).
        low: lower wall, reached.
        high: upper wall, never reached.
    """
    s, threshold = np.asarray(scores), np.asarray(q)
    time, missed = np.arange(1, len(s) + 1), s > threshold
    figure, axes = card()
    axes.axhspan(low, high, color=PALE, alpha=0.5, linewidth=0, zorder=0)
    level(axes, high, "q stays below this wall")
    level(axes, low, "q stays on or above this wall")
    axes.step(time, threshold, where="mid", color=BLUE, label="q, the threshold")
    axes.plot(time[~missed], s[~missed], "o", color=GREY, markersize=4, label="covered score")
    axes.plot(time[missed], s[missed], "^", color=RED, markersize=5.5, label="error")
    _frame(axes, "time step t", "score and threshold")
    _legend_above(axes, 3)
    return figure


@drawn
def worst_case(
    windows: ArrayLike,
    *,
    printed: ArrayLike,
    exact: ArrayLike,
    least: ArrayLike,
    attained: ArrayLike,
    alpha: float,
) -> Card:
    """The largest and smallest share of errors in a window, by its length.

    Args:
        windows: window lengths W [steps], shape (n,).
        printed: the paper's upper bound on the share, shape (n,).
        exact: the largest share that can happen, shape (n,).
        least: the smallest share that can happen, shape (n,).
        attained: largest share the adversary produced, shape (n,).
        alpha: target rate of errors.
    """
    w, upper = np.asarray(windows), np.asarray(printed)
    figure, axes = card(height=3.8)
    axes.fill_between(w, np.asarray(least), np.asarray(exact), color=BLUE, alpha=0.12, linewidth=0)
    axes.plot(w, upper, color=PURPLE, linestyle=_DASHES[1], label="paper, eq. (5)")
    axes.plot(w, np.asarray(exact), color=INK, label="exact worst and best case")
    axes.plot(w, np.asarray(least), color=INK)
    axes.plot(w, np.asarray(attained), "o", color=RED, markersize=4, label="adversary, measured")
    empty = w[upper >= 1]
    if empty.size:
        axes.axvspan(float(w[0]), float(empty[-1]), color=PALE, zorder=0, linewidth=0)
        axes.text(float(w[0]) * 1.1, 1.1, "no promise", color=GREY, va="center")
    level(axes, alpha, "target alpha", x=0.6, below=True)
    axes.set_xscale("log")
    axes.set_ylim(-0.03, 1.19)
    axes.set_yticks(np.linspace(0, 1, 6))
    _frame(axes, "window length W [steps]", "share of errors in the window")
    axes.legend(loc="upper right", bbox_to_anchor=(1.0, 0.9))
    return figure


@drawn
def delays(windows: ArrayLike, shares: Mapping[int, ArrayLike], *, alpha: float) -> Card:
    """The exact worst share of errors by window length, one line a delay of the feedback.

    Args:
        windows: window lengths W [steps], shape (n,).
        shares: worst share of errors by delay h [steps], each of shape (n,).
        alpha: target rate of errors.
    """
    w = np.asarray(windows)
    figure, axes = card(height=3.4)
    for (delay, share), hue, dash in zip(shares.items(), _HUES, _DASHES, strict=False):
        axes.plot(w, np.asarray(share), color=hue, linestyle=dash, label=f"delay h = {delay}")
    level(axes, alpha, "target alpha", below=True)
    axes.set_ylim(-0.03, 1.05)
    _frame(axes, "window length W [steps]", "worst share of errors")
    axes.legend(loc="upper right")
    return figure


@drawn
def episodes(reset: ArrayLike, carried: ArrayLike, *, length: int) -> Card:
    """The threshold over the first episodes, begun anew in each and carried over.

    Args:
        reset: threshold of each step when every episode starts from q0, shape (T,).
        carried: threshold of each step when it runs on, shape (T,).
        length: steps of an episode.
    """
    figure, panels = cards(2, height=4.2)
    for axes, path, name, hue in zip(
        panels, (reset, carried), ("reset", "carried over"), (RED, BLUE), strict=True
    ):
        q = np.asarray(path)
        axes.step(np.arange(len(q)), q, where="post", color=hue)
        for start in range(length, len(q), length):
            axes.axvline(start, color=GREY, linewidth=0.8, linestyle=_DASHES[2])
        axes.set_title(f"q is {name}", color=hue)
        axes.set_ylabel("threshold q")
    panels[0].sharey(panels[1])
    _frame(panels[1], "time step t (dotted: a new episode)", "threshold q")
    return figure


@drawn
def integral(errors: Mapping[str, ArrayLike], *, upper: ArrayLike, lower: float) -> Card:
    """The accumulated surplus of errors of PI trackers against the bound on it.

    Args:
        errors: sum of (err - alpha) up to each step by name of the form, each of shape (T,).
        upper: the bound from above at each step, shape (T,).
        lower: the bound from below.
    """
    figure, axes = card(height=3.4)
    ceiling = np.asarray(upper)
    time = np.arange(1, len(ceiling) + 1)
    for (name, surplus), hue, dash in zip(errors.items(), _HUES, _DASHES, strict=False):
        axes.plot(time, np.asarray(surplus), color=hue, linestyle=dash, label=name)
    axes.plot(time, ceiling, color=INK, linestyle=_DASHES[4], label="bound")
    axes.axhline(lower, color=INK, linestyle=_DASHES[4])
    _frame(axes, "time step t", "surplus of errors")
    _legend_above(axes, 2)
    return figure


def _frame(axes: Axes, x: str, y: str) -> None:
    axes.set(xlabel=x, ylabel=y)


def _legend_above(axes: Axes, columns: int) -> None:
    axes.legend(
        loc="lower left",
        bbox_to_anchor=(0.0, 1.0),
        ncols=columns,
        borderaxespad=0.2,
        handlelength=2.4,
    )
