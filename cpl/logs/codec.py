"""One row to the messages of its channels, and back."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from difflib import get_close_matches
from typing import Any

from cpl.logs.errors import LogError, NotFiniteError, RangeError, SchemaError
from cpl.logs.schema import CHANNELS, COLUMNS, FIELDS, Channel, Field

__all__ = ["MalformedError", "channels_of", "decode", "encode", "nanoseconds", "sound"]

NS = 1_000_000_000  # [ns] in a second
LAST_S = 4e9  # [s] what a log time of 64 bits holds beside a start in this century, with room


class MalformedError(Exception):
    """A message that cannot be taken; becomes a fault, with its place, in the reader."""

    def __init__(self, error: type[LogError], what: str) -> None:
        super().__init__(what)
        self.error = error


def nanoseconds(t_s: float) -> int:
    """Return a time in whole nanoseconds, the resolution that a log has.

    Raises:
        ValueError: Not a finite time of at least 0.

    Examples:
        >>> nanoseconds(3 * 0.1)
        300000000
    """
    t_s = _plain(t_s)
    number = isinstance(t_s, (int, float)) and not isinstance(t_s, bool)
    if not (number and math.isfinite(t_s) and 0 <= t_s < LAST_S):
        msg = f"t_s must be finite, at least 0 and below {LAST_S:.0e}, got {t_s!r}"
        raise ValueError(msg)
    return round(t_s * NS)


def channels_of(row: Mapping[str, Any]) -> tuple[Channel, ...]:
    """Return the channels that a row has: those of which it has every column, and not all unknown.

    Raises:
        ValueError: A column that no channel has, half a channel, or no pose.
    """
    for column in row:
        if column not in COLUMNS:
            near = get_close_matches(column, COLUMNS, n=1)
            hint = f"; did you mean {near[0]!r}?" if near else ""
            msg = f"row must have only the columns of cpl.logs.COLUMNS, got {column!r}{hint}"
            raise ValueError(msg)
    there: list[Channel] = []
    for channel in CHANNELS:
        have = [column for column in channel.columns if column in row]
        lacking = set(channel.columns) - set(have)
        if lacking and (have or channel.required):
            msg = f"row must have all of {', '.join(channel.columns)}, got no {min(lacking)!r}"
            raise ValueError(msg)
        if have and (channel.required or not all(_unknown(row[column]) for column in have)):
            there.append(channel)
    return tuple(there)


def encode(channel: Channel, row: Mapping[str, Any], stamp_ns: int) -> bytes | None:
    """Return the message of a channel for a row; None where a sparse channel has nothing to say.

    Raises:
        ValueError: A value of the wrong kind, out of range, or not finite where it must be.
    """
    values = [_given(each, row[each.column]) for each in channel.fields]
    if channel.sparse and not any(values):
        return None
    sec, nsec = divmod(stamp_ns, NS)
    message: dict[str, Any] = {"timestamp": {"sec": sec, "nsec": nsec}}
    if channel.frame:
        message["frame_id"] = channel.frame
    message |= channel.constant
    for each, value in zip(channel.fields, values, strict=True):
        inner = message
        for part in each.at[:-1]:
            inner = inner.setdefault(part, {})
        inner[each.at[-1]] = value
    return json.dumps(message, separators=(",", ":"), allow_nan=False).encode()


def decode(channel: Channel, payload: bytes) -> dict[str, Any]:
    """Return the columns that a message holds.

    Raises:
        MalformedError: It is not JSON, lacks a field, or holds what it cannot hold.
    """
    try:
        message = _JSON.decode(payload.decode())
    except (ValueError, RecursionError) as error:
        raise MalformedError(SchemaError, f"is not JSON ({error})") from error
    if not isinstance(message, dict):
        raise MalformedError(SchemaError, f"must be a JSON object, got {type(message).__name__}")
    if channel.frame and message.get("frame_id") != channel.frame:
        what = f"frame_id must be {channel.frame!r}, got {message.get('frame_id')!r}"
        raise MalformedError(SchemaError, what)
    return {each.column: _taken(each, message) for each in channel.fields}


def sound(row: Mapping[str, Any]) -> dict[str, Any]:
    """Return a row from elsewhere with every value of its kind and in its range.

    Raises:
        MalformedError: One is not.

    Examples:
        >>> sound({"t_s": 0, "confidence": 3.0})
        {'t_s': 0.0, 'confidence': 3}
    """
    return {column: _sound(FIELDS[column], value) for column, value in row.items()}


def _sound(each: Field, value: Any) -> Any:  # noqa: ANN401 - a number or a word
    value = _plain(value)
    if each.nullable and _unknown(value):
        return value
    if each.kind == "int" and isinstance(value, float) and value.is_integer():
        value = int(value)
    return _judged(each, value)


def _plain(value: Any) -> Any:  # noqa: ANN401 - a number or a word
    """Return a numpy scalar as Python's own, anything else as it is."""
    return value.item() if hasattr(value, "item") else value


