"""Pictures of many walks: when SLAM fails, what the gain rules decide, pairs of runs, coverage.

A picture whose data the logs do not have says so in the place where the data would be. Every
figure carries its provenance stamp.
"""

from typing import cast

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from cpl.figures.logs import stamp
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
    note,
)
from cpl.quadruped.gains import GAIN_RULES, GainLimits

__all__ = ["decisions", "differences", "failures", "window_coverage"]

GRID = 202  # points a side of a map of decisions; none of them falls on a threshold
MARKERS = {"triangle": "^", "rectangle": "s", "hexagon": "h"}


@drawn
def failures(shares: pd.DataFrame, *, label: str) -> Card:
    """Share of steps with a SLAM error over how fast the robot moved and turned.

    Args:
        shares: Rows with `motion` (names a panel and its axis), `middle` (of the bin), `value`,
            `low`, `high` and `n`.
        label: The provenance stamp.
    """
    names = list(dict.fromkeys(shares["motion"]))
    figure, panels = cards(len(names), 0.6 + 2.1 * len(names), share_x=False)
    for axes, name in zip(panels, names, strict=True):
        part = shares[shares["motion"] == name]
        reach = [part["value"] - part["low"], part["high"] - part["value"]]
        axes.errorbar(
            part["middle"],
            part["value"],
            yerr=reach,
            color=RED,
            marker="o",
            markersize=4,
            capsize=3,
        )
        axes.set(xlabel=name, ylabel="SLAM errors", ylim=(0, None))
    return stamp(figure, label)


@drawn
def decisions(*, kp_min: float = 0.8, kp_max: float = 4.0, q_safe: float = 0.8) -> Card:
    """What the printed and the corrected rule do, for every prediction and every quantile.

    Args:
        kp_min: Least gain [1/s].
        kp_max: Largest gain [1/s].
        q_safe: The switch's threshold [score].
    """
    limits = GainLimits(kp_min=kp_min, kp_max=kp_max, q_safe=q_safe)
    figure, panels = cards(2, 6.2)
    ticks = np.linspace(0, 1, GRID)
    titles = {"paper": "as printed", "corrected": "without the false-positive rule"}
    for axes, (name, title) in zip(panels, titles.items(), strict=True):
        rule, middle = GAIN_RULES[name], (kp_min * kp_max) ** 0.5
        slow = np.array(
            [[rule(middle, l_hat, q, limits) < middle for q in ticks] for l_hat in ticks]
        )
        axes.contourf(ticks, ticks, slow, levels=[-0.5, 0.5, 1.5], colors=["white", PALE])
        axes.contour(ticks, ticks, slow, levels=[0.5], colors=[INK], linewidths=1.2)
        axes.set(ylabel="prediction", title=title)
        note(axes, 0.2, 0.2, "faster", GREEN, ha="center")
        note(axes, 0.2, 0.85, "slower", RED, ha="center")
        low = name == "paper"
        note(axes, 0.85, 0.5, "faster" if low else "slower", GREEN if low else RED, ha="center")
    panels[-1].set_xlabel("quantile q [score]")
    return stamp(figure, "none; the rules alone")


@drawn
def differences(scored: pd.DataFrame, value: str, *, unit: str, label: str) -> Card:
    """Difference between the two policies in each pair of runs, by shape and range of the gain.

    Args:
        scored: What `cpl.quadruped.analysis.score_runs` returned.
        value: Which of its numbers.
        unit: What the axis says.
        label: The provenance stamp.
    """
    figure, axes = card(3.6)
    keys = ["range", "shape", "repeat"]
    wide = scored.pivot_table(index=keys, columns="policy", values=value, aggfunc="first")
    axes.axvline(0, color=INK, linewidth=1.0)
    axes.set(xlabel=f"switch minus No Quantile: {unit}", ylabel="shape and range", yticks=[])
    if not {"paper", "no_quantile"} <= set(wide.columns):
        return stamp(_empty(figure, axes, "these logs have no pairs of the two policies"), label)
    gap = (wide["paper"] - wide["no_quantile"]).dropna()
    cells = cast(
        "list[tuple[tuple[str, str], pd.Series]]", list(gap.groupby(level=["range", "shape"]))
    )
    for place, ((gains, shape), found) in enumerate(cells):
        values = found.to_numpy(dtype=np.float64)
        shift = place + np.linspace(-0.25, 0.25, len(values)) if len(values) > 1 else [place]
        marker = MARKERS.get(shape, "o")
        hue = BLUE if gains == "in" else PURPLE
        axes.plot(values, shift, marker, color=hue, markersize=4, alpha=0.6)
        axes.plot([values.mean()] * 2, [place - 0.35, place + 0.35], color=hue, linewidth=2.5)
    axes.set_yticks(range(len(cells)), [f"{shape}, {gains}" for (gains, shape), _ in cells])
    return stamp(figure, label)


@drawn
def window_coverage(windows: pd.DataFrame, *, alpha: float, label: str) -> Card:
    """Coverage of all windows that begin at the same step, beside what was guaranteed for them.

    Args:
        windows: What `cpl.quadruped.analysis.coverage_beside_bound` returned.
        alpha: Miscoverage aimed at [-].
        label: The provenance stamp.
    """
    figure, axes = card(3.4)
    axes.set(xlabel="first step of the window", ylabel="coverage in the window", ylim=(0, 1.04))
    if not len(windows):
        return stamp(_empty(figure, axes, "these logs have no predictions to be covered"), label)
    by = windows.groupby("window").agg(
        least=("coverage", "min"),
        median=("coverage", "median"),
        most=("coverage", "max"),
        bound=("guaranteed", "min"),
    )
    first = by.index.to_numpy(dtype=np.float64)
    least, median, most, bound = by.to_numpy(dtype=np.float64).T
    axes.fill_between(first, least, most, color=PALE, label="all runs")
    axes.plot(first, median, color=BLUE, label="median run")
    axes.plot(first, bound, color=INK, linestyle=(0, (5, 2)), label="least guarantee")
    level(axes, 1 - alpha, "the paper expects at least this", PURPLE, below=True)
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=3)
    return stamp(figure, label)


def _empty(figure: Card, axes: Axes, text: str) -> Card:
    """Say in an empty panel why it is empty."""
    axes.text(0.5, 0.5, text, transform=axes.transAxes, ha="center", va="center", color=GREY)
    return figure
