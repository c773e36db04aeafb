"""Gain rules: tables by hand, and the law that the printed rule breaks."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from cpl.quadruped.gains import (
    GAIN_RULES,
    GainLimits,
    constant_gain,
    corrected_gain,
    false_positive,
    no_quantile_gain,
    paper_gain,
)

WIDE = GainLimits(kp_min=0.8, kp_max=4.0)
unit = st.floats(0, 1)


@pytest.mark.parametrize(
    ("l_hat", "q", "paper", "corrected", "no_quantile"),
    [
        (0.1, 0.1, 1.1, 1.1, 1.1),  # safe and sure
        (0.5, 0.25, 1.1, 1.1, 1.1),  # 0.75 < 0.8
        (0.5, 0.3, 0.8, 0.8, 1.1),  # exactly 0.8: slow (contradiction 5)
        (0.7, 0.3, 0.8, 0.8, 1.1),  # alarm: 0.7 - 0.3 is not below 0.2
        (0.9, 0.0, 0.8, 0.8, 0.8),  # all agree
        (0.6, 0.55, 1.1, 0.8, 1.1),  # taken for a false positive
        (0.9, 0.9, 1.1, 0.8, 0.8),  # near certain error, useless prediction: speeds up
        (0.05, 1.0, 0.8, 0.8, 1.1),  # 1.05 is not above 1.1
    ],
)
def test_rules_by_hand(l_hat, q, paper, corrected, no_quantile):
    assert paper_gain(1.0, l_hat, q, WIDE) == pytest.approx(paper)
    assert corrected_gain(1.0, l_hat, q, WIDE) == pytest.approx(corrected)
    assert no_quantile_gain(1.0, l_hat, q, WIDE) == pytest.approx(no_quantile)
    assert constant_gain(1.0, l_hat, q, WIDE) == 1.0


@given(st.floats(0.01, 10), unit, st.floats(-0.5, 1.5))
def test_every_rule_stays_in_its_range(kp, l_hat, q):
    for rule in GAIN_RULES.values():
        assert WIDE.kp_min <= rule(kp, l_hat, q, WIDE) <= WIDE.kp_max


@pytest.mark.parametrize("name", ["corrected", "no_quantile", "constant"])
@given(unit, unit, unit, unit)
def test_more_risk_or_doubt_never_speeds_up(name, l_hat, more, q, doubt):
    rule = GAIN_RULES[name]
    riskier = rule(1.5, max(l_hat, more), max(q, doubt), WIDE)
    assert riskier <= rule(1.5, min(l_hat, more), min(q, doubt), WIDE)


@pytest.mark.xfail(strict=True, reason="contradiction 7: the printed rule is not monotone")
def test_the_printed_rule_never_speeds_up_with_more_doubt():
    assert paper_gain(1.0, 0.6, 0.6, WIDE) <= paper_gain(1.0, 0.6, 0.3, WIDE)


@given(unit, unit)
def test_the_false_positive_rule_needs_a_quantile_above_045(l_hat, q):
    if false_positive(l_hat, q):
        assert q > 0.45 - 1e-12


@given(st.floats(0.1, 1, exclude_min=True))
def test_at_q_one_everything_above_a_tenth_is_called_a_false_positive(l_hat):
    assert false_positive(l_hat, 1.0) == (l_hat + 1.0 > 1.1)


def test_slow_share_at_which_the_gain_keeps_still():
    """0.8^s 1.1^(1-s) = 1 at s = 29.9 % (contradiction 12)."""
    from math import log

    share = log(1.1) / (log(1.1) - log(0.8))
    assert share == pytest.approx(0.299, abs=5e-4)


def test_limits_are_checked():
    with pytest.raises(ValueError, match=r"kp_min .* not 2.0 with 1.0"):
        GainLimits(kp_min=2.0, kp_max=1.0)
