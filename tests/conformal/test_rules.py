"""Step rules by hand, against their definitions, and what they refuse."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cpl.conformal import (
    PI,
    Decaying,
    Fixed,
    RunningMax,
    StepRule,
    TrailingMax,
    TrailingRange,
    step_sizes,
    track,
)

SCORES = [1.0, 3.0, -4.0, 0.0, 2.0, 2.0]


@pytest.mark.parametrize(
    ("rule", "steps"),
    [
        (Fixed(eta=0.5), [0.5] * 6),
        (RunningMax(c=0.5), [0.5, 1.5, 2.0, 2.0, 2.0, 2.0]),
        (TrailingMax(c=0.5, window=1), [0.5, 1.5, 2.0, 0.0, 1.0, 1.0]),
        (TrailingMax(c=0.5, window=3), [0.5, 1.5, 2.0, 2.0, 2.0, 1.0]),
        (TrailingMax(c=0.5, window=99), [0.5, 1.5, 2.0, 2.0, 2.0, 2.0]),
        (TrailingRange(lr=0.5, window=1), [0.5, 0.0, 0.0, 0.0, 0.0, 0.0]),
        (TrailingRange(lr=0.5, window=3), [0.5, 0.0, 1.0, 3.5, 3.5, 3.0]),
        (Decaying(c=2.0, power=1.0), [2.0, 1.0, 2 / 3, 0.5, 0.4, 1 / 3]),
        (PI(RunningMax(c=0.5), K_I=1, C_sat=1), [0.5, 1.5, 2.0, 2.0, 2.0, 2.0]),
    ],
)
def test_steps_by_hand(rule, steps):
    assert step_sizes(SCORES, rule).tolist() == pytest.approx(steps, abs=0)


def test_steps_of_no_scores_are_none(stepping_rule):
    assert step_sizes([], stepping_rule).shape == (0,)


@settings(max_examples=60)
@given(
    scores=st.lists(st.integers(-9, 9), min_size=1, max_size=30),
    window=st.integers(1, 35),
)
def test_trailing_rules_see_the_last_scores_only(scores, window):
    maxima = [
        max(abs(s) for s in scores[max(t - window + 1, 0) : t + 1]) for t in range(len(scores))
    ]
    assert step_sizes(scores, TrailingMax(c=1.0, window=window)).tolist() == maxima
    before = [scores[max(t - window, 0) : t] for t in range(1, len(scores))]
    ranges = [1.0, *(max(seen) - min(seen) for seen in before)]
    assert step_sizes(scores, TrailingRange(lr=1.0, window=window)).tolist() == ranges


def test_steppers_remember_no_more_than_the_window(step_rule):
    stepper = step_rule.stepper()
    for k in range(500):
        stepper.peek(float(-k))
        stepper.push(float(-k))  # falling: no score tops the ones before
    kept = [len(getattr(stepper, name).kept) for name in ("before", "above", "below")
            if hasattr(stepper, name)]  # fmt: skip
    assert all(size <= step_rule.window for size in kept)


def test_peek_changes_nothing(step_rule):
    stepper = step_rule.stepper()
    for value in SCORES:
        first = stepper.peek(value)
        stepper.peek(1e9)
        assert stepper.peek(value) == first
        stepper.push(value)


@pytest.mark.parametrize(
    ("make", "name", "value"),
    [
        (lambda v: Fixed(eta=v), "eta", 0.0),
        (lambda v: Fixed(eta=v), "eta", -0.1),
        (lambda v: Fixed(eta=v), "eta", math.nan),
        (lambda v: Fixed(eta=v), "eta", math.inf),
        (lambda v: Fixed(eta=v), "eta", True),
        (lambda v: Fixed(eta=v), "eta", "0.1"),
        (lambda v: Fixed(eta=v), "eta", 10**400),
        (lambda v: RunningMax(c=v), "c", 0),
        (lambda v: TrailingMax(c=v, window=3), "c", -1),
        (lambda v: TrailingMax(c=1, window=v), "window", 0),
        (lambda v: TrailingMax(c=1, window=v), "window", 2.0),
        (lambda v: TrailingMax(c=1, window=v), "window", True),
        (lambda v: TrailingRange(lr=v, window=3), "lr", None),
        (lambda v: TrailingRange(lr=1, window=v), "window", "3"),
        (lambda v: Decaying(c=v, power=0.6), "c", 0),
        (lambda v: Decaying(c=1, power=v), "power", 0),
        (lambda v: PI(Fixed(eta=1), K_I=v, C_sat=1), "K_I", -1),
        (lambda v: PI(Fixed(eta=1), K_I=1, C_sat=v), "C_sat", 0),
        (lambda v: PI(Fixed(eta=1), K_I=1, C_sat=1, lag=v), "lag", 2),
        (lambda v: PI(Fixed(eta=1), K_I=1, C_sat=1, lag=v), "lag", -1),
        (lambda v: PI(v, K_I=1, C_sat=1), "rule", 0.05),
        (lambda v: PI(v, K_I=1, C_sat=1), "rule", PI(Fixed(eta=1), K_I=1, C_sat=1)),
        (lambda v: track([1.0], v, alpha=0.1), "rule", "fixed"),
        (lambda v: track([1.0], v, alpha=0.1), "rule", Fixed),
    ],
)
def test_refusals_name_argument_and_value(make, name, value):
    with pytest.raises(ValueError, match=rf"^{name} must ") as refused:
        make(value)
    assert repr(value) in str(refused.value)


def test_rules_are_frozen_values(any_rule):
    with pytest.raises((AttributeError, TypeError)):
        any_rule.alpha = 1
    assert len({any_rule, any_rule}) == 1


def test_steps_have_no_default():
    for rule in (Fixed, RunningMax, TrailingMax, TrailingRange, Decaying, PI):
        with pytest.raises(TypeError):
            rule()


def test_a_rule_of_ones_own_needs_only_the_two_methods():
    class Alternating(StepRule):
        def steps(self, scores):
            return np.where(np.arange(scores.shape[1]) % 2, 2.0, 1.0)[None, :]

        def stepper(self):
            raise NotImplementedError

    assert track([1.0] * 4, Alternating(), alpha=0.5).q.tolist() == [0.0, 0.5, 1.5, 1.0]


# The traps: what the rules without a guarantee do.


def test_trailing_range_freezes_on_constant_scores():
    q, err = track([2.0] * 1000, TrailingRange(lr=0.5, window=20), alpha=0.1)
    assert err.all()
    assert (q[1:] == 0.45).all()


def test_trailing_maximum_freezes_below_zero_and_rejects_perfect_predictions():
    scores = [1.0, 0.5] + [0.0] * 998
    q, err = track(scores, TrailingMax(c=1.0, window=8), alpha=0.125)
    assert (q[9:] == -0.0625).all()
    assert err[9:].all()
    assert track(scores, RunningMax(c=1.0), alpha=0.125).err.mean() == pytest.approx(
        0.125, abs=0.01
    )
