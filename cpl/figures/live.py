"""Pictures around the pages: what stands in for an empty figure, and what link previews show."""

from io import BytesIO

import numpy as np
from numpy.typing import ArrayLike

from cpl.figures.style import BLUE, GREY, INK, RED, WIDTH, Card, drawn

__all__ = ["missing", "preview"]


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


@drawn
def preview(scores: ArrayLike, q: ArrayLike, *, title: str, words: str) -> bytes:
    """Draw what a link to the book shows: its title over a tracker at work, 1200 by 630 pixels.

    Args:
        scores: Score of each step, shape (T,).
        q: Threshold that the score met, shape (T,).
        title: The book's title.
        words: One line on what it is.

    Returns:
        A PNG.
    """
    s, threshold = np.asarray(scores), np.asarray(q)
    time, missed = np.arange(len(s)), s > threshold
    figure = Card(figsize=(12, 6.3))
    figure.set_layout_engine("none")
    axes = figure.add_axes((0.06, 0.06, 0.88, 0.5))
    axes.plot(time[~missed], s[~missed], "o", color=GREY, markersize=6)
    axes.plot(time[missed], s[missed], "^", color=RED, markersize=9)
    axes.step(time, threshold, where="mid", color=BLUE, linewidth=4)
    axes.set_axis_off()
    figure.text(0.06, 0.82, title, fontsize=44, weight="bold", color=INK)
    figure.text(0.06, 0.7, words, fontsize=23, color=GREY)
    target = BytesIO()
    figure.savefig(target, format="png", dpi=100, metadata={"Software": None})
    return target.getvalue()
