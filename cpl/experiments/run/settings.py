"""Settings of an experiment: which there are, what may be said, and what is refused."""

import ast
import difflib
import math
from collections.abc import Iterable, Mapping
from dataclasses import fields, replace
from typing import Any, get_args, get_type_hints

__all__ = ["changed", "nearest", "parsed", "spelled"]

_KINDS: dict[Any, str] = {
    bool: "true or false",
    int: "an integer",
    float: "a number",
    str: "text",
    tuple[int, ...]: "integers, as in 1,2,3",
    tuple[float, ...]: "numbers, as in 0.1,0.2",
    tuple[str, ...]: "words, as in a,b",
}


def changed(config: Any, changes: Mapping[str, object]) -> Any:  # noqa: ANN401 - some Config
    """Return a configuration with some settings changed, each checked against its type.

    Raises:
        ValueError: If a setting does not exist or its value is not of its type; the message names
            what may be said.
    """
    kinds = get_type_hints(type(config))
    known = [field.name for field in fields(config)]
    for name in changes:
        if name not in known:
            raise ValueError(_unknown("setting", name, known))
    return replace(config, **{name: _fit(name, kinds[name], v) for name, v in changes.items()})


def parsed(config: Any, words: Iterable[str]) -> dict[str, object]:  # noqa: ANN401 - some Config
    """Read ``name=value`` words against the types of a configuration; nothing is evaluated.

    Raises:
        ValueError: If a word is not ``name=value``, names no setting, or its value does not fit.
    """
    kinds = get_type_hints(type(config))
    known = [field.name for field in fields(config)]
    changes: dict[str, object] = {}
    for word in words:
        name, equals, text = word.partition("=")
        if not equals:
            msg = f"a setting is written name=value, got {word!r}"
            raise ValueError(msg)
        if name not in known:
            raise ValueError(_unknown("setting", name, known))
        changes[name] = _fit(name, kinds[name], _read(kinds[name], text.strip()))
    return changes


def spelled(config: Any) -> str:  # noqa: ANN401 - some Config
    """List the settings of a configuration, one a line, with what each may be."""
    kinds = get_type_hints(type(config))
    return "\n".join(
        f"{field.name} = {getattr(config, field.name)!r}  ({_KINDS[kinds[field.name]]})"
        for field in fields(config)
    )


def nearest(what: str, name: str, known: Iterable[str]) -> str:
    """Say that a name is unknown, which one may have been meant, and which there are."""
    return _unknown(what, name, list(known))


def _unknown(what: str, name: str, known: list[str]) -> str:
    close = difflib.get_close_matches(name, known, n=1)
    guess = f", did you mean {close[0]!r}?" if close else ""
    return f"no {what} {name!r}{guess} (there are: {', '.join(known)})"


def _read(kind: Any, text: str) -> object:  # noqa: ANN401 - a type
    if kind is str:
        return text
    if kind == tuple[str, ...]:
        return tuple(part.strip() for part in text.split(","))
    if kind is bool:
        return {"true": True, "false": False}.get(text.lower(), text)
    try:
        value = ast.literal_eval(text)
    except (ValueError, SyntaxError, MemoryError, RecursionError):
        return text
    single = kind in (tuple[int, ...], tuple[float, ...]) and isinstance(value, (int, float))
    return (value,) if single else value


def _fit(name: str, kind: Any, value: object) -> object:  # noqa: ANN401 - a type
    fitted = _fitted(kind, value)
    if fitted is None:
        msg = f"{name} must be {_KINDS[kind]}, got {value!r}"
        raise ValueError(msg)
    return fitted


def _fitted(kind: Any, value: object) -> object | None:  # noqa: ANN401 - a type
    if kind is float and isinstance(value, (int, float)) and not isinstance(value, bool):
        return float(value) if math.isfinite(value) else None
    if kind is int and isinstance(value, int) and not isinstance(value, bool):
        return value
    if kind in (bool, str) and isinstance(value, kind):
        return value
    if kind in (tuple[int, ...], tuple[float, ...], tuple[str, ...]):
        if not isinstance(value, (tuple, list)) or not value:
            return None
        members = [_fitted(get_args(kind)[0], member) for member in value]
        return None if any(member is None for member in members) else tuple(members)
    return None
