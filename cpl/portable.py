r"""Elementary functions out of + - * / and the square root: the same bits on every machine.

A libm's last bits are its own: they differ between libraries, processors and versions, and a
browser has none to ask. Here every function is evaluated in double-double arithmetic, to about
$10^{-30}$, and rounded once. That takes some hundred operations, so hot loops keep their own
approximations and come here only where those end.

Sums and products with their rounding errors: T. J. Dekker, "A floating-point technique for
extending the available precision", 1971. Nothing here fuses a multiplication with an addition.
"""

from __future__ import annotations

import math
from decimal import Decimal, localcontext
from fractions import Fraction

import numpy as np
from numba import njit

__all__ = ["asin", "atan", "cos", "exp", "log", "power", "sin", "tan"]

_SPLITTER = 134217729.0  # 2^27 + 1 cuts 53 bits into two halves
_PI = "3.14159265358979323846264338327950288419716939937510582097494459230781640628620899"


def _parts(value: Decimal, *bits: int) -> tuple[float, ...]:
    """Cut a number into floats of at most so many bits each, and a last one of 53."""
    found = []
    for width in bits:
        scale = 2 ** (width - 1 - math.frexp(float(value))[1] + 1)
        part = float((value * scale).to_integral_value()) / scale
        found.append(part)
        value -= Decimal(part)
    return (*found, float(value))


def _factorials(count: int) -> tuple[np.ndarray, np.ndarray]:
    """1 / k! for k < count, and what the floats leave."""
    exact = [Fraction(1, math.factorial(k)) for k in range(count)]
    high = np.array([float(x) for x in exact])
    low = np.array([float(x - Fraction(h)) for x, h in zip(exact, high.tolist(), strict=True)])
    return high, low


with localcontext() as _context:
    _context.prec = 80
    _HALF_PI_1, _HALF_PI_2, _HALF_PI_3 = _parts(Decimal(_PI) / 2, 33, 33)
    _LN2_1, _LN2_2, _LN2_3 = _parts(Decimal(2).ln(), 33, 33)
    _HALF_PI, _HALF_PI_REST = _parts(Decimal(_PI) / 2, 53)
_INVERSE, _INVERSE_REST = _factorials(31)
_LOWEST = -1074
_TWO_TO = np.ldexp(1.0, np.arange(_LOWEST, 1024))  # from the smallest power that is a float


@njit(cache=True, error_model="numpy")
def exp(x: float) -> float:
    """Return e to the power x, rounded once.

    Args:
        x: Any number.

    Returns:
        The power; 0 below -745, infinity above 709.78.

    Examples:
        >>> exp(0.0), exp(1.0), exp(-1000.0)
        (1.0, 2.718281828459045, 0.0)
    """
    return _raised(x, 0.0)


@njit(cache=True, error_model="numpy")
def log(x: float) -> float:
    """Return the natural logarithm, rounded once.

    Args:
        x: A positive number.

    Returns:
        The logarithm; minus infinity at 0, NaN below.

    Examples:
        >>> log(1.0), log(10.0)
        (0.0, 2.302585092994046)
    """
    if not x > 0.0:
        return -math.inf if x == 0.0 else math.nan
    high, low = _log(x)
    return high + low


@njit(cache=True, error_model="numpy")
def power(x: float, y: float) -> float:
    """Return x to the power y, rounded once.

    Args:
        x: A number that is not negative.
        y: A positive number.

    Examples:
        >>> power(0.0, 4.0), power(2.0, 10.0), power(2.0, 0.5)
        (0.0, 1024.0, 1.4142135623730951)
    """
    if x == 0.0:
        return 0.0
    high, low = _log(x)
    high, low = _times(high, low, y, 0.0)
    return _raised(high, low)


@njit(cache=True, error_model="numpy")
def sin(x: float) -> float:
    """Return the sine, rounded once.

    Args:
        x: An angle below a million in size [rad]; beyond it NaN is returned.

    Examples:
        >>> sin(0.0), sin(3.0)
        (0.0, 0.1411200080598672)
    """
    s, rest, _c, _ = _circle(x, 0.0)
    return s + rest


@njit(cache=True, error_model="numpy")
def cos(x: float) -> float:
    """Return the cosine, rounded once; as `sin`.

    Examples:
        >>> cos(0.0), cos(3.0)
        (1.0, -0.9899924966004454)
    """
    _s, _, c, rest = _circle(x, 0.0)
    return c + rest


