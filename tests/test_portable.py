"""Functions without libm, against arithmetic with sixty digits."""

import mpmath
import numpy as np
import pytest

from cpl import portable

mpmath.mp.prec = 200


def spread(seed, top, least=1e-9):
    """Even, log-even and whole arguments of both signs."""
    g = np.random.default_rng(seed)
    even = g.uniform(-top, top, 600)
    small = even * 10.0 ** g.uniform(np.log10(least), 0, 600)
    return np.concatenate([even, small, np.arange(-3.0, 4.0) * min(top, 1.0) / 3])


def misrounded(name, arguments):
    found = []
    for point in arguments:
        true = getattr(mpmath, name)(*(mpmath.mpf(x) for x in point))
        if float(true) != getattr(portable, name)(*point):
            found.append(point)
    return found


@pytest.mark.parametrize(
    ("name", "top"), [("sin", 1e5), ("cos", 1e5), ("tan", 1e5), ("atan", 1e6), ("asin", 1.0)]
)
def test_angles_are_rounded_once(name, top):
    points = [*spread(1, top).tolist(), *spread(2, min(top, 1.6)).tolist()]
    points = [x for x in points if name != "asin" or abs(x) <= 1]
    assert misrounded(name, [(x,) for x in points]) == []


def test_exponentials_and_logarithms_are_rounded_once():
    assert (
        misrounded("exp", [(x,) for x in [*spread(3, 700).tolist(), *spread(4, 1).tolist()]]) == []
    )
    positive = np.abs(np.concatenate([spread(5, 1), spread(6, 1e9), 1 + spread(7, 0.01)]))
    assert misrounded("log", [(x,) for x in positive[positive > 0].tolist()]) == []
    g = np.random.default_rng(8)
    points = zip(10.0 ** g.uniform(-20, 15, 600), g.uniform(3, 18, 600), strict=True)
    assert misrounded("power", [(x, y) for x, y in points if x**y > 1e-300]) == []


def test_ends_of_the_ranges():
    assert portable.exp(-1000.0) == 0.0
    assert portable.exp(1000.0) == np.inf
    assert portable.exp(709.7) == float(mpmath.exp(mpmath.mpf(709.7)))
    assert portable.log(0.0) == -np.inf
    assert np.isnan(portable.log(-1.0))
    assert np.isnan(portable.asin(1.5))
    assert np.isnan(portable.sin(1e7))
    assert portable.asin(1.0) == portable.atan(1e300) == np.pi / 2
    assert portable.power(0.0, 4.0) == 0.0
    assert np.isnan(portable.exp(np.nan))
