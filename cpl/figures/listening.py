"""Pictures of agents that hear a quantile: what they are shown, and what they do about it."""

from collections.abc import Mapping

import numpy as np
import pandas as pd

from cpl.figures.style import BLUE, GREEN, GREY, INK, PURPLE, RED, Card, card, cards, drawn, note
from cpl.stats import Estimate

__all__ = ["beside", "front", "responses", "support"]

_LOOKS = ((BLUE, "-"), (GREEN, (0, (4, 2))), (RED, (0, (1, 1))), (PURPLE, (0, (6, 2))),
          (INK, (0, (3, 1, 1, 1))))  # fmt: skip


@drawn
def support(places: Mapping[str, pd.DataFrame]) -> Card:
    """Draw how often each size of the quantile is met, a line a place.

    Args:
        places: By name, rows with `q_low` (the bins' lower ends) and `decisions`.
    """
    figure, panel = card(3.6)
    for (name, rows), (color, dash) in zip(places.items(), _LOOKS, strict=False):
        bins, place = np.unique(rows["q_low"], return_inverse=True)
        counts = np.bincount(place, weights=rows["decisions"].to_numpy(np.float64))
        share = counts / max(counts.sum(), 1.0)
        panel.step(bins, share, where="post", color=color, linestyle=dash, label=name)
    panel.set(xlabel="quantile q that the agent is shown", ylabel="share of decisions")
    panel.set_ylim(0, None)
    figure.legend(loc="outside upper center", ncols=2)
    return figure


@drawn
def responses(curves: Mapping[str, Mapping[str, pd.DataFrame]], *, what: str) -> Card:
    """Draw what agents would do if an input were another number, a panel an input.

    Args:
        curves: By input, by agent: rows with `at` (the number), `value`, `low` and `high`.
        what: What the vertical axis says.
    """
    figure, panels = cards(len(curves), 1.0 + 2.4 * len(curves), share_x=False)
    for panel, (name, agents) in zip(panels, curves.items(), strict=True):
        for (agent, rows), (color, dash) in zip(agents.items(), _LOOKS, strict=False):
            panel.fill_between(
                rows["at"], rows["low"], rows["high"], color=color, alpha=0.12, linewidth=0
            )
            panel.plot(rows["at"], rows["value"], color=color, linestyle=dash, label=agent)
        panel.set(xlabel=f"what {name} is set to", ylabel=what, ylim=(0, 1))
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=5)
    return figure


@drawn
def front(curves: Mapping[str, pd.DataFrame], points: pd.DataFrame, ends: pd.DataFrame) -> Card:
    """Draw how many crash over how fast they drive: rivals as curves, agents as single points.

    Args:
        curves: By name, rows with `step_speed_mps` and `crash_rate`, in the order of the setting.
        points: The same with `method`, one row each.
        ends: The same for the two drivers that all curves run between.
    """
    figure, panel = card(4.6)
    looks = [*_LOOKS, (GREY, "-"), (GREY, (0, (2, 2)))]
    for k, (name, rows) in enumerate(curves.items()):
        color, dash = looks[k % len(looks)]
        panel.plot(
            rows["step_speed_mps"], rows["crash_rate"], color=color, linestyle=dash,
            marker="os^Dv+x"[k % 7], markersize=4, linewidth=1.3, label=name,
        )  # fmt: skip
    for row in [*points.to_dict("records"), *ends.to_dict("records")]:
        where = float(row["step_speed_mps"]), float(row["crash_rate"])
        panel.plot(*where, "*", color=INK, markersize=9)
        note(panel, where[0] + 0.2, where[1], str(row["method"]), INK)
    panel.set(xlabel="mean speed [m/s]", ylabel="share of episodes with a crash")
    panel.invert_yaxis()
    figure.legend(loc="outside upper center", ncols=3)
    return figure


@drawn
def beside(roads: Mapping[str, Mapping[str, Estimate]], *, what: str) -> Card:
    """Draw differences with their intervals, several methods a road, from top to bottom.

    Args:
        roads: By road, by method.
        what: What the axis says.
    """
    methods = list(dict.fromkeys(name for found in roads.values() for name in found))
    figure, panel = card(1.4 + 0.16 * sum(len(found) + 1 for found in roads.values()))
    panel.axvline(0.0, color=INK, linewidth=1.0)
    place, ticks = 0.0, []
    for found in roads.values():
        ticks.append(place + (len(found) - 1) / 2)
        for name, estimate in found.items():
            at = methods.index(name)
            color, marker = _LOOKS[at % len(_LOOKS)][0], "os^Dv*"[at % 6]
            panel.plot([estimate.low, estimate.high], [place] * 2, color=color, linewidth=1.4)
            panel.plot(estimate.value, place, marker, color=color, markersize=5, label=name)
            place += 1
        panel.axhline(place, color=GREY, linewidth=0.4)
        place += 1
    panel.set_yticks(ticks, list(roads))
    panel.set(xlabel=what, ylim=(place - 0.5, -1.0))
    handles, labels = panel.get_legend_handles_labels()
    first = dict(zip(reversed(labels), reversed(handles), strict=True))
    shown = [name for name in methods if name in first]
    figure.legend([first[name] for name in shown], shown, loc="outside upper center", ncols=3)
    finite = [
        end
        for found in roads.values()
        for each in found.values()
        for end in (each.low, each.high)
        if np.isfinite(end)
    ]
    if finite:
        panel.set_xlim(min(*finite, 0.0) - 0.02, max(*finite, 0.0) + 0.02)
    return figure
