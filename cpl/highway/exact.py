"""libm's results, bit for bit, without calling libm in all but a few cases.

Each function evaluates f(x) to well under 0.01 ulp as a sum value + rest, and rounds it. libm's own
result is the rounding of something within a known fraction of an ulp of the true one; where every
number within that fraction rounds alike, both agree, and where not (or outside the fitted range)
libm is called. Arrays are taken in blocks of eight so that they become vector instructions.

There are three arithmetics. LIBM asks libm always, FAST where its result is in doubt, as above, and
OWN never: it keeps the rounded sum, which the same operations give on every machine and in a
browser, and which differs from libm's where libm rounds the other way, in the last bit.

Nothing is copied from a libm: coefficients are fits to the functions, and the tables of the
logarithm and the exponential are computed here in decimal arithmetic. The scheme of the power, one
table for the logarithm and one for the exponential, is that of ARM's optimized-routines (MIT).
"""

from __future__ import annotations

import math
from decimal import Decimal, localcontext
from fractions import Fraction

import numpy as np

from cpl import portable
from cpl.highway._compile import bits_of, float_of, fma, inlined, kernel

__all__ = [
    "BLOCK",
    "FAST",
    "LIBM",
    "OWN",
    "asin_all",
    "atan_all",
    "cos_all",
    "padded",
    "pow_all",
    "pow_one",
    "sin_all",
    "tan_all",
]

LIBM, FAST, OWN = 0, 1, 2
"""The arithmetics. A number in doubt is marked 1 and one out of range 2: each of FAST and OWN asks
again for what is marked by at least its own number."""

BLOCK = 8
"""Arrays are padded to, and worked through in, this many numbers."""

_ULP = 2.0**-52
# How far, in ulp, libm's result may be from the true value beyond the half ulp of its rounding:
# (at |x| below 0.001, below a bound, above it). glibc documents at most 0.016 for asin, 0.06 for
# atan, 0.12 for tan, 0.05 for sin and cos and 0.02 for pow; these are twice the largest ever seen,
# near zero, in its polynomial range and in its table range (tests/highway/test_exact.py looks).
_SLACK_ASIN = (0.0005 * _ULP, 0.001, 0.03 * _ULP, 0.03 * _ULP)
_SLACK_TAN = (0.0005 * _ULP, 0.06, 0.005 * _ULP, 0.12 * _ULP)
_SLACK_ATAN = (0.0005 * _ULP, 0.0625, 0.005 * _ULP, 0.04 * _ULP)
_SLACK_SIN = (0.0005 * _ULP, 0.125, 0.012 * _ULP, 0.035 * _ULP)
_SLACK_COS = 0.01 * _ULP / 2  # the cosine lies below 1
_SLACK_POW = 0.03 * _ULP

_EXPONENT = np.int64(0x7FF0000000000000)
_SIXTH = 1.0 / 6.0
_SIXTH_REST = float(Fraction(1, 6) - Fraction(_SIXTH))
_THIRD = 1.0 / 3.0
_THIRD_REST = float(Fraction(1, 3) - Fraction(_THIRD))

_ASIN_TOP = 0.35
_TAN_TOP = 0.35
_ATAN_TOP = 0.4
_POW_LOW, _POW_HIGH, _POW_TOP = 1e-15, 1e15, 17.0  # x and y; the result is then far from both ends
_SIN_TOP = 0.5


@inlined
def padded(count: int) -> int:
    """Round a count up to whole blocks."""
    return (count + (BLOCK - 1)) // BLOCK * BLOCK


@inlined
def _odd(x: float, third: float, third_rest: float, tail: float, slack: tuple) -> tuple:
    """Round x + third x^3 + tail x^5; returns (value, whether it may differ from libm's)."""
    z = x * x
    cube = x * z
    cube_rest = fma(x, z, -cube) + x * fma(x, x, -z)
    step = third * cube
    step_rest = fma(third, cube, -step) + fma(third, cube_rest, third_rest * cube)
    total = x + step
    rest = ((x - total) + step) + (step_rest + tail * (cube * z))
    power_of_two = float_of(bits_of(total) & _EXPONENT)
    size = abs(x)
    bound = power_of_two * (slack[2] if size < slack[1] else slack[3])
    bound = power_of_two * slack[0] if size < 0.001 else bound
    return total + rest, (total + (rest - bound)) != (total + (rest + bound))


