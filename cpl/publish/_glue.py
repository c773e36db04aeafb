"""Numbers that prose can quote, so that none is typed by hand."""

__all__ = ["glue"]


def glue(name: str, value: object, fmt: str = "{}") -> None:
    """Give a computed value a name, by which the text of the chapter quotes it.

    The chapter says ``glue("coverage", 0.9031, "{:.3f}")`` in a cell and ``{glue:text}`coverage` ``
    in its text. The cell shows nothing; outside a notebook nothing happens.

    Args:
        name: What the text calls the value; unique in the chapter.
        value: The value.
        fmt: How to write it: a format string with one pair of braces.

    Raises:
        ValueError: If the format cannot write the value.

    Examples:
        >>> glue("coverage", 0.90312, "{:.1%}")  # the text will say 90.3%
        >>> glue("coverage", "high", "{:.1%}")
        Traceback (most recent call last):
            ...
        ValueError: fmt must be a format string for one value, got '{:.1%}' for 'high'
    """
    try:
        text = fmt.format(value)
    except (ValueError, IndexError, KeyError, TypeError) as error:
        msg = f"fmt must be a format string for one value, got {fmt!r} for {value!r}"
        raise ValueError(msg) from error
    _show(name, text)


def _show(name: str, text: str) -> None:
    """Write the text into the cell's output, under a type that no front end displays."""
    from IPython import get_ipython
    from IPython.display import display

    if get_ipython() is None:
        return
    prefix = "application/papermill.record/"  # what myst-nb and papermill agreed on
    display(
        {prefix + "text/plain": repr(text)},  # as a string: 0.100 stays 0.100
        raw=True,
        metadata={"scrapbook": {"name": name, "mime_prefix": prefix}},
    )