@njit(cache=True, error_model="numpy")
def tan(x: float) -> float:
    """Return the tangent, rounded once; as `sin`.

    Examples:
        >>> tan(0.0), tan(3.0)
        (0.0, -0.1425465430742778)
    """
    s, s_rest, c, c_rest = _circle(x, 0.0)
    high, low = _over(s, s_rest, c, c_rest)
    return high + low


@njit(cache=True, error_model="numpy")
def atan(x: float) -> float:
    """Return the angle whose tangent is x, rounded once.

    Examples:
        >>> atan(0.0), atan(1.0)
        (0.0, 0.7853981633974483)
    """
    size = abs(x)
    if size > 1e17:
        return math.copysign(_HALF_PI, x)
    near = _about_atan(size) if size <= 1.0 else _HALF_PI - _about_atan(1.0 / size)
    s, s_rest, c, c_rest = _circle(near, 0.0)
    over, over_rest = _times(c, c_rest, size, 0.0)
    over, over_rest = _plus(over, over_rest, -s, -s_rest)
    return math.copysign(near + (over + over_rest) / (c + size * s), x)


@njit(cache=True, error_model="numpy")
def asin(x: float) -> float:
    """Return the angle whose sine is x, rounded once; NaN beyond 1.

    Examples:
        >>> asin(0.0), asin(1.0), asin(0.6)
        (0.0, 1.5707963267948966, 0.6435011087932844)
    """
    size = abs(x)
    if size > 1.0:
        return math.nan
    if size <= 0.5:
        high, low = _asin(size, 0.0)
        return math.copysign(high + low, x)
    root, rest = _root(0.5 * (1.0 - size))  # asin x = pi/2 - 2 asin sqrt((1 - x) / 2)
    high, low = _asin(root, rest)
    high, low = _plus(_HALF_PI, _HALF_PI_REST, -2.0 * high, -2.0 * low)
    return math.copysign(high + low, x)


@njit(cache=True, error_model="numpy")
def _sum(a: float, b: float) -> tuple[float, float]:
    total = a + b
    part = total - a
    return total, (a - (total - part)) + (b - part)


@njit(cache=True, error_model="numpy")
def _product(a: float, b: float) -> tuple[float, float]:
    total = a * b
    cut = _SPLITTER * a
    a_high = cut - (cut - a)
    a_low = a - a_high
    cut = _SPLITTER * b
    b_high = cut - (cut - b)
    b_low = b - b_high
    return total, ((a_high * b_high - total) + a_high * b_low + a_low * b_high) + a_low * b_low


@njit(cache=True, error_model="numpy")
def _plus(a: float, a_rest: float, b: float, b_rest: float) -> tuple[float, float]:
    total, rest = _sum(a, b)
    small, less = _sum(a_rest, b_rest)
    total, rest = _sum(total, rest + small)
    return _sum(total, rest + less)


@njit(cache=True, error_model="numpy")
def _times(a: float, a_rest: float, b: float, b_rest: float) -> tuple[float, float]:
    total, rest = _product(a, b)
    return _sum(total, rest + (a * b_rest + a_rest * b))


@njit(cache=True, error_model="numpy")
def _over(a: float, a_rest: float, b: float, b_rest: float) -> tuple[float, float]:
    total = a / b
    back, back_rest = _times(b, b_rest, total, 0.0)
    left, left_rest = _plus(a, a_rest, -back, -back_rest)
    return _sum(total, (left + left_rest) / b)


@njit(cache=True, error_model="numpy")
def _root(a: float) -> tuple[float, float]:
    if a == 0.0:
        return 0.0, 0.0
    total = math.sqrt(a)
    square, rest = _product(total, total)
    return total, ((a - square) - rest) / (2.0 * total)


@njit(cache=True, error_model="numpy")
def _reduced(
    x: float, x_rest: float, steps: float, one: float, two: float, three: float
) -> tuple[float, float]:
    """X less so many steps of one + two + three, whose first two parts have room for the factor."""
    high, low = _sum(x, -steps * one)
    high, low = _plus(high, low, -steps * two, x_rest)
    last, rest = _product(steps, three)
    return _plus(high, low, -last, -rest)


