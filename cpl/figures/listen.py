"""Pictures of the agents that hear the quantile: against the printed table, and against a coin."""

from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np

from cpl.figures.style import BLUE, GREEN, GREY, INK, PURPLE, RED, Card, cards, drawn
from cpl.policies.table1 import PRINTED, ROWS, SWITCH, Cells

__all__ = ["NAMES", "coins", "printed"]

NAMES: Mapping[str, str] = {
    "speed": "speed",
    "rl_nq": "RL, no q",
    "rl": "RL",
    "rl_1": "RL 1",
    "rl_2": "RL 2",
    "rl_3": "RL 3",
    SWITCH: "switch at 0.3",
    "switch": "switch, chosen",
    "safe": "safe",
    "slow": "always slower",
}
"""What a figure says of a policy."""

_MARKS = {
    "speed": (GREY, "s"),
    "rl_nq": (GREEN, "v"),
    "rl": (GREEN, "o"),
    "rl_1": (GREEN, "^"),
    "rl_2": (GREEN, "D"),
    "rl_3": (GREEN, "P"),
    SWITCH: (BLUE, "*"),
    "switch": (BLUE, "X"),
    "safe": (RED, "*"),
    "slow": (INK, "<"),
}


@drawn
def printed(cells: Cells, *, rows: Sequence[str] = ROWS) -> Card:
    """Draw the mean duration of every row and range beside the printed one.

    Thick bars are intervals of the mean, thin ones say where one more training seed is to be
    expected, dots are the training seeds.

    Args:
        cells: Ours.
        rows: Which rows.
    """
    figure, panels = cards(len(cells.tops), 0.7 + 2.3 * len(cells.tops))
    places = np.arange(len(rows))
    for panel, top in zip(panels, cells.tops, strict=True):
        for place, policy in zip(places.tolist(), rows, strict=True):
            mean = cells.estimate("duration_s", policy, top)
            one = cells.foretold("duration_s", policy, top)
            each = cells.by_pair("duration_s", policy, top)
            if np.isfinite(one.low):
                panel.plot([one.low, one.high], [place] * 2, color=BLUE, linewidth=0.8)
            panel.plot([mean.low, mean.high], [place] * 2, color=BLUE, linewidth=3.5, alpha=0.6)
            panel.plot(each, [place] * len(each), ".", color=GREY, markersize=3)
            panel.plot(mean.value, place, "o", color=BLUE, markersize=4.5, label="ours")
            if (policy, top) in PRINTED:
                panel.plot(
                    PRINTED[policy, top].duration_s, place, "x", color=PURPLE, markersize=8,
                    markeredgewidth=2, label="printed",
                )  # fmt: skip
        panel.set_yticks(places, [NAMES.get(row, row) for row in rows])
        panel.invert_yaxis()
        panel.set_title(f"20 to {top:g} m/s")
    panels[-1].set_xlabel(f"mean duration [s], {cells.groups} training seeds")
    handles, labels = panels[0].get_legend_handles_labels()
    first = {label: handle for handle, label in zip(handles, labels, strict=True)}
    figure.legend(first.values(), first.keys(), loc="outside upper center", ncols=2)
    return figure


@drawn
def coins(
    cells: Cells,
    *,
    rows: Sequence[str] = tuple(NAMES),
    ends: Sequence[str] = ("slow", "rl"),
) -> Card:
    """Draw duration over speed, a panel a range, with the line that a coin moves along.

    Args:
        cells: The table.
        rows: Whom to draw.
        ends: The two policies between which the coin decides.
    """
    figure, panels = cards(len(cells.tops), 0.9 + 2.4 * len(cells.tops))
    for panel, top in zip(panels, cells.tops, strict=True):
        points = {
            row: (
                cells.estimate("episode_speed_mps", row, top),
                cells.estimate("duration_s", row, top),
            )
            for row in rows
        }
        for one, other in pairwise(ends):
            panel.plot(
                [points[one][0].value, points[other][0].value],
                [points[one][1].value, points[other][1].value],
                color=INK, linewidth=1.0, linestyle=(0, (4, 2)), label="a coin between the two",
            )  # fmt: skip
        for row, (speed, duration) in points.items():
            color, marker = _MARKS.get(row, (GREY, "."))
            panel.plot([speed.low, speed.high], [duration.value] * 2, color=color, linewidth=0.8)
            panel.plot([speed.value] * 2, [duration.low, duration.high], color=color, linewidth=0.8)
            size = 11 if marker == "*" else 6
            panel.plot(
                speed.value, duration.value, marker, color=color, markersize=size, linestyle="",
                label=NAMES.get(row, row),
            )  # fmt: skip
        panel.set(ylabel="duration [s]", title=f"20 to {top:g} m/s")
    panels[-1].set_xlabel("speed, averaged by episode [m/s]")
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=3)
    return figure
