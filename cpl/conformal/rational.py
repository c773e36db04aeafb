"""Exact numbers: how every bound in this room reads its arguments.

A bound such as `ceil(alpha * W + B / eta)` jumps where its argument is an integer, and the paper's
own settings sit on those jumps: with `alpha = 0.1`, `eta = 0.1`, `B = 1`, `W = 40` the argument is
exactly 14, while floating point may well say 14.000000000000002 and round up to 15. So arguments
are read exactly, computed with exactly, and rounded at most once, at the very end.
"""

from __future__ import annotations

import math
import numbers
from fractions import Fraction
from typing import SupportsFloat

__all__ = ["Number", "count", "level", "like", "positive", "rational"]

Number = int | float | Fraction
"""What a public function accepts for a real number (NumPy scalars too)."""


def rational(value: Number | SupportsFloat, name: str = "value") -> Fraction:
    """Return a number as an exact fraction; a float is read as the decimal that it prints as.

    `0.1` therefore means one tenth, and not the nearest binary fraction, which is a little more.
    Numbers without a short decimal, such as a third, should be given as a `Fraction`.

    Args:
        value: an integer, a finite float (NumPy's too) or a fraction.
        name: what the number is called in an error message.

    Raises:
        ValueError: if the value is not a finite real number.

    Examples:
        >>> rational(0.1), rational(3), rational(Fraction(1, 3))
        (Fraction(1, 10), Fraction(3, 1), Fraction(1, 3))
    """
    if isinstance(value, bool):
        msg = f"{name} must be a number, got {value!r}"
        raise ValueError(msg)
    if isinstance(value, numbers.Rational):
        return Fraction(int(value.numerator), int(value.denominator))
    try:
        number = float(value)
    except (TypeError, ValueError) as error:
        msg = f"{name} must be a number, got {value!r}"
        raise ValueError(msg) from error
    if not math.isfinite(number):
        msg = f"{name} must be finite, got {value!r}"
        raise ValueError(msg)
    # A NumPy float32 prints as 0.1 too, but float(value) would not: let it print itself.
    return Fraction(repr(number) if isinstance(value, float) else str(value))


def positive(value: Number, name: str) -> Fraction:
    """Return a number > 0 as an exact fraction.

    Raises:
        ValueError: naming the argument and its value, if it is not a finite number > 0.

    Examples:
        >>> positive(0.05, "eta")
        Fraction(1, 20)
    """
    number = rational(value, name)
    if number <= 0:
        msg = f"{name} must be > 0, got {value!r}"
        raise ValueError(msg)
    return number


def level(alpha: Number) -> Fraction:
    """Return a miscoverage level `0 < alpha < 1` as an exact fraction.

    Raises:
        ValueError: if `alpha` lies outside the open interval (0, 1).

    Examples:
        >>> level(0.1)
        Fraction(1, 10)
    """
    number = rational(alpha, "alpha")
    if not 0 < number < 1:
        msg = f"alpha must lie in (0, 1), got {alpha!r}"
        raise ValueError(msg)
    return number


def count(value: int, name: str, *, least: int = 1) -> int:
    """Return an integer `>= least`: a window length, a delay, a number of steps.

    Raises:
        ValueError: naming the argument and its value, if it is not such an integer.

    Examples:
        >>> count(40, "W")
        40
    """
    if isinstance(value, bool) or not isinstance(value, numbers.Integral) or value < least:
        msg = f"{name} must be an integer >= {least}, got {value!r}"
        raise ValueError(msg)
    return int(value)


def like(value: Fraction, *inputs: Number) -> float | Fraction:
    """Return an exact result in the kind of its inputs: a float as soon as one of them is a float.

    Exact in, exact out; with floats, the exact result rounded once.

    Examples:
        >>> like(Fraction(3, 8), 0.1, 40), like(Fraction(3, 8), Fraction(1, 10), 40)
        (0.375, Fraction(3, 8))
    """
    if all(isinstance(number, numbers.Rational) for number in inputs):
        return value
    return float(value)
