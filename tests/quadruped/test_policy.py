"""The policy's feedback is two steps late, and it is held against the threshold that was issued."""

import math

import numpy as np
import pytest

from cpl.conformal import Fixed, Tracker
from cpl.quadruped import GainLimits, Policy, PolicyConfig, constant_gain, corrected_gain

WIDE = GainLimits(kp_min=0.8, kp_max=4.0)
X = np.zeros(47)


def test_the_quantile_by_hand():
    """l_hat = .5 always; errors 0 0 1 0: every score is .5, known two steps later."""
    config = PolicyConfig(rule=Fixed(eta=0.1), alpha=0.2)
    policy = Policy(corrected_gain, WIDE, config, forecast=lambda x: 0.5)
    decisions = [policy.decide(X, error) for error in (False, False, True, False)]
    np.testing.assert_allclose([d.q for d in decisions], [0, 0, 0.08, 0.16])
    assert [d.err for d in decisions] == [None, None, True, True]
    np.testing.assert_allclose([d.score for d in decisions], [math.nan, math.nan, 0.5, 0.5])


def test_it_is_the_tracker_with_delay_two():
    rng = np.random.default_rng(0)
    forecasts, errors = rng.random(200), rng.random(200) < 0.3
    given = iter(forecasts)
    policy = Policy(corrected_gain, WIDE, PolicyConfig(), forecast=lambda x: next(given))
    q = [policy.decide(X, bool(error)).q for error in errors]
    simulated = Tracker(PolicyConfig().rule, alpha=0.2, delay=2)
    expected = []
    for t in range(198):
        expected.append(simulated.q)
        simulated.update(abs(float(errors[t + 2]) - forecasts[t]))
    np.testing.assert_allclose(q[:198], expected)


def test_without_a_forecast_nothing_is_tracked():
    policy = Policy(constant_gain, WIDE, PolicyConfig())
    decisions = [policy.decide(X, True) for _ in range(5)]
    assert {d.kp for d in decisions} == {1.5}
    assert all(math.isnan(d.l_hat) and d.q == 0.0 and d.err is None for d in decisions)


def test_the_first_gain_is_clipped_into_the_range():
    assert Policy(constant_gain, GainLimits(kp_min=2, kp_max=3), PolicyConfig()).kp == 2


def test_an_oracle_needs_a_future():
    policy = Policy(corrected_gain, WIDE, PolicyConfig(), oracle=True)
    assert policy.decide(X, False, lambda: 1.0).l_hat == 1.0
    with pytest.raises(ValueError, match="peek must be given"):
        policy.decide(X, False)
    with pytest.raises(ValueError, match="oracle must be False"):
        Policy(corrected_gain, WIDE, PolicyConfig(), forecast=lambda x: 0.0, oracle=True)