def _unknown(value: object) -> bool:
    return isinstance(value, float) and math.isnan(value)


def _given(each: Field, value: Any) -> Any:  # noqa: ANN401 - a number or a word
    """Return a row's value as JSON holds it."""
    value = _plain(value)
    if each.kind == "text":
        if not isinstance(value, str):
            msg = f"{each.column} must be text, got {value!r}"
            raise ValueError(msg)
        return value
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        msg = f"{each.column} must be a number, got {value!r}"
        raise ValueError(msg)
    if each.nullable and _unknown(value):
        return None
    whole = float(value).is_integer() if each.kind == "int" else math.isfinite(value)
    if not (whole and each.low <= value <= each.high):
        msg = f"{each.column} must be {_allowed(each, value)}, got {value!r}"
        raise ValueError(msg)
    return int(value) if each.kind == "int" else float(value)


def _taken(each: Field, message: dict[str, Any]) -> Any:  # noqa: ANN401 - a number or a word
    value: Any = message
    for part in each.at:
        if not isinstance(value, dict) or part not in value:
            raise MalformedError(SchemaError, f"lacks {'.'.join(each.at)}")
        value = value[part]
    return math.nan if value is None and each.nullable else _judged(each, value)


def _judged(each: Field, value: Any) -> Any:  # noqa: ANN401 - a number or a word
    """Return a value that a file holds if it is of its kind, finite and in its range."""
    usual = type(value) is float and each.kind == "float" and math.isfinite(value)
    if usual and each.low <= value <= each.high:
        return value  # nearly every value of a log ends here
    kinds = {"float": (int, float), "int": (int,), "text": (str,)}[each.kind]
    if isinstance(value, float) and not math.isfinite(value):
        raise MalformedError(NotFiniteError, f"{each.column} must be finite, got {value!r}")
    if isinstance(value, bool) or not isinstance(value, kinds):
        raise MalformedError(SchemaError, f"{each.column} must be {each.kind}, got {value!r}")
    if each.kind == "text":
        return value
    if not _finite(value):
        raise MalformedError(NotFiniteError, f"{each.column} must be finite, got {value!r}")
    if not each.low <= value <= each.high:
        raise MalformedError(
            RangeError, f"{each.column} must be {_allowed(each, value)}, got {value!r}"
        )
    return value if each.kind == "int" else float(value)


def _finite(value: float) -> bool:
    try:
        return math.isfinite(value)
    except OverflowError:  # a whole number with more than 308 digits
        return False


def _constant(text: str) -> float:
    """Let NaN and infinity through as numbers: what is wrong with them is said with their name."""
    return float(text.replace("Infinity", "inf"))


_JSON = json.JSONDecoder(parse_constant=_constant)


def _allowed(each: Field, value: float) -> str:
    number = "a whole number" if each.kind == "int" else "finite"
    low, high = each.low > -_WIDE, each.high < _WIDE
    if (low and high) or _WIDE < abs(value) < math.inf:
        return f"{number} in [{each.low:g}, {each.high:g}]"
    return f"{number} of at least {each.low}" if low else number


_WIDE = 1e4  # a limit beyond is only named to those who meet it