@inlined
def _asin(x: float) -> tuple:
    z = x * x
    p = fma(z, 0.011454697354229418, 0.004373422365719336)
    p = fma(z, p, 0.007718983468189416)
    p = fma(z, p, 0.008341023112904588)
    p = fma(z, p, 0.00976551315655834)
    p = fma(z, p, 0.011551596227757427)
    p = fma(z, p, 0.013964850781018058)
    p = fma(z, p, 0.017352764270462548)
    p = fma(z, p, 0.022372159092858692)
    p = fma(z, p, 0.030381944444431604)
    p = fma(z, p, 0.04464285714285718)
    p = fma(z, p, 0.075)
    return _odd(x, _SIXTH, _SIXTH_REST, p, _SLACK_ASIN)


@inlined
def _tan(x: float) -> tuple:
    z = x * x
    p = fma(z, 5.058540668760024e-05, 9.383092399610528e-05)
    p = fma(z, p, 0.0002395839350182225)
    p = fma(z, p, 0.0005899872981868594)
    p = fma(z, p, 0.0014558365692320366)
    p = fma(z, p, 0.003592127964564131)
    p = fma(z, p, 0.008863235531264385)
    p = fma(z, p, 0.021869488536142134)
    p = fma(z, p, 0.05396825396825402)
    p = fma(z, p, 0.13333333333333333)
    return _odd(x, _THIRD, _THIRD_REST, p, _SLACK_TAN)


@inlined
def _atan(x: float) -> tuple:
    z = x * x
    p = fma(z, 0.018498407939328942, -0.03648583212093108)
    p = fma(z, p, 0.04623014269511802)
    p = fma(z, p, -0.0524546261879911)
    p = fma(z, p, 0.058808807109964285)
    p = fma(z, p, -0.06666587253737737)
    p = fma(z, p, 0.07692305005634716)
    p = fma(z, p, -0.09090909037659843)
    p = fma(z, p, 0.11111111110568123)
    p = fma(z, p, -0.1428571428571212)
    p = fma(z, p, 0.19999999999999998)
    return _odd(x, -_THIRD, -_THIRD_REST, p, _SLACK_ATAN)


@inlined
def _sin(x: float) -> tuple:
    z = x * x
    p = fma(z, -7.626106676263415e-13, 1.605898464010602e-10)
    p = fma(z, p, -2.5052108308721172e-08)
    p = fma(z, p, 2.755731922394094e-06)
    p = fma(z, p, -0.0001984126984126983)
    p = fma(z, p, 0.008333333333333333)
    return _odd(x, -_SIXTH, -_SIXTH_REST, p, _SLACK_SIN)


@inlined
def _cos(x: float) -> tuple:
    z = x * x
    p = fma(z, -1.1434954373030563e-11, 2.087665637492332e-09)
    p = fma(z, p, -2.755731909359198e-07)
    p = fma(z, p, 2.480158730151091e-05)
    p = fma(z, p, -0.0013888888888888872)
    p = fma(z, p, 0.041666666666666664)
    half = 0.5 * z
    total = 1.0 - half
    rest = ((1.0 - total) - half) + fma(z * z, p, -0.5 * fma(x, x, -z))
    return total + rest, (total + (rest - _SLACK_COS)) != (total + (rest + _SLACK_COS))


@inlined
def asin_all(x: np.ndarray, out: np.ndarray, doubt: np.ndarray, count: int, path: int) -> None:
    """Write asin of x[:count]; x, out and doubt are padded to whole blocks."""
    if path == LIBM:
        for k in range(count):
            out[k] = math.asin(x[k])
        return
    for k in range(padded(count)):
        value, doubtful = _asin(x[k])
        out[k] = value
        doubt[k] = 2 if abs(x[k]) > _ASIN_TOP else 1 if doubtful else 0
    for k in range(count):
        if doubt[k] >= path:
            out[k] = math.asin(x[k]) if path == FAST else portable.asin(x[k])


