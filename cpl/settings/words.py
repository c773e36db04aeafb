"""Reading `name=value` against declared parameters, and the refusal of what they may not be.

Nothing is executed here: a setting is text until it has been matched with a declared parameter, its
type and its range, and afterwards it is a plain number, truth value, word or tuple.
"""

from __future__ import annotations

import difflib
import math
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import cast

from cpl.settings.ranges import Choice, Interval

__all__ = [
    "TYPES",
    "Parameter",
    "ParameterError",
    "Value",
    "settings",
    "suggestion",
]

Value = int | float | bool | str | tuple[int, ...] | tuple[float, ...] | tuple[str, ...]


class ParameterError(ValueError):
    """A setting that is not allowed; the message says what it may be."""


@dataclass(frozen=True, kw_only=True)
class Parameter:
    """One parameter of a chapter, or one setting of an experiment.

    Attributes:
        name: Its name in the code.
        type: One of `TYPES`, as Python writes it.
        default: The value unless another is chosen.
        unit: Its unit, `-` if it has none.
        range: What it may be; None for `any`.
        meaning: What it is, in words.
    """

    name: str
    type: str
    default: Value
    unit: str = "-"
    range: Interval | Choice | None
    meaning: str = ""

    def allowed(self) -> str:
        """Say what the parameter may be, for people: `a float in (0, 1)`."""
        noun = {f"tuple[{kind}, ...]": f"one or more {kind}" for kind in ("int", "float", "str")}
        article = "an" if self.type == "int" else "a"
        kind = noun.get(self.type, f"{article} {self.type}")
        if isinstance(self.range, Choice):
            return f"one of {self.range}"
        if self.type == "bool":
            return "true or false"
        if isinstance(self.range, Interval):
            each = ", each" if self.type in noun else ""
            return f"{kind}{each} in {self.range}" + self._example()
        return kind + self._example()

    def convert(self, text: str) -> Value:
        """Turn what was typed into a value, or refuse it.

        Raises:
            ParameterError: If the text is not of the type, or the value out of range.
        """
        value = _CONVERTERS[self.type](text)
        if value is None:
            msg = f"{self.name} must be {self.allowed()}, got {_shown(text)}"
            raise ParameterError(msg)
        return self.check(value)

    def check(self, value: Value) -> Value:
        """Return the value if the parameter may have it.

        Raises:
            ParameterError: If it may not.
        """
        members = value if isinstance(value, tuple) else (value,)
        typed = all(_is_a(member, _member_type(self.type)) for member in members) and (
            isinstance(value, tuple) == self.type.startswith("tuple")
        )
        if not (typed and members and all(self._admits(member) for member in members)):
            msg = f"{self.name} must be {self.allowed()}, got {_shown(value)}"
            raise ParameterError(msg)
        return value

    def _admits(self, member: Value) -> bool:
        if isinstance(member, float) and not math.isfinite(member):
            return False
        if isinstance(self.range, Choice):
            return str(member) in self.range
        if isinstance(self.range, Interval):
            return member in self.range
        return not isinstance(member, str) or (member.isprintable() and len(member) <= 200)

    def _example(self) -> str:
        if not self.type.startswith("tuple"):
            return ""
        return ", such as a,b,c" if "str" in self.type else ", such as 1,2,3"


def settings(
    parameters: Iterable[Parameter], texts: Iterable[str], where: str = "the chapter"
) -> Mapping[str, Value]:
    """Check `name=value` texts against declared parameters.

    Args:
        parameters: What a chapter or an experiment declares.
        texts: What was typed, one `name=value` each.
        where: Whose they are, for messages.

    Returns:
        The values that were set, by name, in the order of the declaration.

    Raises:
        ParameterError: For an unknown, repeated, ill-typed or out-of-range setting.

    Examples:
        >>> inside = Interval(low=0, high=1, low_in=False, high_in=False)
        >>> words = {"name": "alpha", "type": "float", "unit": "-", "meaning": "miscoverage"}
        >>> alpha = Parameter(default=0.1, range=inside, **words)
        >>> settings([alpha], ["alpha=0.2"])
        {'alpha': 0.2}
        >>> settings([alpha], ["alhpa=0.2"], "theory")
        Traceback (most recent call last):
            ...
        cpl.settings.words.ParameterError: theory has no parameter 'alhpa'; did you mean \
'alpha'? It has: alpha
    """
    known = {parameter.name: parameter for parameter in parameters}
    given: dict[str, Value] = {}
    for text in texts:
        name, equals, value = text.partition("=")
        name = name.strip()
        if not equals:
            msg = f"a setting is written name=value, got {_shown(text)}"
            raise ParameterError(msg)
        if name not in known:
            msg = f"{where} has no parameter {_shown(name)}{suggestion(name, known)} It has: "
            raise ParameterError(msg + (", ".join(known) or "none"))
        if name in given:
            msg = f"{name} is set twice"
            raise ParameterError(msg)
        given[name] = known[name].convert(value.strip())
    return {name: given[name] for name in known if name in given}


def suggestion(name: str, known: Iterable[str]) -> str:
    """Return `; did you mean 'alpha'?` if a known name is near, else a full stop."""
    near = difflib.get_close_matches(name, list(known), n=1, cutoff=0.5)
    return f"; did you mean {near[0]!r}?" if near else "."


def _int(text: str) -> int | None:
    return int(text) if _INTEGER.fullmatch(text) and len(text) <= 30 else None


def _float(text: str) -> float | None:
    return float(text) if _DECIMAL.fullmatch(text) and len(text) <= 60 else None


def _bool(text: str) -> bool | None:
    return {"true": True, "false": False}.get(text.lower())


def _word(text: str) -> str | None:
    return text or None


def _tuple(member: Callable[[str], Value | None]) -> Callable[[str], Value | None]:
    def convert(text: str) -> Value | None:
        inner = text[1:-1] if text.startswith("(") and text.endswith(")") else text
        members = [member(part.strip()) for part in inner.removesuffix(",").split(",")]
        return None if None in members else cast("Value", tuple(members))

    return convert


def _is_a(value: object, type_: str) -> bool:
    """Compare types exactly: True is not an int here, and 1 is not a float."""
    return type(value).__name__ == type_


def _member_type(type_: str) -> str:
    return type_.removeprefix("tuple[").removesuffix(", ...]")


def _shown(value: object) -> str:
    """Quote what was typed, escaped and not longer than a line."""
    text = repr(value) if isinstance(value, str) else str(value)
    return text if len(text) <= 60 else text[:57] + "..."


_INTEGER = re.compile(r"[+-]?[0-9]+(_[0-9]+)*")
_DECIMAL = re.compile(r"[+-]?([0-9]+(_[0-9]+)*\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?")
_CONVERTERS: dict[str, Callable[[str], Value | None]] = {
    "int": _int,
    "float": _float,
    "bool": _bool,
    "str": str,
    "tuple[int, ...]": _tuple(_int),
    "tuple[float, ...]": _tuple(_float),
    "tuple[str, ...]": _tuple(_word),
}
TYPES = tuple(_CONVERTERS)
