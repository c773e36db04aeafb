"""Random numbers, bit for bit numpy's: SeedSequence, PCG64, uniform and bounded integers.

A generator is six uint64: state (high, low), increment (high, low), whether half of a 64-bit draw
is kept for the next 32-bit one, and that half. The kept half outlives an episode: 51 lanes drawn in
a reset leave one, so that an unseeded reset continues in the middle of a draw, as numpy does.

Algorithms: M. E. O'Neill, "PCG", 2014 (XSL-RR 128/64); "Developing a seed_seq alternative", 2015;
D. Lemire, "Fast random integer generation in an interval", 2019.
"""

from __future__ import annotations

import math

import numpy as np

from cpl import portable
from cpl.highway._compile import inner, kernel

__all__ = ["bounded", "normal", "seed_many", "shuffled_place", "uniform"]

_U = np.uint64
_LOW32 = _U(0xFFFFFFFF)
_B32 = _U(32)
_B16 = _U(16)
_MULTIPLIER_HIGH = _U(0x2360ED051FC65DA4)
_MULTIPLIER_LOW = _U(0x4385DF649FCCF645)
_ONE = _U(1)
_B63 = _U(63)
_B58 = _U(58)
_B64 = _U(64)
_B11 = _U(11)
_ZERO = _U(0)
_INIT_A = _U(0x43B0D7E5)
_MULT_A = _U(0x931E8875)
_INIT_B = _U(0x8B51F9DD)
_MULT_B = _U(0x58F38DED)
_MIX_L = _U(0xCA01F9DD)
_MIX_R = _U(0x4973F715)


@kernel
def uniform(g: np.ndarray, low: float, span: float) -> float:
    """Draw numpy's `Generator.uniform(low, low + span)`."""
    return low + span * ((_next64(g) >> _B11) * (1.0 / 9007199254740992.0))


@kernel
def bounded(g: np.ndarray, count: int) -> np.int64:
    """Draw numpy's `Generator.choice(count)`: nothing is drawn for a single choice."""
    if count == 1:
        return np.int64(0)
    n = _U(count)
    m = _next32(g) * n
    if (m & _LOW32) < n:
        threshold = ((_LOW32 + _ONE) - n) % n
        while (m & _LOW32) < threshold:
            m = _next32(g) * n
    return np.int64(m >> _B32)


@inner
def shuffled_place(g: np.ndarray, top: int) -> np.int64:
    """Draw the place in [0, top] that numpy's `shuffle` swaps place top with (by rejection)."""
    mask = _ONE
    while mask < _U(top):
        mask = (mask << _ONE) | _ONE
    place = _next32(g) & mask
    while place > _U(top):
        place = _next32(g) & mask
    return np.int64(place)


@inner
def normal(g: np.ndarray) -> float:
    """Draw a standard normal number (Box-Muller; the project's own stream, not numpy's)."""
    radius = math.sqrt(-2.0 * portable.log(1.0 - uniform(g, 0.0, 1.0)))
    return radius * portable.cos(2.0 * math.pi * uniform(g, 0.0, 1.0))


@kernel
def seed_many(generators: np.ndarray, seeds: np.ndarray, chosen: np.ndarray, key: int) -> None:
    """Seed generators as `PCG64(SeedSequence(seed))`, or with a spawn key when key >= 0.

    Args:
        generators: uint64 (n, 6), written where chosen.
        seeds: uint64 (n,).
        chosen: bool (n,).
        key: Spawn key below 2**32, -1 for none.
    """
    for e in range(generators.shape[0]):
        if chosen[e]:
            _seed(generators[e], seeds[e], key)


@inner
def _seed(g: np.ndarray, seed: np.uint64, key: int) -> None:
    const = _INIT_A
    a, const = _hashmix(seed & _LOW32, const)
    b, const = _hashmix(seed >> _B32, const)
    c, const = _hashmix(_ZERO, const)
    d, const = _hashmix(_ZERO, const)
    # The pool mixes every word into every other one, in this order.
    for source in range(4):
        for target in range(4):
            if source != target:
                word = a if source == 0 else b if source == 1 else c if source == 2 else d
                word, const = _hashmix(word, const)
                if target == 0:
                    a = _mix(a, word)
                elif target == 1:
                    b = _mix(b, word)
                elif target == 2:
                    c = _mix(c, word)
                else:
                    d = _mix(d, word)
    if key >= 0:
        word, const = _hashmix(_U(key), const)
        a = _mix(a, word)
        word, const = _hashmix(_U(key), const)
        b = _mix(b, word)
        word, const = _hashmix(_U(key), const)
        c = _mix(c, word)
        word, const = _hashmix(_U(key), const)
        d = _mix(d, word)
    const = _INIT_B
    for k in range(4):
        low = a if k % 2 == 0 else c
        high = b if k % 2 == 0 else d
        low, const = _generate(low, const)
        high, const = _generate(high, const)
        g[k] = (high << _B32) | low
    state_high, state_low, inc_high, inc_low = g[0], g[1], g[2], g[3]
    g[2] = (inc_high << _ONE) | (inc_low >> _B63)
    g[3] = (inc_low << _ONE) | _ONE
    g[0] = g[2]  # one step from state zero
    g[1] = g[3]
    low = g[1] + state_low
    g[0] = g[0] + state_high + (_ONE if low < state_low else _ZERO)
    g[1] = low
    _advance(g)
    g[4] = _ZERO
    g[5] = _ZERO


@inner
def _hashmix(value: np.uint64, const: np.uint64) -> tuple:
    value = (value ^ const) & _LOW32
    const = (const * _MULT_A) & _LOW32
    value = (value * const) & _LOW32
    return value ^ (value >> _B16), const


@inner
def _mix(x: np.uint64, y: np.uint64) -> np.uint64:
    value = (_MIX_L * x - _MIX_R * y) & _LOW32
    return value ^ (value >> _B16)


@inner
def _generate(value: np.uint64, const: np.uint64) -> tuple:
    value = value ^ const
    const = (const * _MULT_B) & _LOW32
    value = (value * const) & _LOW32
    return value ^ (value >> _B16), const


@inner
def _next32(g: np.ndarray) -> np.uint64:
    if g[4]:
        g[4] = _ZERO
        return g[5]
    value = _next64(g)
    g[4] = _ONE
    g[5] = value >> _B32
    return value & _LOW32


@inner
def _next64(g: np.ndarray) -> np.uint64:
    _advance(g)
    turn = g[0] >> _B58
    value = g[0] ^ g[1]
    return (value >> turn) | (value << ((_B64 - turn) & _B63))


@inner
def _advance(g: np.ndarray) -> None:
    high, low = g[0], g[1]
    # 128-bit product of state and multiplier out of 32-bit limbs
    a0, a1 = low & _LOW32, low >> _B32
    b0, b1 = _MULTIPLIER_LOW & _LOW32, _MULTIPLIER_LOW >> _B32
    p00, p01, p10 = a0 * b0, a0 * b1, a1 * b0
    middle = (p00 >> _B32) + (p01 & _LOW32) + (p10 & _LOW32)
    carry = a1 * b1 + (p01 >> _B32) + (p10 >> _B32) + (middle >> _B32)
    high = high * _MULTIPLIER_LOW + low * _MULTIPLIER_HIGH + carry
    low = low * _MULTIPLIER_LOW
    g[1] = low + g[3]
    g[0] = high + g[2] + (_ONE if g[1] < low else _ZERO)
