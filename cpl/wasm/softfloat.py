"""What WebAssembly's processor does not have: a fused multiply-add, and the remainder of floats."""

from typing import Any

from numba import njit

from cpl.highway.exact import bits_of, float_of

__all__ = ["fused", "remainder"]

_OPTIONS: dict[str, Any] = {"_nrt": False, "error_model": "numpy", "forceinline": True}
_SPLITTER = 134217729.0  # 2^27 + 1


@njit(**_OPTIONS)
def fused(a: float, b: float, c: float) -> float:
    r"""Return a b + c, rounded once, without an instruction that does it.

    The exact sum of three floats is rounded to odd before it is rounded to nearest: S. Boldo,
    G. Melquiond, "Emulation of FMA and correctly rounded sums", 2008. Exact unless the product's
    rounding error is below the smallest float; where the splitting overflows, a b + c is returned.

    Examples:
        >>> fused(1.0 + 2.0**-30, 1.0 + 2.0**-30, -1.0 - 2.0**-29) == 2.0**-60
        True
    """
    product = a * b
    cut = _SPLITTER * a
    a_high = cut - (cut - a)
    a_low = a - a_high
    cut = _SPLITTER * b
    b_high = cut - (cut - b)
    b_low = b - b_high
    rest = ((a_high * b_high - product) + a_high * b_low + a_low * b_high) + a_low * b_low
    low, low_rest = _sum(c, rest)
    high, high_rest = _sum(product, low)
    tail, lost = _sum(low_rest, high_rest)
    bits = bits_of(tail)
    away = (lost > 0.0) == (tail > 0.0)
    even = (lost != 0.0) & (bits & 1 == 0)
    odd = float_of(bits + ((1 if away else -1) if even else 0))
    total = high + odd
    return total if total == total else product + c


@njit(**_OPTIONS)
def remainder(a: float, b: float) -> float:
    """Return what C's fmod returns for b > 0, exactly, by long division.

    Examples:
        >>> remainder(7.5, 2.0), remainder(-7.5, 2.0)
        (1.5, -1.5)
    """
    left = abs(a)
    while left >= b:
        part = b
        while part * 2.0 <= left:
            part *= 2.0
        left -= part
    return -left if a < 0.0 else left


@njit(**_OPTIONS)
def _sum(a: float, b: float) -> tuple[float, float]:
    total = a + b
    part = total - a
    return total, (a - (total - part)) + (b - part)