@njit(cache=True, error_model="numpy")
def _circle(x: float, x_rest: float) -> tuple[float, float, float, float]:
    """Sine and cosine, each with its rest."""
    if not abs(x) < 1e6:
        return math.nan, 0.0, math.nan, 0.0
    turns = np.rint(x / _HALF_PI)
    r, rest = _reduced(x, x_rest, turns, _HALF_PI_1, _HALF_PI_2, _HALF_PI_3)
    z, z_rest = _times(r, rest, r, rest)
    s, s_rest, c, c_rest = 0.0, 0.0, 0.0, 0.0
    for k in range(14, -1, -1):
        sign = 1.0 if k % 2 == 0 else -1.0
        s, s_rest = _times(s, s_rest, z, z_rest)
        s, s_rest = _plus(s, s_rest, sign * _INVERSE[2 * k + 1], sign * _INVERSE_REST[2 * k + 1])
        c, c_rest = _times(c, c_rest, z, z_rest)
        c, c_rest = _plus(c, c_rest, sign * _INVERSE[2 * k], sign * _INVERSE_REST[2 * k])
    s, s_rest = _times(s, s_rest, r, rest)
    quarter = turns - 4.0 * np.floor(0.25 * turns)
    if quarter == 0.0:
        return s, s_rest, c, c_rest
    if quarter == 1.0:
        return c, c_rest, -s, -s_rest
    if quarter == 2.0:
        return -s, -s_rest, -c, -c_rest
    return -c, -c_rest, s, s_rest


@njit(cache=True, error_model="numpy")
def _about_atan(x: float) -> float:
    """Atan of [0, 1] to some 1e-16: two half angles, then the series."""
    x = x / (1.0 + math.sqrt(1.0 + x * x))
    x = x / (1.0 + math.sqrt(1.0 + x * x))
    z = x * x
    total = 0.0
    for k in range(12, -1, -1):
        total = (1.0 if k % 2 == 0 else -1.0) / (2 * k + 1) + z * total
    return 4.0 * x * total


@njit(cache=True, error_model="numpy")
def _asin(x: float, rest: float) -> tuple[float, float]:
    """Asin of [0, 0.71] by one step of Newton's method."""
    near = _about_atan(x / math.sqrt((1.0 - x) * (1.0 + x)))
    s, s_rest, c, _ = _circle(near, 0.0)
    left, left_rest = _plus(x, rest, -s, -s_rest)
    return _sum(near, (left + left_rest) / c)


@njit(cache=True, error_model="numpy")
def _raised(x: float, rest: float) -> float:
    """E to the power x + rest."""
    if x > 709.8:
        return math.inf
    if not x > -745.2:
        return x if x != x else 0.0
    steps = np.rint(x / _LN2)
    r, rest = _reduced(x, rest, steps, _LN2_1, _LN2_2, _LN2_3)
    high, low = 0.0, 0.0
    for k in range(26, -1, -1):
        high, low = _times(high, low, r, rest)
        high, low = _plus(high, low, _INVERSE[k], _INVERSE_REST[k])
    value = high + low
    if steps > 1023.0:
        return value * 2.0 * _TWO_TO[-1]
    if steps < -1021.0:
        return value * _TWO_TO[int(steps) + 100 - _LOWEST] * _TWO_TO[-100 - _LOWEST]
    return value * _TWO_TO[int(steps) - _LOWEST]


_LN2 = math.log(2.0)


@njit(cache=True, error_model="numpy")
def _log(x: float) -> tuple[float, float]:
    below, above = 0, _TWO_TO.size
    while above - below > 1:
        middle = (below + above) // 2
        if _TWO_TO[middle] <= x:
            below = middle
        else:
            above = middle
    if _TWO_TO[below] * 1.4142135623730951 < x and below + 1 < _TWO_TO.size:
        below += 1
    steps = float(below + _LOWEST)
    m = x / _TWO_TO[below]
    t = (m - 1.0) / (m + 1.0)
    z = t * t
    near = 0.0
    for k in range(11, -1, -1):
        near = 1.0 / (2 * k + 1) + z * near
    near *= 2.0 * t
    # log m = near + log(m exp(-near)), whose argument is 1 but for the error of `near`
    high, low = 0.0, 0.0
    for k in range(26, -1, -1):
        high, low = _times(high, low, -near, 0.0)
        high, low = _plus(high, low, _INVERSE[k], _INVERSE_REST[k])
    high, low = _times(high, low, m, 0.0)
    off, off_rest = _plus(high, low, -1.0, 0.0)
    high, low = _sum(near, off + off_rest)
    last, rest = _product(steps, _LN2_3)
    high, low = _plus(high, low, last, rest)
    high, low = _plus(high, low, steps * _LN2_2, 0.0)
    return _plus(high, low, steps * _LN2_1, 0.0)
