"""The settings of an experiment: which there are, what may be chosen, and what is refused."""

from collections.abc import Iterable, Mapping
from dataclasses import fields, replace
from typing import Any, cast, get_args, get_type_hints

from cpl.settings.ranges import ranges_of
from cpl.settings.words import Parameter, ParameterError, Value, settings, suggestion

__all__ = ["changed", "parameters", "parsed", "spelled", "unknown"]


def parameters(config: Any) -> list[Parameter]:  # noqa: ANN401 - some Config
    """Return the settings of a configuration, with their types and ranges."""
    kinds, ranges = get_type_hints(type(config)), ranges_of(type(config))
    return [
        Parameter(
            name=field.name,
            type=_written(kinds[field.name]),
            default=getattr(config, field.name),
            range=ranges.get(field.name),
        )
        for field in fields(config)
    ]


def changed(config: Any, changes: Mapping[str, object]) -> Any:  # noqa: ANN401 - some Config
    """Return a configuration with some settings changed, each checked against its type.

    Whole numbers are taken for floats, and lists, which JSON has, for tuples.

    Raises:
        ValueError: If a setting does not exist or may not have the value; the message names what
            it may be.
    """
    known = {parameter.name: parameter for parameter in parameters(config)}
    for name in changes:
        if name not in known:
            raise ParameterError(unknown("setting", name, known))
    chosen = {name: known[name].check(_as_typed(known[name], v)) for name, v in changes.items()}
    return replace(config, **chosen)


def parsed(config: Any, words: Iterable[str]) -> dict[str, Value]:  # noqa: ANN401 - some Config
    """Read ``name=value`` words against the types of a configuration; nothing is evaluated.

    Raises:
        ValueError: If a word is not ``name=value``, names no setting, or its value does not fit.
    """
    return dict(settings(parameters(config), words, "the experiment"))


def spelled(config: Any) -> str:  # noqa: ANN401 - some Config
    """List the settings of a configuration, one a line, with what each may be."""
    return "\n".join(f"{p.name} = {p.default!r}  ({p.allowed()})" for p in parameters(config))


def unknown(what: str, name: str, known: Iterable[str]) -> str:
    """Say that a name is unknown, which one may have been meant, and which there are."""
    names = list(known)
    return f"no {what} {name!r}{suggestion(name, names)} There are: {', '.join(names)}"


def _written(kind: Any) -> str:  # noqa: ANN401 - a type
    """Write a type as Python does: `int`, `tuple[int, ...]`."""
    return kind.__name__ if isinstance(kind, type) and not get_args(kind) else str(kind)


def _as_typed(parameter: Parameter, value: object) -> Any:  # noqa: ANN401 - checked by whoever calls
    if isinstance(value, list):
        value = tuple(cast("list[object]", value))
    if isinstance(value, tuple) and parameter.type.startswith("tuple"):
        return tuple(_number(parameter.type, member) for member in value)
    return _number(parameter.type, value)


def _number(type_: str, value: object) -> object:
    if isinstance(value, int) and not isinstance(value, bool) and "float" in type_:
        return float(value)
    return value
