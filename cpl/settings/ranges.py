"""What a number or a word may be, and configurations whose fields say so.

A field is annotated with its range, written as the chapters write theirs:

    pairs: Annotated[int, interval("[1, inf)")]
    learner: Annotated[str, Choice(("compiled", "sb3"))]

Of a tuple the range binds each member. What relates several fields is left to the class's own
`__post_init__`, which calls this one first.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated, Any, get_args, get_origin, get_type_hints

__all__ = [
    "Choice",
    "Count",
    "Interval",
    "Natural",
    "Positive",
    "Probability",
    "Settings",
    "Share",
    "interval",
    "ranges_of",
]


@dataclass(frozen=True, kw_only=True)
class Interval:
    """The numbers between two ends, each in or out: `(0, 1]`, `[1, inf)`."""

    low: float
    high: float
    low_in: bool
    high_in: bool

    def __contains__(self, value: object) -> bool:
        if not isinstance(value, (int, float)):
            return False
        above = value > self.low or (self.low_in and value == self.low)
        below = value < self.high or (self.high_in and value == self.high)
        return above and below and math.isfinite(value)

    def __str__(self) -> str:
        left, right = "(["[self.low_in], ")]"[self.high_in]
        return f"{left}{_plain(self.low)}, {_plain(self.high)}{right}"


@dataclass(frozen=True)
class Choice:
    """A handful of allowed words: `{paper, corrected}`."""

    options: tuple[str, ...]

    def __contains__(self, value: object) -> bool:
        return value in self.options

    def __str__(self) -> str:
        return "{" + ", ".join(self.options) + "}"


def interval(text: str) -> Interval:
    """Read an interval.

    Raises:
        ValueError: If it holds no number.

    Examples:
        >>> 0.5 in interval("(0, 1)"), 1.0 in interval("(0, 1)"), str(interval("[1, inf)"))
        (True, False, '[1, inf)')
    """
    low, high = (float(end) for end in text[1:-1].split(","))
    if not low < high:
        msg = f"the range {text} is empty"
        raise ValueError(msg)
    return Interval(low=low, high=high, low_in=text[0] == "[", high_in=text[-1] == "]")


Count = Annotated[int, interval("[1, inf)")]
Natural = Annotated[int, interval("[0, inf)")]
Positive = Annotated[float, interval("(0, inf)")]
Probability = Annotated[float, interval("(0, 1)")]
"""A level such as alpha: neither never nor always."""
Share = Annotated[float, interval("[0, 1]")]


class Settings:
    """Base of frozen, keyword-only dataclasses: refuses a field that is out of its range."""

    def __post_init__(self) -> None:
        """Check every field that has a range.

        Raises:
            ValueError: Naming the first field out of its range, what it may be and its value.
        """
        for name, allowed in ranges_of(type(self)).items():
            value = getattr(self, name)
            members = value if isinstance(value, tuple) else (value,)
            for member in members:
                if member not in allowed:
                    raise ValueError(f"{name} must be in {allowed}, got {member!r}")


@lru_cache(maxsize=256)
def ranges_of(settings: type) -> Mapping[str, Interval | Choice]:
    """Return the ranges that the fields of a class are annotated with, by field.

    A subclass that gives a field another default keeps the range.
    """
    found: dict[str, Interval | Choice] = {}
    for one in reversed(settings.__mro__):
        if "__annotations__" not in vars(one):
            continue
        hints: dict[str, Any] = get_type_hints(one, include_extras=True)
        for name in vars(one)["__annotations__"]:
            for extra in _extras(hints[name]):
                found[name] = extra
    return found


def _extras(hint: Any) -> list[Interval | Choice]:  # noqa: ANN401 - a type
    """Return the ranges in an annotation, be they of the members of a tuple."""
    if get_origin(hint) is Annotated:
        return [extra for extra in get_args(hint)[1:] if isinstance(extra, (Interval, Choice))]
    if get_origin(hint) is tuple:
        return _extras(get_args(hint)[0])
    return []


def _plain(end: float) -> str:
    return str(int(end)) if end == end // 1 and abs(end) < 1e15 else str(end)
