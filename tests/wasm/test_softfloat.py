"""The fused multiply-add in software against the processor's, and the remainder against C's."""

import math

import numpy as np

from cpl.highway._compile import fma, kernel
from cpl.wasm.softfloat import fused, remainder

SIZE = 200_000


@kernel
def both(a, b, c, soft, hard):
    for k in range(a.size):
        soft[k] = fused(a[k], b[k], c[k])
        hard[k] = fma(a[k], b[k], c[k])


def compared(a, b, c):
    soft, hard = np.empty(a.size), np.empty(a.size)
    both(a, b, c, soft, hard)
    np.testing.assert_array_equal(soft, hard)


def test_it_rounds_once_whatever_cancels():
    g = np.random.default_rng(0)
    a, b = g.uniform(-1, 1, (2, SIZE))
    compared(a, b, g.uniform(-1, 1, SIZE))
    compared(a, b, -a * b)  # what is left is the product's own rounding error
    compared(a, b, -a * b * (1 + 2.0**-52))
    scale = 2.0 ** g.integers(-60, 60, (3, SIZE))
    compared(a * scale[0], b * scale[1], g.uniform(-1, 1, SIZE) * scale[2])


def test_it_rounds_ties_to_even():
    g = np.random.default_rng(1)
    k = g.integers(1, 2**26, SIZE).astype(float)
    compared(k, 2.0**-54 * np.ones(SIZE), g.integers(1, 2**52, SIZE) * 2.0**-52)
    compared(k * 2 + 1, np.full(SIZE, 2.0**-53), np.ones(SIZE))


def test_zeros_and_infinities_are_the_processors():
    special = np.array([0.0, -0.0, 1.0, -1.0, math.inf, -math.inf])
    grid = np.array(np.meshgrid(special, special, special)).reshape(3, -1)
    compared(*grid)


def test_the_remainder_is_fmod():
    g = np.random.default_rng(2)
    for a in np.concatenate([g.uniform(-50, 50, 2000), [0.0, 6.0, -6.0, 1e6]]).tolist():
        for b in (1.0, 2 * math.pi):
            assert remainder(a, b) == math.fmod(a, b)
