"""What stands in for a live figure that has nothing to show yet."""

from cpl.figures.style import GREY, WIDTH, Card, drawn

__all__ = ["missing"]


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
