"""The rules of the second edition, on effects that one can read off."""

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from cpl.claims.judging import (
    Condition,
    at_least,
    change,
    decided_by,
    found,
    jointly,
    seeds_needed,
    what_would_change,
)
from cpl.claims.verdict import Verdict
from cpl.stats import Estimate

HOLDS, PART, NONE = "holds", "holds in part", "no difference"
FAILS, OPEN = "does not hold", "undecided"


def effect(value, low, high, n=10):
    return Estimate(value=value, low=low, high=high, n=n)


def condition(value, low, high, *, size=None, margin=2.0, same=False, n=10):
    estimate = effect(value, low, high, n)
    return Condition(name="here", effect=estimate, margin=margin, size=size, same=same)


@pytest.mark.parametrize(
    ("value", "low", "high", "size", "verdict"),
    [
        (12.0, 11.0, 13.0, 12.8, HOLDS),
        (6.4, 0.1, 12.7, 12.8, HOLDS),  # exactly half
        (20.0, 18.0, 22.0, 12.8, HOLDS),  # more than claimed
        (5.0, 4.0, 6.0, 12.8, FAILS),  # there, but its upper bound is under half
        (5.0, 3.0, 7.0, 12.8, PART),  # smaller
        (4.0, -2.0, 10.0, 12.8, OPEN),  # spans 0 and half
        (2.0, -3.0, 6.0, 12.8, FAILS),  # spans 0, but not half
        (-3.0, -4.0, -2.0, 12.8, FAILS),
        (2.5, 0.1, 4.9, None, HOLDS),
        (1.5, 0.1, 2.9, None, PART),  # there, but not shown to matter
        (1.0, 0.1, 1.9, None, NONE),  # there, and too small to matter
        (0.0, -1.9, 1.9, None, NONE),
        (0.0, -2.1, 1.9, None, FAILS),  # nothing that matters in the claimed direction
        (0.0, -2.1, 2.1, None, OPEN),
        (-3.0, -7.0, 0.0, None, FAILS),
    ],
)
def test_one_condition(value, low, high, size, verdict):
    assert condition(value, low, high, size=size).verdict == verdict


@pytest.mark.parametrize(
    ("value", "low", "high", "verdict"),
    [
        (0.0, -1.0, 1.0, HOLDS),
        (1.0, 0.5, 1.5, HOLDS),  # another one, but near enough
        (3.0, 2.0, 4.0, FAILS),
        (-3.0, -4.0, -2.0, FAILS),
        (1.5, 0.5, 2.5, OPEN),
        (0.0, -3.0, 3.0, OPEN),
    ],
)
def test_sameness(value, low, high, verdict):
    assert condition(value, low, high, same=True).verdict == verdict


def test_a_level_may_be_claimed_from_both_sides():
    share = effect(0.2, 0.1, 0.3)
    assert at_least("", share, 0.05).verdict == HOLDS
    assert at_least("", share, 0.05, below=True).verdict == FAILS
    assert at_least("", share, 0.25).verdict == OPEN
    assert at_least("", share, 0.35, below=True).effect.value == pytest.approx(0.15)


YES, SMALL, LITTLE, UNSURE, NO = (
    condition(12.0, 11.0, 13.0, size=12.8),
    condition(5.0, 3.0, 7.0, size=12.8),
    condition(0.0, -1.0, 1.0, size=12.8),
    condition(4.0, -2.0, 10.0, size=12.8),
    condition(-3.0, -4.0, -2.0, size=12.8),
)


@pytest.mark.parametrize(
    ("conditions", "verdict"),
    [
        ([YES, YES, YES], HOLDS),
        ([YES, YES, NO], PART),
        ([YES, YES, LITTLE], PART),
        ([YES, UNSURE, UNSURE], PART),
        ([SMALL, SMALL], PART),
        ([SMALL, NO], PART),
        ([UNSURE, NO], FAILS),  # a conjunction with a refuted member is refuted
        ([UNSURE, LITTLE], FAILS),
        ([LITTLE, NO], FAILS),
        ([LITTLE, LITTLE], NONE),
        ([UNSURE, UNSURE], OPEN),
        ([NO, NO, NO], FAILS),
    ],
)
def test_several_conditions(conditions, verdict):
    assert jointly(conditions) == verdict
    assert jointly(conditions[::-1]) == verdict


EFFECTS = st.tuples(st.floats(-20, 20), st.floats(0, 20), st.floats(0, 20))


@given(EFFECTS, st.floats(0.1, 10), st.none() | st.floats(0.1, 20))
def test_what_holds_does_not_hold_the_other_way_round(numbers, margin, size):
    value, below, above = numbers
    there = condition(value, value - below, value + above, margin=margin, size=size)
    back = condition(-value, -value - above, -value + below, margin=margin, size=size)
    if there.verdict is Verdict.HOLDS:
        assert back.verdict is Verdict.FAILS
    assert (there.verdict is Verdict.NONE) == (back.verdict is Verdict.NONE)


@given(st.floats(-20, 20), st.floats(0.1, 10), st.none() | st.floats(0.1, 20), st.booleans())
def test_enough_data_decide_every_truth(truth, margin, size, same):
    """No truth but the boundaries themselves stays undecided."""
    one = condition(truth, truth, truth, margin=margin, size=size, same=same)
    assert one.verdict is not Verdict.UNDECIDED


@given(EFFECTS, st.floats(0.1, 10))
def test_seeds_that_are_needed_are_enough(numbers, margin):
    value, below, above = numbers
    one = condition(value, value - below, value + above, margin=margin)
    n = seeds_needed(one)
    if n is None:
        return
    assert one.verdict is Verdict.UNDECIDED
    assert n >= 10
    factor = (n / 10) ** 0.5
    low, high = value - below / factor, value + above / factor
    assert condition(value, low, high, margin=margin).verdict is not Verdict.UNDECIDED


@given(EFFECTS, st.floats(0.1, 10))
def test_the_change_that_is_told_changes_the_verdict(numbers, margin):
    value, below, above = numbers
    one = condition(value, value - below, value + above, margin=margin)
    shift, then = change(one)
    low, there, high = (end + shift for end in (value - below, value, value + above))
    assert replace(one, effect=effect(there, low, high)).verdict is then
    assert then is not one.verdict


def test_what_would_change_is_told_of_the_nearest_condition():
    assert "seeds" in what_would_change(found([UNSURE], n=1))
    near = replace(YES, name="near", effect=effect(6.5, 0.1, 12.9))
    told = what_would_change(found([YES, near], n=1))
    assert told.startswith("near: an effect -")
    assert told.endswith("(holds in part)")


def test_one_decided_condition_is_enough_for_an_undecided_claim():
    nearer = replace(UNSURE, effect=effect(5.0, -0.1, 10.1))
    both = found([UNSURE, nearer], n=1)
    assert decided_by(both) == min(seeds_needed(UNSURE), seeds_needed(nearer))
    assert decided_by(found([YES], n=1)) is None


@pytest.mark.parametrize(
    ("wrong", "named"),
    [
        ({"margin": -1.0}, "got -1.0"),
        ({"margin": 0.0, "same": True}, "got 0.0"),
        ({"size": -1.0}, "got -1.0"),
        ({"effect": effect(3.0, 0.0, 1.0)}, "must lie in its interval"),
    ],
)
def test_bad_arguments_are_named(wrong, named):
    with pytest.raises(ValueError, match=named):
        replace(YES, **wrong)


def test_no_condition_is_no_claim():
    with pytest.raises(ValueError, match="empty"):
        jointly([])
