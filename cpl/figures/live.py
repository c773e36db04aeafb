"""Pictures that stand in for live figures, in print and where no script runs."""

from collections.abc import Sequence

import pandas as pd

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
    drawn,
)

__all__ = ["fronts", "missing"]

_LOOKS = (
    (BLUE, "-", "o"),
    (RED, "--", "s"),
    (GREEN, ":", "^"),
    (PURPLE, "-.", "D"),
    (GREY, "--", "o"),
    (INK, ":", "s"),
)


@drawn
def fronts(points: pd.DataFrame, *, methods: Sequence[str]) -> Card:
    """Draw mean duration against mean speed along the limit of the switch, a curve a method.

    Args:
        points: One row a method and limit: `words` (the method's name), `q_safe`, `speed` [m/s] and
            `duration` [s].
        methods: Names of the methods to draw, in order, at most six.
    """
    figure, axes = card()
    for name, (color, dash, marker) in zip(methods, _LOOKS, strict=False):
        curve = points.loc[points["words"] == name].sort_values("q_safe")
        axes.plot(
            curve["speed"],
            curve["duration"],
            color=color,
            linestyle=dash,
            marker=marker,
            markersize=3.5,
            label=name,
        )
    axes.set(xlabel="mean speed [m/s]", ylabel="mean duration of a ride [s]")
    axes.legend(loc="lower left")
    return figure


@drawn
def missing(text: str) -> Card:
    """Say on an empty card what is not there.

    Args:
        text: One sentence.

    Examples:
        >>> missing("Nothing yet.").texts[0].get_text()
        'Nothing yet.'
    """
    figure = Card(figsize=(WIDTH, 1.0))
    figure.text(0.5, 0.5, text, ha="center", va="center", color=GREY)
    return figure
