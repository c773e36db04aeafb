"""Trackers side by side: the same bits as one tracker a stream, whatever the masks."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cpl.conformal import BatchTracker, Fixed, RunningMax, Tracker


def twin(rule, n, seed, *, delay, steps=60):
    """Drive both through random masks, resets and ends of episodes; return the thresholds."""
    draws = np.random.default_rng(seed)
    batch = BatchTracker(rule, n, alpha=0.1, delay=delay, q0=0.25)
    single = [Tracker(rule, alpha=0.1, delay=delay, q0=0.25) for _ in range(n)]
    traces = []
    for _ in range(steps):
        scores, mask = draws.random(n) * draws.choice([0.1, 1.0, 7.0]), draws.random(n) < 0.7
        errs = batch.update(np.where(mask, scores, np.nan), mask)
        one = [single[k].update(scores[k]) if mask[k] else False for k in range(n)]
        assert errs.tolist() == one
        over = draws.random(n) < 0.05
        if draws.random() < 0.5:
            batch.drop_pending(over)
            for k in np.flatnonzero(over):
                single[k].drop_pending()
        else:
            batch.reset(over)
            for k in np.flatnonzero(over):
                single[k].reset()
        assert batch.pending.tolist() == [tracker.pending for tracker in single]
        traces.append((batch.q, [tracker.q for tracker in single]))
    return (np.array([pair[k] for pair in traces]) for k in (0, 1))


@pytest.mark.parametrize("delay", [1, 3])
def test_every_rule_gives_the_bits_of_one_tracker_a_stream(any_rule, delay):
    batch, single = twin(any_rule, 5, 7, delay=delay)
    np.testing.assert_array_equal(batch, single)


@given(st.integers(1, 9), st.integers(1, 6), st.integers(0, 2**32))
def test_any_number_of_streams_and_any_delay(n, delay, seed):
    batch, single = twin(RunningMax(c=0.1), n, seed, delay=delay, steps=25)
    np.testing.assert_array_equal(batch, single)


@given(st.integers(1, 5), st.integers(0, 2**32))
def test_feedback_of_a_live_loop_equals_the_delay_of_a_simulation(delay, seed):
    scores = np.random.default_rng(seed).random((20, 3))
    live = BatchTracker(Fixed(eta=0.3), 3, alpha=0.2)
    simulated = BatchTracker(Fixed(eta=0.3), 3, alpha=0.2, delay=delay)
    issued = []
    for t in range(20):
        if t >= delay:
            live.feedback(*issued[t - delay])
        issued.append((scores[t], live.q))
        np.testing.assert_array_equal(live.q, simulated.q)
        simulated.update(scores[t])


def test_streams_without_a_score_stand_still():
    trackers = BatchTracker(RunningMax(c=1.0), 3, alpha=0.5)
    trackers.update([1.0, 1.0, 1.0], np.array([True, False, False]))
    assert trackers.q.tolist() == [0.5, 0.0, 0.0]
    trackers.update([1.0] * 3, np.zeros(3, dtype=bool))
    assert trackers.q.tolist() == [0.5, 0.0, 0.0]


def test_the_thresholds_handed_out_are_copies():
    trackers = BatchTracker(Fixed(eta=1.0), 2, alpha=0.5)
    trackers.q[:] = 9.0
    assert trackers.q.tolist() == [0.0, 0.0]


@pytest.mark.parametrize(
    ("scores", "message"),
    [
        ([1.0, np.nan], r"scores\[1\] = nan"),
        ([1.0], r"shape \(2,\)"),
        (["a", "b"], "numbers"),
        ([1.0, 1.79e308], "beyond the range"),
    ],
)
def test_a_refused_update_changes_nothing(scores, message):
    trackers = BatchTracker(Fixed(eta=1.7e308), 2, alpha=0.1)
    trackers.update([1.0, 2.0])
    before = trackers.q
    with pytest.raises(ValueError, match=message):
        trackers.update(scores)
    np.testing.assert_array_equal(trackers.q, before)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"n": 0}, "n must be >= 1, got 0"),
        ({"alpha": 1.0}, "alpha must lie"),
        ({"delay": 0}, "delay must be >= 1"),
        ({"rule": 0.1}, "rule must be a rule"),
        ({"q0": np.inf}, "q0 must be finite"),
    ],
)
def test_impossible_settings_are_refused(changes, message):
    given_ = {"rule": Fixed(eta=1.0), "n": 2, "alpha": 0.1} | changes
    rule, n = given_.pop("rule"), given_.pop("n")
    with pytest.raises(ValueError, match=message):
        BatchTracker(rule, n, **given_)


def test_wrong_masks_and_thresholds_are_refused():
    trackers = BatchTracker(Fixed(eta=1.0), 2, alpha=0.1)
    with pytest.raises(ValueError, match="mask must be bool"):
        trackers.update([1.0, 1.0], np.array([1, 0]))
    with pytest.raises(ValueError, match="met must not be NaN"):
        trackers.feedback([1.0, 1.0], [0.0, np.nan])
    with pytest.raises(ValueError, match="delay must be 1"):
        BatchTracker(Fixed(eta=1.0), 2, alpha=0.1, delay=2).feedback([1.0, 1.0], [0.0, 0.0])


def test_it_says_what_it_is():
    shown = repr(BatchTracker(Fixed(eta=1.0), 2, alpha=0.1))
    assert shown == "BatchTracker(Fixed(eta=1.0), 2, alpha=0.1, delay=1, q0=0.0)"