@inlined
def tan_all(x: np.ndarray, out: np.ndarray, doubt: np.ndarray, count: int, path: int) -> None:
    """Write tan of x[:count]; x, out and doubt are padded to whole blocks."""
    if path == LIBM:
        for k in range(count):
            out[k] = math.tan(x[k])
        return
    for k in range(padded(count)):
        value, doubtful = _tan(x[k])
        out[k] = value
        doubt[k] = 2 if abs(x[k]) > _TAN_TOP else 1 if doubtful else 0
    for k in range(count):
        if doubt[k] >= path:
            out[k] = math.tan(x[k]) if path == FAST else portable.tan(x[k])


@inlined
def atan_all(x: np.ndarray, out: np.ndarray, doubt: np.ndarray, count: int, path: int) -> None:
    """Write atan of x[:count]; x, out and doubt are padded to whole blocks."""
    if path == LIBM:
        for k in range(count):
            out[k] = math.atan(x[k])
        return
    for k in range(padded(count)):
        value, doubtful = _atan(x[k])
        out[k] = value
        doubt[k] = 2 if abs(x[k]) > _ATAN_TOP else 1 if doubtful else 0
    for k in range(count):
        if doubt[k] >= path:
            out[k] = math.atan(x[k]) if path == FAST else portable.atan(x[k])


@inlined
def sin_all(x: np.ndarray, out: np.ndarray, doubt: np.ndarray, count: int, path: int) -> None:
    """Write sin of x[:count]; x, out and doubt are padded to whole blocks."""
    if path == LIBM:
        for k in range(count):
            out[k] = math.sin(x[k])
        return
    for k in range(padded(count)):
        value, doubtful = _sin(x[k])
        out[k] = value
        doubt[k] = 2 if abs(x[k]) > _SIN_TOP else 1 if doubtful else 0
    for k in range(count):
        if doubt[k] >= path:
            out[k] = math.sin(x[k]) if path == FAST else portable.sin(x[k])


@inlined
def cos_all(x: np.ndarray, out: np.ndarray, doubt: np.ndarray, count: int, path: int) -> None:
    """Write cos of x[:count]; x, out and doubt are padded to whole blocks."""
    if path == LIBM:
        for k in range(count):
            out[k] = math.cos(x[k])
        return
    for k in range(padded(count)):
        value, doubtful = _cos(x[k])
        out[k] = value
        doubt[k] = 2 if abs(x[k]) > _SIN_TOP else 1 if doubtful else 0
    for k in range(count):
        if doubt[k] >= path:
            out[k] = math.cos(x[k]) if path == FAST else portable.cos(x[k])


def _log_table() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """1/c, -log(1/c) and its rest, for 128 intervals of z in [0.6875, 1.375)."""
    inverse, high, low = np.empty(128), np.empty(128), np.empty(128)
    with localcontext() as context:
        context.prec = 60
        for i in range(128):
            bits = int(_OFFSET) + ((i << 45) | (1 << 44))
            centre = float(np.uint64(bits).view(np.float64))
            # Few bits, so that z / c - 1 comes out of one fused operation exactly.
            inverse[i] = 1.0 if abs(centre - 1) < 2**-8 else round(512 / centre) / 512
            log = -Decimal(float(inverse[i])).ln()
            # The high part keeps room for adding k log 2 without rounding.
            high[i] = math.ldexp(float((log * 2**42).to_integral_value()), -42)
            low[i] = float(log - Decimal(float(high[i])))
    return inverse, high, low


def _exp_table() -> tuple[np.ndarray, np.ndarray]:
    """Bits of 2^(i/128) with its exponent taken off by i / 128, and the relative rest."""
    bits, rest = np.empty(128, np.int64), np.empty(128)
    with localcontext() as context:
        context.prec = 60
        for i in range(128):
            exact = (Decimal(2).ln() * i / 128).exp()
            nearest = float(exact)
            bits[i] = np.float64(nearest).view(np.int64) - (i << 45)
            rest[i] = float(exact / Decimal(nearest) - 1)
    return bits, rest


