"""The adversaries attain what the bounds allow; the real trackers fall for them too."""

from fractions import Fraction
from itertools import product

import pytest

from cpl.conformal import Fixed, bounds, track, track_exact
from cpl.conformal.adversary import (
    lower_worst_case,
    lower_worst_case_from_start,
    upper_worst_case,
    upper_worst_case_from_start,
)
from cpl.conformal.reference import follow
from cpl.conformal.search import ALPHAS, RATIOS

ATTAINS = [
    (upper_worst_case, bounds.max_errors),
    (lower_worst_case, bounds.min_errors),
    (upper_worst_case_from_start, bounds.max_errors_from_start),
    (lower_worst_case_from_start, bounds.min_errors_from_start),
]


@pytest.mark.parametrize(("adversary", "bound"), ATTAINS)
def test_attained_in_every_setting_without_delay(adversary, bound):
    for alpha, ratio, W in product(ALPHAS, RATIOS[::2], (1, 2, 7, 30)):
        assert adversary(alpha, 1, ratio, W).errors == bound(alpha, 1, ratio, W)


@pytest.mark.parametrize("delay", [2, 3, 4])
@pytest.mark.parametrize(("adversary", "bound"), ATTAINS)
def test_attained_with_delay_where_it_is_promised(adversary, bound, delay):
    tried = 0
    for alpha, ratio, W in product(ALPHAS[::2], RATIOS, (1, 2, 7, 30)):
        if bounds.attained_for_certain(alpha, 1, ratio, delay=delay):
            tried += 1
            expected = bound(alpha, 1, ratio, W, delay=delay)
            assert adversary(alpha, 1, ratio, W, delay=delay).errors == expected
    assert tried > 80


@pytest.mark.parametrize("delay", [1, 2, 3])
def test_the_longest_run_of_misses_happens(delay):
    for alpha, ratio in product(ALPHAS, RATIOS):
        longest = bounds.longest_miss_run(alpha, 1, ratio, delay=delay)
        worst = upper_worst_case(alpha, 1, ratio, longest, delay=delay)
        assert worst.errors == longest == worst.W


def test_the_simple_description_is_true():
    worst = upper_worst_case(0.1, 0.1, 1, W=12)
    assert worst.scores == (0, *[1] * 12)
    plain = follow([0] + [1] * 200, alpha=0.1, eta=0.1)
    for W in range(1, 200):
        assert plain.errors(1, W) == bounds.max_errors(0.1, 0.1, 1, W)


def test_irrational_looking_levels_work_too():
    alpha, eta = Fraction("0.1234567"), Fraction("0.0987")
    for W in (10, 150, 300):
        assert upper_worst_case(alpha, eta, 1, W).errors == bounds.max_errors(alpha, eta, 1, W)
        assert lower_worst_case(alpha, eta, 1, W).errors == bounds.min_errors(alpha, eta, 1, W)


@pytest.mark.parametrize("delay", [1, 3])
@pytest.mark.parametrize(("adversary", "bound"), ATTAINS)
def test_the_compiled_trackers_fall_for_it(adversary, bound, delay):
    alpha, eta = 0.125, 0.0625  # dyadic: floating point is exact
    played = adversary(alpha, eta, 1, 80, delay=delay)
    expected = bound(alpha, eta, 1, 80, delay=delay)
    q, err = track(played.as_floats(), Fixed(eta=eta), alpha=alpha, delay=delay)
    assert bounds.window_errors(err, played.start, 80) == expected
    assert [float(x) for x in played.path().q[:-1]] == q.tolist()
    counted = track_exact(played.as_floats(), Fixed(eta=eta), alpha=alpha, delay=delay)
    assert bounds.window_errors(counted.err, played.start, 80) == expected
