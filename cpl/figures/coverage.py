"""Pictures of coverage: what it promises, what a shift does to it, and what it leaves open."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from cpl.figures.style import (
    BLUE,
    GREY,
    INK,
    PALE,
    RED,
    Card,
    card,
    cards,
    drawn,
    level,
    note,
    span,
)

__all__ = ["danger", "law", "rates", "two_coverages", "window_law"]


@drawn
def law(coverage: ArrayLike, *, grid: ArrayLike, density: ArrayLike, target: float) -> Card:
    """How coverage varies from one calibration set to the next, against the law it must follow.

    Args:
        coverage: coverage of each calibration set, shape (n,).
        grid: places where the law's density is given, shape (m,).
        density: the law's density there, shape (m,).
        target: the level asked for, 1 - alpha.
    """
    x, y = np.asarray(grid), np.asarray(density)
    figure, axes = card()
    axes.hist(
        np.asarray(coverage), bins=60, range=(x[0], x[-1]), density=True, color=BLUE, alpha=0.35
    )
    axes.plot(x, y, color=INK)
    peak = int(np.argmax(y))
    note(
        axes, float(x[peak // 2]), float(y[peak]) * 0.75, "line: Beta law\nbars: drawn", ha="right"
    )
    axes.axvline(target, color=RED, linestyle=(0, (5, 3)))
    note(axes, target, float(y[peak]) * 1.08, "target 1 - alpha", RED, ha="center")
    axes.set(xlabel="coverage given the calibration set", ylabel="density")
    return figure


@drawn
def two_coverages(
    frozen: ArrayLike, tracked: ArrayLike, *, window: int, shift: int, target: float
) -> Card:
    """Coverage in a sliding window of a frozen and a tracked threshold, around a shift.

    Args:
        frozen: whether the frozen threshold covered each step, shape (T,).
        tracked: whether the tracked one did, shape (T,).
        window: length of the sliding window [steps].
        shift: first step of the new regime.
        target: the level asked for, 1 - alpha.
    """
    figure, axes = card(height=3.4)
    time = np.arange(window, len(np.asarray(frozen)) + 1)
    for covered, name, hue, dash in (
        (frozen, "frozen at calibration", RED, (0, (6, 2))),
        (tracked, "tracked online", BLUE, "-"),
    ):
        share = np.convolve(np.asarray(covered, dtype=float), np.ones(window) / window, "valid")
        axes.plot(time, share, color=hue, linestyle=dash, label=name)
    span(axes, shift, float(time[-1]), "after the shift")
    level(axes, target, "target 1 - alpha", x=0.45, below=True)
    axes.set(xlabel="time step t", ylabel=f"coverage of the last {window}", ylim=(-0.03, 1.12))
    axes.legend(loc="lower left")
    return figure


@drawn
def danger(scores: ArrayLike, q: ArrayLike, dangerous: ArrayLike) -> Card:
    """Scores and threshold with the dangerous steps marked: they are the ones that are missed.

    Args:
        scores: score of each step, shape (T,).
        q: threshold that the score of the same step met, shape (T,).
        dangerous: whether the step was dangerous, shape (T,).
    """
    s, threshold, mask = np.asarray(scores), np.asarray(q), np.asarray(dangerous, dtype=bool)
    time, missed = np.arange(len(s)), s > threshold
    figure, (axes, strip) = cards(2, height=4.0, ratios=(3, 1))
    axes.plot(time[~mask], s[~mask], "o", color=GREY, markersize=3, label="harmless")
    axes.plot(time[mask], s[mask], "D", color=RED, markersize=5, label="dangerous")
    axes.step(time, threshold, where="mid", color=BLUE, label="q, the threshold")
    axes.set_ylabel("score")
    axes.legend(loc="lower left", bbox_to_anchor=(0, 1), ncols=3, borderaxespad=0.2)
    strip.eventplot(
        [time[missed], time[mask]], lineoffsets=[1, 0], linelengths=0.7, colors=[INK, RED]
    )
    strip.set_yticks([0, 1], ["danger", "error"])
    strip.grid(visible=False)
    strip.set(xlabel="time step t")
    return figure


@drawn
def rates(shares: Mapping[str, tuple[float, float, float]], *, alpha: float) -> Card:
    """Shares of errors with their 95 % intervals, one row a group, against the target.

    Args:
        shares: by name of the group its share, and the low and high end of its interval.
        alpha: target rate of errors.
    """
    figure, axes = card(height=1.2 + 0.6 * len(shares))
    rows = np.arange(len(shares))[::-1]
    for row, (share, low, high) in zip(rows, shares.values(), strict=True):
        axes.plot([low, high], [row, row], color=BLUE, linewidth=3, solid_capstyle="butt")
        axes.plot(share, row, "o", color=BLUE, markersize=7)
        side = "right" if share > 0.8 else "left"
        note(axes, share, float(row) + 0.33, f"{share:.3f}", BLUE, ha=side)
    axes.axvline(alpha, color=INK, linestyle=(0, (5, 3)), linewidth=1.1)
    axes.set_yticks(rows, list(shares))
    axes.set(xlabel="share of errors (dashed: target alpha)", xlim=(-0.04, 1.04))
    axes.set_ylim(-0.6, len(shares) - 0.3)
    axes.set_ylabel("group of steps")
    return figure


@drawn
def window_law(measured: ArrayLike, expected: ArrayLike) -> Card:
    """How many of a window's steps are covered: measured shares beside those of pure chance.

    Args:
        measured: share of windows with 0, 1, ..., W covered steps, shape (W + 1,).
        expected: the same under independent errors of rate alpha, shape (W + 1,).
    """
    have, chance = np.asarray(measured), np.asarray(expected)
    count = np.arange(len(have))
    figure, axes = card()
    axes.bar(count - 0.2, have, width=0.38, color=BLUE, label="tracker")
    axes.bar(count + 0.2, chance, width=0.38, color=PALE, edgecolor=GREY, hatch="//",
             label="independent errors")  # fmt: skip
    for x, share in ((count[-1] - 0.27, have[-1]), (count[-1] + 0.27, chance[-1])):
        note(axes, float(x), float(share) + 0.035, f"{share:.2f}", ha="center")
    axes.set_xticks(count)
    axes.set(xlabel="covered steps in the window", ylabel="share of windows", ylim=(0, 1))
    axes.legend(loc="upper left")
    return figure