_OFFSET = np.int64(0x3FE6000000000000)  # bits of 0.6875, where the logarithm's intervals begin
_MANTISSA = np.int64(0x000FFFFFFFFFFFFF)
_LOG_INVERSE, _LOG_HIGH, _LOG_LOW = _log_table()
_EXP_BITS, _EXP_REST = _exp_table()
with localcontext() as _context:
    _context.prec = 60
    _LN2 = Decimal(2).ln()
    _LN2_HIGH = math.ldexp(float((_LN2 * 2**42).to_integral_value()), -42)
    _LN2_LOW = float(_LN2 - Decimal(_LN2_HIGH))
    _STEP_HIGH = math.ldexp(float((_LN2 * 2**35).to_integral_value()), -42)
    _STEP_LOW = float(_LN2 / 128 - Decimal(_STEP_HIGH))
    _PER_STEP = float(128 / _LN2)
_ROUNDER = 6755399441055744.0  # 1.5 2^52: adding it rounds to an integer
_ROUNDER_BITS = int(np.float64(_ROUNDER).view(np.int64))


@inlined
def _pow(x: float, y: float) -> tuple:
    """Round x^y for 2^-60 < x < 2^60; returns (value, whether it may differ from libm's)."""
    bits = bits_of(x)
    above = bits - _OFFSET
    i = (above >> 45) & 127
    k = above >> 52
    z = float_of(bits - (k << 52))
    r = fma(z, _LOG_INVERSE[i], -1.0)
    scale_k = float(k)
    # log x = k log 2 - log(1/c) + log1p(r), as high + low
    t1 = fma(scale_k, _LN2_HIGH, _LOG_HIGH[i])
    t2 = t1 + r
    half = -0.5 * r
    square = r * half
    high = t2 + square
    low = fma(scale_k, _LN2_LOW, _LOG_LOW[i]) + (t1 - t2 + r)
    low = low + fma(half, r, -square) + (t2 - high + square)
    q = fma(r, fma(r, fma(r, fma(r, -1 / 8, 1 / 7), -1 / 6), 1 / 5), -1 / 4)
    low = low + (r * r) * r * fma(r, q, 1 / 3)
    log = high + low
    low = high - log + low
    # x^y = exp(y log x)
    product = y * log
    product_low = fma(y, low, fma(y, log, -product))
    rounded = fma(product, _PER_STEP, _ROUNDER)
    step = bits_of(rounded) - _ROUNDER_BITS
    steps = rounded - _ROUNDER
    r = fma(-steps, _STEP_LOW, fma(-steps, _STEP_HIGH, product)) + product_low
    j = step & 127
    scale = float_of(_EXP_BITS[j] + (step << 45))
    square = r * r
    tail = fma(square, fma(r, fma(r, 1 / 120, 1 / 24), 1 / 6), 0.5 * r)
    tail = _EXP_REST[j] + fma(r, tail, r)
    bound = float_of(bits_of(scale) & _EXPONENT) * _SLACK_POW
    rest = scale * tail
    unsure = (scale + (rest - bound)) != (scale + (rest + bound))
    return scale + rest, unsure


@kernel
def pow_all(
    x: np.ndarray, y: np.ndarray, out: np.ndarray, doubt: np.ndarray, count: int, path: int
) -> None:
    """Write x[:count] ** y[:count], x >= 0; arrays are padded to whole blocks."""
    if path == LIBM:
        for k in range(count):
            out[k] = math.pow(x[k], y[k])
        return
    for k in range(padded(count)):
        value, doubtful = _pow(x[k], y[k])
        out[k] = value
        outside = (x[k] < _POW_LOW) | (x[k] > _POW_HIGH) | (y[k] > _POW_TOP)
        doubt[k] = 2 if outside else 1 if doubtful else 0
    for k in range(count):
        if doubt[k] >= path:
            out[k] = math.pow(x[k], y[k]) if path == FAST else portable.power(x[k], y[k])


@inlined
def pow_one(x: float, y: float, path: int) -> float:
    """Return x ** y, x >= 0: libm's, or the OWN arithmetic's."""
    if path != OWN:
        return math.pow(x, y)
    if (x < _POW_LOW) | (x > _POW_HIGH) | (y > _POW_TOP):
        return portable.power(x, y)
    value, _ = _pow(x, y)
    return value
