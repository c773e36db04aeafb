"""The inlined maths against libm: equal, except that a zero may lose its sign."""

import numpy as np
import pytest

from cpl.highway import exact
from cpl.highway._compile import kernel

SIZE = 1 << 15
TOPS = {"asin": 0.35, "tan": 0.35, "atan": 0.4, "sin": 0.5, "cos": 0.5}


def arguments(top, seed):
    """Even, log-even, tiny, extreme and special arguments."""
    g = np.random.default_rng(seed)
    even = g.uniform(-top, top, SIZE // 2)
    x = np.concatenate([even, even * 10.0 ** g.uniform(-12, 0, SIZE // 2)])
    x[:6] = 0.0, -0.0, top, -top, 5e-324, 2.0**-30
    return x


def both(kind, *x):
    function = COMPILED[kind]
    results = []
    for path in (exact.FAST, exact.LIBM):
        out, doubt = np.empty(SIZE), np.zeros(SIZE, np.int64)
        function(*x, out, doubt, SIZE, path)
        results.append((out, doubt))
    return results


@kernel
def asin_of(x, out, doubt, count, path):
    exact.asin_all(x, out, doubt, count, path)


@kernel
def tan_of(x, out, doubt, count, path):
    exact.tan_all(x, out, doubt, count, path)


@kernel
def atan_of(x, out, doubt, count, path):
    exact.atan_all(x, out, doubt, count, path)


@kernel
def sin_of(x, out, doubt, count, path):
    exact.sin_all(x, out, doubt, count, path)


@kernel
def cos_of(x, out, doubt, count, path):
    exact.cos_all(x, out, doubt, count, path)


COMPILED = {"asin": asin_of, "tan": tan_of, "atan": atan_of, "sin": sin_of, "cos": cos_of}


@pytest.mark.parametrize("kind", TOPS)
def test_functions_equal_libm_and_rarely_call_it(kind):
    for seed in range(20):
        x = arguments(TOPS[kind] * (1.1 if seed == 0 and kind != "asin" else 1.0), seed)
        (fast, doubt), (libm, _) = both(kind, x)
        np.testing.assert_array_equal(fast, libm)
    assert doubt.mean() < 0.15


def test_power_equals_libm_and_rarely_calls_it():
    g = np.random.default_rng(1)
    for span in ((0.3, 1.3), (0.0, 3.0), (0.99, 1.01), (0.0, 1e-18), (1e14, 1e17)):
        x, y = g.uniform(*span, SIZE), g.uniform(3.5, 4.5, SIZE)
        x[:3] = 0.0, 1.0, 0.5
        results = []
        for path in (exact.FAST, exact.LIBM):
            out, doubt = np.empty(SIZE), np.zeros(SIZE, np.int64)
            exact.pow_all(x, y, out, doubt, SIZE, path)
            results.append(out)
            if path == exact.FAST and span[0] == 0.3:
                assert doubt.mean() < 0.1
        np.testing.assert_array_equal(results[0], results[1])
