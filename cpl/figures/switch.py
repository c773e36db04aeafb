"""Pictures of the switch: how fast for how safe, who leads by how much, how long episodes last."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes as Panel
from matplotlib.lines import Line2D

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
)
from cpl.stats import Estimate, Lead, SurvivalCurve

__all__ = ["LOOKS", "NAMES", "fronts", "leads", "means", "survivals"]

NAMES = {
    "duration_s": "mean duration [s]",
    "crashes_per_km": "collisions per km",
    "crash_rate": "share of episodes with a crash",
    "episode_speed_mps": "speed, averaged by episode [m/s]",
    "step_speed_mps": "speed, averaged over steps [m/s]",
    "duty": "share of steps under the safe policy",
    "mean_u": "what is added to the forecast",
}
"""What an axis says of a measure."""


@dataclass(frozen=True)
class Look:
    """How a curve is drawn: colour, marker and dash, so that colour never stands alone."""

    color: str
    marker: str
    dash: Any = "-"


LOOKS = {
    "conformal": Look(BLUE, "o"),
    "none": Look(INK, "x", (0, (4, 2))),
    "dropout": Look(GREEN, "^", (0, (1, 1))),
    "ensemble": Look(RED, "s", (0, (3, 1, 1, 1))),
    "hau": Look(PURPLE, "D", (0, (6, 2))),
    "certificates": Look(GREY, "v", (0, (2, 2))),
    "cap": Look(RED, "s"),
    "coin": Look(GREY, "v", (0, (1, 1))),
    "random": Look(GREY, "d", (0, (4, 2))),
    "donor": Look(GREEN, "^", (0, (1, 1))),
    "mean profile": Look(PURPLE, "D", (0, (6, 2))),
    "split constant": Look(INK, "+", (0, (1, 1))),
    "clock, safe first": Look(INK, ">", (0, (3, 1, 1, 1))),
    "clock, fast first": Look(INK, "<", (0, (3, 1, 1, 1))),
    "constant speed": Look(GREY, "s", (0, (2, 2))),
    "oracle l_tilde": Look(GREEN, "p"),
    "oracle crash": Look(PURPLE, "*"),
}
"""By name of the method or control."""

_OTHER = Look(GREY, ".")


@drawn
def fronts(
    curves: Mapping[str, pd.DataFrame],
    planes: Sequence[tuple[str, str]],
    *,
    star: pd.Series | None = None,
    reach: Mapping[str, Mapping[str, Sequence[Estimate]]] | None = None,
) -> Card:
    """Draw a curve for each way to drive, a panel for each plane.

    Args:
        curves: By name, one row a point in the order of its setting, with the measures.
        planes: For each panel the measure of safety (upwards) and that of speed (to the right).
        star: The measures of the safe policy, drawn as the paper's star.
        reach: By name of a curve and of a measure, its estimates in the order of the rows: drawn
            as bars.
    """
    figure, panels = cards(len(planes), 0.9 + 3.1 * len(planes), share_x=False)
    for panel, (safety, speed) in zip(panels, planes, strict=True):
        for name, points in curves.items():
            look = LOOKS.get(name, _OTHER)
            bars = (reach or {}).get(name)
            if bars:
                _bars(panel, bars[safety], bars[speed], look)
            panel.plot(
                points[speed],
                points[safety],
                color=look.color,
                marker=look.marker,
                linestyle=look.dash,
                markersize=4.5,
                linewidth=1.3,
                label=name,
            )
        if star is not None:
            panel.plot(
                star[speed], star[safety], "*", color=RED, markersize=14, label="safe policy alone"
            )
        if safety.startswith("crash"):
            panel.invert_yaxis()
        panel.set(xlabel=NAMES[speed], ylabel=NAMES[safety])
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=3)
    return figure


@drawn
def leads(found: Mapping[str, Mapping[str, Lead]], *, first: str) -> Card:
    """Draw how much faster one way to drive is than others, at each level of safety.

    Args:
        found: By title of the panel, by name of the other: the lead.
        first: Who leads, or does not.
    """
    figure, panels = cards(len(found), 0.9 + 2.5 * len(found), share_x=False)
    for panel, (title, others) in zip(panels, found.items(), strict=True):
        panel.axhline(0.0, color=INK, linewidth=1.0)
        for name, lead in others.items():
            look = LOOKS.get(name, _OTHER)
            x = np.abs(lead.levels)
            panel.fill_between(
                x, lead.gain.low, lead.gain.high, color=look.color, alpha=0.12, linewidth=0
            )
            panel.plot(
                x,
                lead.gain.value,
                color=look.color,
                marker=look.marker,
                linestyle=look.dash,
                markersize=4,
                linewidth=1.3,
                label=name,
            )
        durations = all(lead.levels.min() >= 0 for lead in others.values())
        below = NAMES["duration_s"] if durations else NAMES["crashes_per_km"]
        panel.set(title=title, xlabel=f"at equal {below}", ylabel=f"{first} faster by [m/s]")
        if not durations:
            panel.invert_xaxis()
    lines = {line.get_label(): line for panel in panels for line in panel.get_lines()}
    shown = {str(name): line for name, line in lines.items() if not str(name).startswith("_")}
    figure.legend(list(shown.values()), list(shown), loc="outside upper center", ncols=3)
    return figure


@drawn
def means(rows: Mapping[str, Estimate], *, what: str, zero: bool = True) -> Card:
    """Draw one number with its interval for each of several things, from top to bottom.

    Args:
        rows: By name, the estimate.
        what: What the axis says.
        zero: Whether a line marks 0.
    """
    figure, panel = card(0.9 + 0.32 * len(rows))
    if zero:
        panel.axvline(0.0, color=INK, linewidth=1.0)
    for place, estimate in enumerate(rows.values()):
        panel.plot([estimate.low, estimate.high], [place, place], color=BLUE, linewidth=1.6)
        panel.plot(estimate.value, place, "o", color=BLUE, markersize=5)
    panel.set_yticks(range(len(rows)), list(rows))
    panel.set(xlabel=what, ylabel="", ylim=(len(rows) - 0.5, -0.5))
    return figure


@drawn
def survivals(curves: Mapping[str, SurvivalCurve], *, horizon: float) -> Card:
    """Draw the share of episodes that go on, with pointwise intervals.

    Args:
        curves: By name.
        horizon: Where the clock ends an episode [s].
    """
    figure, panel = card(3.6)
    looks = [Look(BLUE, ""), Look(INK, "", (0, (4, 2))), Look(GREEN, "", (0, (1, 1))),
             Look(RED, "", (0, (3, 1, 1, 1))), Look(PURPLE, "", (0, (6, 2)))]  # fmt: skip
    handles: list[Line2D] = []
    for (name, curve), look in zip(curves.items(), looks * len(curves), strict=False):
        time = np.concatenate([[0.0], curve.time])
        low, alive, high = (
            np.concatenate([[1.0], end]) for end in (curve.low, curve.alive, curve.high)
        )
        panel.fill_between(time, low, high, step="post", color=look.color, alpha=0.15, linewidth=0)
        handles += panel.step(
            time, alive, where="post", color=look.color, linestyle=look.dash, label=name
        )
    panel.set(xlabel="time [s]", ylabel="share that goes on", xlim=(0, horizon), ylim=(0, 1.02))
    figure.legend(handles=handles, loc="outside upper center", ncols=2)
    return figure


def _bars(
    panel: Panel,
    safety: Sequence[Estimate],
    speed: Sequence[Estimate],
    look: Look,
) -> None:
    """Draw both intervals of every point as a cross."""
    for high, across in zip(safety, speed, strict=True):
        panel.plot(
            [across.value] * 2, [high.low, high.high], color=look.color, alpha=0.45, linewidth=1.0
        )
        panel.plot(
            [across.low, across.high], [high.value] * 2, color=look.color, alpha=0.45, linewidth=1.0
        )
