"""Feedback that is late, out of order, lost or wrong: every small case obeys the bounds."""

import math
from fractions import Fraction
from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cpl.conformal import Fixed, Tracker
from cpl.conformal.bounds import (
    deviation_bound,
    max_errors_in_trouble,
    min_errors_in_trouble,
    troubled_range,
)
from cpl.conformal.search import search_trouble

CASES = [
    (alpha, ratio, h, lost, lies)
    for alpha, ratio in ((Fraction(1, 2), 1), (Fraction(1, 3), 2), (Fraction(1, 4), Fraction(3, 2)))
    for h, lost, lies in ((1, 0, 0), (2, 0, 0), (2, 1, 0), (1, 0, 1), (2, 0, 1), (1, 1, 1))
]


@pytest.mark.parametrize(("alpha", "ratio", "h", "lost", "lies"), CASES)
def test_every_small_case_obeys_the_bounds(alpha, ratio, h, lost, lies):
    found = search_trouble(
        alpha, 1, ratio, 6, outstanding=h, lost=lost, false_misses=lies, false_covers=lies
    )
    setting = (alpha, 1, ratio)
    walls = troubled_range(
        *setting, outstanding=h, burst_false_misses=lies, burst_false_covers=lies
    )
    assert walls.low <= found.low
    assert found.high < walls.high
    for W, (most, least) in enumerate(zip(found.most, found.least, strict=True), start=1):
        for misses, gone, wrong, before in most:
            assert misses <= max_errors_in_trouble(
                *setting, W, outstanding=h, lost=gone, false_covers=wrong, burst_false_covers=before
            )
        for misses, gone, wrong, before in least:
            assert misses >= min_errors_in_trouble(
                *setting, W, outstanding=h, lost=gone, false_misses=wrong, burst_false_misses=before
            )


def test_lost_feedback_costs_what_the_bound_says():
    """Each loss may cost a whole miss, not only 1 - alpha of one: the bound is met with 0, 1, 2."""
    setting = Fraction(1, 4), 1, Fraction(3, 2)
    found = search_trouble(*setting, 6, outstanding=1, lost=2)
    for gone in range(3):
        worst = [max(n for n, lost, _, _ in most if lost <= gone) for most in found.most]
        most = [
            max_errors_in_trouble(*setting, W, outstanding=1, lost=min(gone, W))
            for W in range(1, 7)
        ]
        assert all(a <= b for a, b in zip(worst, most, strict=True))
        assert worst[-1] == most[-1]


def test_without_trouble_it_is_the_bound_of_a_fixed_delay():
    for h, W in product((1, 3), (20, 200)):
        more = deviation_bound(Fraction(1, 10), Fraction(1, 10), 1, delay=h)
        most = max_errors_in_trouble(Fraction(1, 10), Fraction(1, 10), 1, W, outstanding=h)
        assert most == min(W, math.ceil(Fraction(W, 10) + more) - 1)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"outstanding": 0}, "outstanding must be"),
        ({"lost": 41}, "lost must be at most W = 40, got 41"),
        ({"false_covers": -1}, "false_covers must be"),
    ],
)
def test_impossible_settings_are_refused(changes, message):
    with pytest.raises(ValueError, match=message):
        max_errors_in_trouble(0.1, 0.1, 1, 40, **({"outstanding": 1} | changes))


@settings(max_examples=60)
@given(seed=st.integers(0, 10**6), h=st.integers(1, 6), rate=st.sampled_from([0.0, 0.1, 0.5]))
def test_a_live_loop_with_a_bad_line_obeys_the_bound(seed, h, rate):
    """Feedback through `Tracker.feedback`: shuffled, up to h outstanding, some of it never."""
    draws = np.random.default_rng(seed)
    alpha, eta, T = 0.2, 0.25, 120
    tracker, on_way, misses, lost = Tracker(Fixed(eta=eta), alpha=alpha), [], 0, 0
    for _ in range(T):
        score = float(draws.random() < 0.5)
        misses += score > tracker.q
        if draws.random() < rate:
            lost += 1
        else:
            on_way.append((score, tracker.q))
        while len(on_way) >= h or (on_way and draws.random() < 0.3):
            tracker.feedback(*on_way.pop(int(draws.integers(len(on_way)))))
    most = max_errors_in_trouble(alpha, eta, 1, T, outstanding=h, lost=lost)
    assert min_errors_in_trouble(alpha, eta, 1, T, outstanding=h, lost=lost) <= misses <= most
