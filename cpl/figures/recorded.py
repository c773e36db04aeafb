"""Pictures of forecasts of drift: what two margins cover on real machines, and one of them in time.

Every figure carries the stamp of its recordings.
"""

import numpy as np
import pandas as pd

from cpl.figures.logs import stamp
from cpl.figures.style import BLUE, GREY, INK, RED, Card, card, cards, drawn, level

__all__ = ["coverages", "in_time"]


@drawn
def coverages(table: pd.DataFrame, *, alpha: float, label: str) -> Card:
    """What the frozen margin and the carried tracker cover, for each pair of machines.

    Args:
        table: Rows of the experiment `recorded`.
        alpha: Miscoverage aimed at [-].
        label: The provenance stamp.
    """
    names = list(dict.fromkeys(table["met"]))
    figure, axes = card(1.2 + 0.5 * len(names))
    offsets = np.linspace(-0.22, 0.22, len(names))
    for number, colour, marker, lift in (
        ("coverage_frozen", RED, "D", 0.0),
        ("coverage", BLUE, "o", 0.0),
    ):
        rows = table[table["number"] == number]
        height = [
            names.index(met) + offsets[names.index(trained)] + lift
            for trained, met in zip(rows["trained"], rows["met"], strict=True)
        ]
        own = np.asarray(rows["trained"]) == np.asarray(rows["met"])
        values, height = np.asarray(rows["value"]), np.array(height)
        word = "frozen margin" if number.endswith("frozen") else "carried tracker"
        axes.scatter(values[~own], height[~own], s=18, marker=marker, facecolors="none",
                     edgecolors=colour, linewidths=1.1)  # fmt: skip
        axes.scatter(values[own], height[own], s=26, marker=marker, color=colour, label=word)
    axes.axvline(1 - alpha, color=INK, linewidth=1, linestyle=(0, (5, 2)))
    axes.set(
        xlim=(-0.02, 1.02),
        xlabel="share covered",
        yticks=range(len(names)),
        yticklabels=names,
        ylim=(len(names) - 0.5, -0.5),
    )
    axes.legend(loc="upper left", bbox_to_anchor=(0.0, 1.16), ncols=2, frameon=False)
    return stamp(figure, label)


@drawn
def in_time(steps: pd.DataFrame, *, frozen: float, label: str) -> Card:
    """One recording in time: the machine's motion, and scores below or above both thresholds.

    Args:
        steps: As `cpl.forecast.drift.Met.steps`.
        frozen: The margin fixed in training [score].
        label: The provenance stamp.
    """
    figure, (above, below) = cards(2, 4.6, ratios=(1.0, 2.0))
    t_s = steps["t_s"].to_numpy()
    above.plot(t_s, steps["speed_mps"], color=GREY, linewidth=1)
    above.set_ylabel("speed [m/s]")
    missed = steps["err"].to_numpy(dtype=bool)
    below.plot(t_s, steps["score"], ".", color=GREY, markersize=3)
    below.plot(t_s[missed], steps["score"].to_numpy()[missed], ".", color=RED, markersize=4,
               label="missed by q")  # fmt: skip
    below.plot(t_s, steps["q"], color=BLUE, linewidth=1.3, label="q, carried")
    level(below, frozen, "frozen margin")
    below.set(xlabel="time [s]", ylabel="score", ylim=(0, 1.02))
    below.legend(loc="upper right", frameon=False)
    return stamp(figure, label)
