"""Laws that every rule obeys, on drawn sequences: the forms agree, time runs forward, and so on."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cpl.conformal import (
    Decaying,
    Fixed,
    RunningMax,
    Tracker,
    TrailingMax,
    step_sizes,
    track,
    track_episodes,
    track_many,
)

few = settings(max_examples=20)
# Ties, repeats and signs matter more than size: half of the scores come from a coarse grid.
score = st.sampled_from([0.0, 0.25, 0.5, 1.0, 4.0, -1.0]) | st.floats(-1e6, 1e6)
sequence = st.lists(score, max_size=40)
setting = st.fixed_dictionaries(
    {
        "alpha": st.sampled_from([0.1, 0.2, 0.25, 0.9]) | st.floats(0.001, 0.999),
        "delay": st.integers(1, 5),
        "q0": st.sampled_from([0.0, -0.0, 1.0]) | st.floats(-10, 10),
    }
)


def same(a, b):
    """Equal bit for bit (NaN never occurs, and a zero has one sign)."""
    return np.asarray(a).tobytes() == np.asarray(b).tobytes()


def online(tracker, scores):
    """Return thresholds and errors of a tracker fed by hand."""
    q, err = [], []
    for value in scores:
        q.append(tracker.q)
        err.append(tracker.update(value))
    return np.array(q, dtype=float), np.array(err, dtype=bool)


@few
@given(scores=sequence, how=setting)
def test_online_and_compiled_give_the_same_bits(any_rule, scores, how):
    q, err = track(scores, any_rule, **how)
    q_online, err_online = online(Tracker(any_rule, **how), scores)
    assert same(q, q_online)
    assert same(err, err_online)
    q_plain, err_plain = Tracker(any_rule, **how).extend(scores)
    assert same(q, q_plain)
    assert same(err, err_plain)


@few
@given(rows=st.integers(0, 9), length=st.integers(0, 30), seed=st.integers(0, 99), how=setting)
def test_many_streams_are_single_streams(any_rule, rows, length, seed, how):
    scores = np.random.default_rng(seed).normal(size=(rows, length)).round(1)
    q, err = track_many(scores, any_rule, **how)
    assert q.shape == err.shape == (rows, length)
    for n in range(rows):
        one = track(scores[n], any_rule, **how)
        assert same(q[n], one.q)
        assert same(err[n], one.err)


@few
@given(scores=sequence, how=setting)
def test_the_definition_written_down_naively_agrees(any_rule, naive, scores, how):
    expected = np.array(naive(scores, any_rule, how["alpha"], how["delay"], how["q0"]))
    q, _ = track(scores, any_rule, **how)
    scale = 1.0 + np.abs(np.array([*scores, how["q0"]])).max()
    # A threshold within rounding of its score may go either way; the draws are compared up to it.
    close = np.abs(np.array(scores) - expected) < 1e-9 * scale
    upto = int(np.argmax(close)) if close.any() else len(scores)
    near = np.isclose(q, expected, rtol=1e-6, atol=1e-9 * scale)
    assert near[: upto + 1].all()


@few
@given(scores=sequence, how=setting)
def test_an_error_is_a_score_strictly_above_its_threshold(any_rule, scores, how):
    q, err = track(scores, any_rule, **how)
    assert err.dtype == np.bool_
    assert q.dtype == np.float64
    assert not np.isnan(q).any()
    assert same(err, np.array(scores) > q)


@few
@given(scores=sequence, others=sequence, cut=st.integers(0, 40), how=setting)
def test_a_threshold_knows_nothing_younger_than_the_delay(any_rule, scores, others, cut, how):
    here = track(scores[:cut] + others, any_rule, **how).q
    there = track(scores, any_rule, **how).q
    known = min(cut + how["delay"], len(here), len(there)) if cut <= len(scores) else 0
    assert same(here[:known], there[:known])
    assert (there[: how["delay"]] == how["q0"]).all()


@few
@given(scores=sequence, how=setting)
def test_late_feedback_moves_the_events_and_not_their_steps(step_rule, scores, how):
    q, err = track(scores, step_rule, **how)
    steps = step_sizes(scores, step_rule)
    p = how["q0"] + 0.0
    for t in range(len(scores) - how["delay"]):
        p = p + steps[t] * (1.0 - how["alpha"]) if err[t] else p - steps[t] * how["alpha"]
        assert q[t + how["delay"]] == p


@few
@given(scores=sequence, how=setting)
def test_a_live_loop_with_its_own_queue_sees_the_same_thresholds(any_rule, scores, how):
    delay = how["delay"]
    live = Tracker(any_rule, **(how | {"delay": 1}))
    met = []
    for t in range(len(scores)):
        if t >= delay:
            live.feedback(scores[t - delay], met=met[t - delay])
        met.append(live.q)
    assert same(np.array(met, dtype=float), track(scores, any_rule, **how).q)


@few
@given(scores=sequence, again=sequence, how=setting)
def test_reset_forgets_everything(any_rule, scores, again, how):
    tracker = Tracker(any_rule, **how)
    online(tracker, scores)
    tracker.reset()
    assert tracker.pending == 0
    assert same(online(tracker, again)[0], track(again, any_rule, **how).q)
    tracker.reset(q0=2.5)
    assert same(online(tracker, again)[0], track(again, any_rule, **(how | {"q0": 2.5})).q)


@few
@given(episodes=st.lists(st.lists(score, max_size=9), max_size=5), how=setting)
def test_episodes_start_anew_or_carry_on_as_the_online_tracker_does(any_rule, episodes, how):
    anew = track_episodes(episodes, any_rule, carry=False, **how)
    carried = track_episodes(episodes, any_rule, carry=True, **how)
    tracker = Tracker(any_rule, **how)
    assert len(anew) == len(carried) == len(episodes)
    for scores, fresh, onward in zip(episodes, anew, carried, strict=True):
        assert same(fresh.q, track(scores, any_rule, **how).q)
        q, err = online(tracker, scores)
        assert same(onward.q, q)
        assert same(onward.err, err)
        assert tracker.drop_pending() == min(len(scores), how["delay"] - 1)
        assert tracker.pending == 0


@few
@given(scores=st.lists(score, min_size=1, max_size=20), cut=st.integers(0, 20), how=setting)
def test_carrying_on_with_ordinary_feedback_is_one_long_sequence(any_rule, scores, cut, how):
    how = how | {"delay": 1}
    parts = track_episodes([scores[:cut], scores[cut:]], any_rule, carry=True, **how)
    assert same(np.concatenate([part.q for part in parts]), track(scores, any_rule, **how).q)


BAD = [float("nan"), float("inf"), float("-inf"), True, "1", None, 1j, [1.0], 2e6]


@few
@given(scores=sequence, bad=st.lists(st.sampled_from(BAD), max_size=40), how=setting)
def test_a_refused_score_leaves_no_trace(any_rule, scores, bad, how):
    tracker = Tracker(any_rule, bounds=(-1e6, 1e6), **how)
    q = []
    for k, value in enumerate(scores):
        if k < len(bad):
            with pytest.raises(ValueError, match="score"):
                tracker.update(bad[k])
            with pytest.raises(ValueError, match="scores"):
                # numpy reads True beside a number as 1.0, and True alone as what it is.
                tracker.extend([bad[k]] if bad[k] is True else [value, bad[k]])
        q.append(tracker.q)
        tracker.update(value)
    assert same(np.array(q, dtype=float), track(scores, any_rule, **how).q)


@few
@given(scores=st.lists(score, max_size=30), twos=st.integers(-20, 20), how=setting)
@pytest.mark.parametrize(
    ("rule_of", "grows"),
    [
        (lambda k: Fixed(eta=0.05 * k), True),
        (lambda k: Decaying(c=0.5 * k, power=0.6), True),
        (lambda _: RunningMax(c=0.1), False),
        (lambda _: TrailingMax(c=0.1, window=3), False),
    ],
)
def test_a_change_of_unit_changes_the_unit_of_the_thresholds(scores, twos, how, rule_of, grows):
    """Exactly, for a power of two: with steps in the unit (grows) or as shares of the scores."""
    del grows
    k = 2.0**twos
    how = how | {"q0": 0.5}
    small = np.abs(scores) < 1e-200  # below, a power of two is not exact any more
    scores = np.where(small, 0.0, scores)
    q, err = track(scores, rule_of(1.0), **how)
    q_k, err_k = track(scores * k, rule_of(k), **(how | {"q0": 0.5 * k}))
    assert same(err, err_k)
    assert same(q * k, q_k)


@few
@given(
    scores=st.lists(st.floats(0, 2), max_size=60),
    eta=st.floats(0.01, 5),
    alpha=st.floats(0.01, 0.99),
    delay=st.integers(1, 5),
)
def test_the_fixed_step_keeps_its_range_and_its_count(scores, eta, alpha, delay):
    """Corrected forms of the paper's proof: the range of q, and the errors of every window."""
    B, slack = 2.0, 1e-9
    q, err = track(scores, Fixed(eta=eta), alpha=alpha, delay=delay, bounds=(0, B))
    assert (q >= -delay * alpha * eta - slack).all()
    assert (q < B + delay * (1 - alpha) * eta + slack).all()
    excess = np.concatenate([[0.0], np.cumsum(err - alpha)])
    window = np.abs(excess[:, None] - excess[None, :])
    assert (window < B / eta + delay + slack).all()
