"""The book's one visual language: a palette, a card to draw on, and direct labels.

Figures are vector cards with a white ground, so that they read the same on a light and on a dark
page. Colours are the Okabe-Ito hues, which stay apart for colour-blind readers; those that would
be too pale for text on white are darkened until they reach a contrast of 4.5 to 1. Colour never
stands alone: a line also has its own dash or marker and, where there is room, its own label.

Example:
    >>> from cpl.figures.style import BLUE, card, drawn
    >>> @drawn
    ... def squares(n: int) -> Card:
    ...     figure, axes = card(height=2.4)
    ...     axes.plot(range(n), [k * k for k in range(n)], color=BLUE)
    ...     axes.set(xlabel="k", ylabel="k squared")
    ...     return figure
    >>> squares(4).axes[0].get_xlabel()
    'k'
"""

from collections.abc import Callable, Sequence
from functools import wraps
from io import StringIO
from typing import Any, ParamSpec, TypeVar

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.typing import RcKeyType

__all__ = [
    "BLUE",
    "GREEN",
    "GREY",
    "INK",
    "PALE",
    "PURPLE",
    "RED",
    "WIDTH",
    "Card",
    "card",
    "cards",
    "drawn",
    "level",
    "note",
    "span",
]

INK = "#1b1b1b"  # axes, bounds, whatever is a statement and not a measurement
BLUE = "#0072b2"  # the tracked quantile; what this book measures
RED = "#b84a00"  # Okabe-Ito vermilion, darkened: errors and danger
GREEN = "#007a5a"  # Okabe-Ito bluish green, darkened: a second method
PURPLE = "#9b4a7a"  # Okabe-Ito reddish purple, darkened: what the paper prints
GREY = "#666666"  # data in the background
PALE = "#ebebeb"  # areas only, never text

WIDTH = 5.6  # [inch]: fits the text column of a wide page, and is still legible on a phone

_STYLE: dict[RcKeyType, Any] = {
    "axes.axisbelow": True,
    "axes.edgecolor": INK,
    "axes.facecolor": "white",
    "axes.grid": True,
    "axes.labelcolor": INK,
    "axes.labelsize": 11,
    "axes.linewidth": 0.8,
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.titlelocation": "left",
    "axes.titlesize": 11,
    "figure.constrained_layout.use": True,
    "figure.facecolor": "white",
    "font.family": "DejaVu Sans",  # ships with matplotlib: the same letters on every machine
    "font.size": 10.5,
    "grid.color": PALE,
    "grid.linewidth": 0.6,
    "legend.fontsize": 10,
    "legend.frameon": False,
    "lines.linewidth": 1.8,
    "svg.fonttype": "path",
    "svg.hashsalt": "cpl",  # element names, and so the file, are the same in every run
    "text.color": INK,
    "xtick.color": INK,
    "xtick.labelsize": 10,
    "ytick.color": INK,
    "ytick.labelsize": 10,
}

_P = ParamSpec("_P")
_R = TypeVar("_R")


class Card(Figure):
    """A figure that a notebook shows as SVG, with the same bytes in every run."""

    def _repr_mimebundle_(self, **_: object) -> dict[str, str]:
        """What a notebook stores for this figure: the vector form and a one-line text."""
        return {"image/svg+xml": self.svg(), "text/plain": self.summary()}

    def svg(self) -> str:
        """The figure as an SVG document without a date."""
        target = StringIO()
        with mpl.rc_context(_STYLE):
            self._settle()
            self.savefig(target, format="svg", metadata={"Date": None})
        return target.getvalue()

    def _settle(self) -> None:
        """Lay the axes out once, on round numbers: the solver's last bits differ between runs."""
        self.draw_without_rendering()
        self.set_layout_engine("none")
        for axes in self.axes:
            axes.set_position(np.round(axes.get_position(original=True).bounds, 6).tolist())

    def summary(self) -> str:
        """One line naming the axes, for readers who see no picture.

        Example:
            >>> figure, axes = card()
            >>> _ = axes.set(xlabel="time [s]", ylabel="score")
            >>> figure.summary()
            'Figure: score against time [s]'
        """
        names = [axes.get_ylabel() for axes in self.axes if axes.get_ylabel()]
        below = self.axes[-1].get_xlabel() if self.axes else ""
        return f"Figure: {', '.join(dict.fromkeys(names))} against {below}"


def drawn(make: Callable[_P, _R]) -> Callable[_P, _R]:
    """Run a figure function inside the book's style, whatever the reader's own settings are."""

    @wraps(make)
    def wrapper(*args: _P.args, **kwargs: _P.kwargs) -> _R:
        with mpl.rc_context(_STYLE):
            return make(*args, **kwargs)

    return wrapper


@drawn
def card(height: float = 3.2) -> tuple[Card, Axes]:
    """One panel at page width.

    Args:
        height: of the figure [inch].

    Returns:
        The figure and its only axes.
    """
    figure = Card(figsize=(WIDTH, height))
    return figure, figure.add_subplot()


@drawn
def cards(
    rows: int, height: float = 4.6, *, share_x: bool = True, ratios: Sequence[float] | None = None
) -> tuple[Card, list[Axes]]:
    """Panels above each other: a column reads on a phone where a row would not.

    Args:
        rows: number of panels.
        height: of the whole figure [inch].
        share_x: one horizontal axis for all panels.
        ratios: relative heights of the panels, equal unless given.

    Returns:
        The figure and its axes from top to bottom.
    """
    figure = Card(figsize=(WIDTH, height))
    axes = figure.subplots(rows, 1, sharex=share_x, squeeze=False, height_ratios=ratios)
    return figure, list(axes[:, 0])


def note(
    axes: Axes,
    x: float,
    y: float,
    text: str,
    color: str = INK,
    *,
    ha: str = "left",
    va: str = "center",
) -> None:
    """Write a direct label at a point of the data, on a white ground so that it stays legible.

    Args:
        axes: where to write.
        x: position in data units.
        y: position in data units.
        text: the label.
        color: that of the line it names.
        ha: which side of the text sits at `x`: `left`, `center` or `right`.
        va: which side of the text sits at `y`: `top`, `center` or `bottom`.
    """
    ground = {"facecolor": "white", "edgecolor": "none", "alpha": 0.85, "pad": 1.0}
    axes.text(x, y, text, color=color, ha=ha, va=va, bbox=ground)


def level(
    axes: Axes, y: float, text: str, color: str = INK, *, x: float = 1.0, below: bool = False
) -> None:
    """Draw a dashed horizontal level and write its name along the line.

    Args:
        axes: where to draw.
        y: height in data units.
        text: the name.
        color: of line and name.
        x: where the name ends, as a share of the width.
        below: write under the line, not above it.
    """
    axes.axhline(y, color=color, linestyle=(0, (5, 3)), linewidth=1.1)
    axes.annotate(
        text,
        (x, y),
        xycoords=("axes fraction", "data"),
        xytext=(0, -3 if below else 2),
        textcoords="offset points",
        ha="right",
        va="top" if below else "bottom",
        color=color,
    )


def span(axes: Axes, start: float, end: float, text: str) -> None:
    """Shade a stretch of the horizontal axis and name it at the top.

    Args:
        axes: where to draw.
        start: left end in data units.
        end: right end in data units.
        text: the name.
    """
    axes.axvspan(start, end, color=PALE, zorder=0, linewidth=0)
    axes.annotate(
        text,
        (0.5 * (start + end), 1.0),
        xycoords=("data", "axes fraction"),
        xytext=(0, -4),
        textcoords="offset points",
        ha="center",
        va="top",
        color=GREY,
    )
