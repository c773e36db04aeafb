"""Read the typed parameters that a chapter declares, without running it.

The cell tagged `parameters` has one line for each parameter:

    alpha: float = 0.1  # [-] (0, 1): miscoverage the tracker aims at
    T: int = 10_000  # [steps] [1, 1000000]: length of the sequence
    form: str = "corrected"  # [-] {paper, corrected}: which statement of the theorem
    delays: tuple[int, ...] = (1, 5, 20)  # [steps] [1, 1000]: feedback delays shown

that is `name: type = default  # [unit] RANGE: meaning`. A range is an interval, a set of choices or
`any`; of a tuple it binds each member. A comment on a line of its own continues the meaning.
"""

from __future__ import annotations

import ast
import io
import re
import tokenize
from typing import Any

from cpl.settings.ranges import Choice, Interval, interval
from cpl.settings.words import TYPES, Parameter

__all__ = ["DeclarationError", "read_parameters"]


class DeclarationError(ValueError):
    """A `parameters` cell with a line that is untyped, without a unit or without a range."""


def read_parameters(code: str, where: str = "parameters") -> tuple[Parameter, ...]:
    """Read the parameters that a cell declares, without running it.

    Args:
        code: Source of the cell tagged `parameters`.
        where: What to call the place in messages, such as `book/theory.md`.

    Returns:
        The parameters in the order of the cell.

    Raises:
        DeclarationError: If a line has no type, no literal default, no unit, no range or no
            meaning, or its default is not in its range.

    Examples:
        >>> (alpha,) = read_parameters("alpha: float = 0.1  # [-] (0, 1): miscoverage")
        >>> alpha.default, alpha.unit, str(alpha.range), alpha.meaning
        (0.1, '-', '(0, 1)', 'miscoverage')
        >>> alpha.convert("0.2")
        0.2
    """
    try:
        tree, comments = ast.parse(code), _comments(code)
    except (SyntaxError, tokenize.TokenError) as error:
        msg = f"{where}: the cell tagged parameters is not Python: {error}"
        raise DeclarationError(msg) from error
    found: dict[str, Parameter] = {}
    for node in tree.body:
        try:
            parameter = _read_line(node, comments)
        except ValueError as error:
            msg = f"{where}: {ast.unparse(node)!r}: {error}"
            raise DeclarationError(msg) from error
        if parameter.name in found:
            msg = f"{where}: {parameter.name} is declared twice"
            raise DeclarationError(msg)
        found[parameter.name] = parameter
    return tuple(found.values())


def _comments(code: str) -> dict[int, tuple[str, bool]]:
    """Return each line's comment without its hash, and whether it has the line to itself."""
    tokens = tokenize.generate_tokens(io.StringIO(code).readline)
    return {
        token.start[0]: (token.string.lstrip("#").strip(), token.line.lstrip().startswith("#"))
        for token in tokens
        if token.type == tokenize.COMMENT
    }


def _read_line(node: ast.stmt, comments: dict[int, tuple[str, bool]]) -> Parameter:
    if not isinstance(node, ast.AnnAssign) or not isinstance(node.target, ast.Name):
        msg = "a parameter is written `name: type = default  # [unit] RANGE: meaning`"
        raise ValueError(msg)
    type_ = ast.unparse(node.annotation)
    if type_ not in TYPES:
        msg = f"the type must be one of {', '.join(TYPES)}; got {type_}"
        raise ValueError(msg)
    if node.value is None:
        msg = "a parameter needs a default"
        raise ValueError(msg)
    said = _COMMENT.fullmatch(_comment_of(node, comments))
    if said is None:
        msg = "the comment must read `# [unit] RANGE: meaning`, with `any` for no range"
        raise ValueError(msg)
    default = ast.literal_eval(node.value)
    if type_.removeprefix("tuple[").startswith("float"):
        default = _as_float(default)
    parameter = Parameter(
        name=node.target.id,
        type=type_,
        default=default,
        unit=said["unit"].strip(),
        range=_read_range(said["range"].strip()),
        meaning=said["meaning"].strip(),
    )
    parameter.check(default)
    return parameter


def _as_float(default: object) -> Any:  # noqa: ANN401 (checked by the parameter itself)
    """Take whole numbers for floats, alone and in tuples: `eta: float = 1`."""
    if isinstance(default, tuple):
        return tuple(_as_float(member) for member in default)
    return float(default) if type(default) is int else default


def _comment_of(node: ast.stmt, comments: dict[int, tuple[str, bool]]) -> str:
    """Return the comment behind a statement, with the lines of comment that continue it."""
    line = node.end_lineno or node.lineno
    text, _ = comments.get(line, ("", False))
    while text and comments.get(line + 1, ("", False))[1]:
        line += 1
        text += " " + comments[line][0]
    return text


def _read_range(text: str) -> Interval | Choice | None:
    if text == "any":
        return None
    if text.startswith("{"):
        options = tuple(part.strip() for part in text.strip("{}").split(","))
        if not all(options):
            msg = f"the choices {text} have an empty one"
            raise ValueError(msg)
        return Choice(options)
    return interval(text)


_COMMENT = re.compile(
    r"\[(?P<unit>[^\]]+)\]\s+(?P<range>[(\[][^,()\[\]]+,[^,()\[\]]+[)\]]|\{[^{}]+\}|any)\s*:\s*"
    r"(?P<meaning>\S.*)"
)
