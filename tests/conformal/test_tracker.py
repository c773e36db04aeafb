"""The online tracker by hand: thresholds, ties, delay, refusals, memory."""

import tracemalloc
from fractions import Fraction

import numpy as np
import pytest

from cpl.conformal import PI, Decaying, Fixed, RunningMax, Tracker, TrailingMax, TrailingRange


def test_by_hand_with_a_tie():
    tracker = Tracker(Fixed(eta=1.0), alpha=0.25)
    seen = [(tracker.q, tracker.update(s)) for s in (2.0, 2.0, 1.5, 1.25, 0.5)]
    assert seen == [(0.0, True), (0.75, True), (1.5, False), (1.25, False), (1.0, False)]
    assert tracker.q == 0.75


def test_by_hand_with_delay():
    tracker = Tracker(Fixed(eta=1.0), alpha=0.25, delay=3, q0=1.0)
    seen = [(tracker.q, tracker.update(s), tracker.pending) for s in (2.0, 0.0, 2.0, 2.0, 0.0)]
    assert seen == [
        (1.0, True, 1),
        (1.0, False, 2),
        (1.0, True, 2),
        (1.75, True, 2),
        (1.5, False, 2),
    ]
    assert tracker.q == 2.25


def test_it_shows_what_it_is_and_where_it_stands():
    tracker = Tracker(Fixed(eta=1.0), alpha=0.25, delay=2, q0=0.5)
    assert repr(tracker) == "Tracker(Fixed(eta=1.0), alpha=0.25, delay=2, q=0.5)"


def test_pi_by_hand():
    tracker = Tracker(PI(Fixed(eta=1.0), K_I=2.0, C_sat=1.0, lag=0), alpha=0.5)
    assert tracker.update(9.0)
    assert tracker.q == 0.5  # log 1 = 0: the integral is silent at first
    assert tracker.update(9.0)
    assert tracker.q == pytest.approx(1.0 + 2.0 * np.tan(1.0 * np.log(2.0) / 2.0))


def test_pi_saturates_to_infinity_both_ways_and_comes_back():
    # After two misses the angle is (2 - 0.2) log 2 / (0.35 * 2) > pi / 2.
    up = Tracker(PI(Fixed(eta=1.0), K_I=1.0, C_sat=0.35, lag=0), alpha=0.1)
    assert [up.update(9.0), up.update(9.0)] == [True, True]
    assert up.q == np.inf
    assert not up.update(1e300)
    for _ in range(40):
        up.update(0.0)
    assert np.isfinite(up.q)
    down = Tracker(PI(Fixed(eta=1.0), K_I=1.0, C_sat=0.35, lag=0), alpha=0.9)
    assert [down.update(-9.0), down.update(-9.0)] == [False, False]
    assert down.q == -np.inf
    assert down.update(-1e300)


def test_narrow_numbers_are_converted():
    tracker = Tracker(Fixed(eta=1.0), alpha=0.25)
    for score in (np.float32(2.0), np.int64(2), 2, Fraction(1, 2), np.float64(0.5)):
        assert isinstance(tracker.update(score), bool)
    assert isinstance(tracker.q, float)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        *[("alpha", v) for v in (0.0, 1.0, -0.1, 1.1, float("nan"), True, "0.1", None)],
        *[("delay", v) for v in (0, -1, 1.0, 1.5, True, "1", None)],
        *[("q0", v) for v in (float("nan"), float("inf"), True, "0", None)],
        *[("bounds", v) for v in ((1.0, 0.0), (0.0, 0.0), 3.0, (0.0, 1.0, 2.0), "ab")],
        *[("bounds", v) for v in ((0.0, float("inf")), (float("nan"), 1.0))],
        *[("rule", v) for v in (0.05, "fixed", None, Fixed)],
    ],
)
def test_refusals_name_argument_and_value(name, value):
    arguments = {"rule": Fixed(eta=1.0), "alpha": 0.1} | {name: value}
    with pytest.raises(ValueError, match=rf"^{name}(\[[01]\])? must ") as refused:
        Tracker(**arguments)
    offending = [value, *value] if isinstance(value, tuple | str) else [value]
    assert any(repr(part) in str(refused.value) for part in offending)


@pytest.mark.parametrize("score", [float("nan"), float("inf"), -float("inf"), 1.01, -0.01, True])
@pytest.mark.parametrize("delay", [1, 3])
def test_refused_scores_name_the_value(any_rule, delay, score):
    tracker = Tracker(any_rule, alpha=0.1, delay=delay, bounds=(0, 1))
    with pytest.raises(ValueError, match=r"^score must .*" + repr(score).replace(".", r"\.")):
        tracker.update(score)
    assert (tracker.q, tracker.pending) == (0.0, 0)


def test_alpha_and_eta_have_no_default():
    with pytest.raises(TypeError, match="alpha"):
        Tracker(Fixed(eta=1.0))


def test_feedback_is_refused_where_the_tracker_keeps_the_queue():
    tracker = Tracker(Fixed(eta=1.0), alpha=0.1, delay=2)
    with pytest.raises(ValueError, match="delay must be 1 for feedback"):
        tracker.feedback(1.0, met=0.0)


def test_feedback_takes_infinite_thresholds_and_refuses_none():
    tracker = Tracker(PI(Fixed(eta=1.0), K_I=1.0, C_sat=1.0), alpha=0.25)
    assert not tracker.feedback(1.0, met=float("inf"))
    assert tracker.feedback(1.0, met=-float("inf"))
    assert tracker.feedback(np.float32(1.0), met=0)
    for met in (float("nan"), "0", None):
        with pytest.raises(ValueError, match="met must be"):
            tracker.feedback(1.0, met=met)


@pytest.mark.parametrize(
    ("rule", "scores"),
    [
        (RunningMax(c=10.0), [1e308]),
        (TrailingMax(c=10.0, window=2), [1e308]),
        (TrailingRange(lr=1.0, window=2), [1e308, -1e308, 0.0]),
        (Fixed(eta=1.7e308), [1e308, 1.7e308]),
        (PI(RunningMax(c=10.0), K_I=1.0, C_sat=1.0), [1e308]),
    ],
)
def test_a_step_out_of_range_is_refused_and_leaves_no_trace(rule, scores):
    tracker = Tracker(rule, alpha=0.1)
    *fine, last = scores
    for value in fine:
        tracker.update(value)
    before = tracker.q
    with pytest.raises(ValueError, match="beyond the range of floats"):
        tracker.update(last)
    assert tracker.q == before
    with pytest.raises(ValueError, match="beyond the range of floats"):
        Tracker(rule, alpha=0.1).extend(scores)


@pytest.mark.parametrize(
    "rule",
    [
        Fixed(eta=0.1),
        RunningMax(c=0.1),
        Decaying(c=0.1, power=0.6),
        PI(RunningMax(c=0.1), K_I=1.0, C_sat=5.0),
        TrailingRange(lr=0.1, window=50),
    ],
    ids=repr,
)
@pytest.mark.parametrize("delay", [1, 4])
def test_memory_does_not_grow(rule, delay):
    tracker = Tracker(rule, alpha=0.1, delay=delay)
    scores = np.random.default_rng(0).random(4000).tolist()
    for value in scores:
        tracker.update(value)
    tracemalloc.start()
    try:
        before, _ = tracemalloc.get_traced_memory()
        for value in scores:
            tracker.update(value)
        after, _ = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert after - before < 10_000
