import pytest
from hypothesis import given
from hypothesis import strategies as st

from cpl.claims.verdict import Verdict, rule_r
from cpl.stats import Estimate


def effect(value, low, high):
    return Estimate(value=value, low=low, high=high, n=500)


@pytest.mark.parametrize(
    ("value", "low", "high", "claimed", "verdict"),
    [
        (12.0, 11.0, 13.0, 12.8, "holds"),
        (6.4, 0.1, 12.7, 12.8, "holds"),  # exactly half
        (20.0, 18.0, 22.0, 12.8, "holds"),  # more than claimed
        (5.0, 4.0, 6.0, 12.8, "does not hold"),  # there, but its upper bound is under half
        (5.0, 3.0, 7.0, 12.8, "holds in part"),  # smaller
        (4.0, -2.0, 10.0, 12.8, "undecided"),  # spans 0 and half
        (2.0, -2.0, 6.0, 12.8, "does not hold"),  # spans 0, but not half
        (-3.0, -4.0, -2.0, 12.8, "does not hold"),
        (-3.0, -7.0, 0.0, None, "does not hold"),
        (0.5, 0.1, 0.9, None, "holds"),
        (0.5, -0.1, 1.1, None, "undecided"),
        (-0.5, -1.1, 0.1, None, "undecided"),
    ],
)
def test_one_condition(value, low, high, claimed, verdict):
    assert rule_r([effect(value, low, high)], [claimed]) == verdict


YES, SMALL, OPEN, NO = (
    effect(12.0, 11.0, 13.0),
    effect(5.0, 3.0, 7.0),
    effect(4.0, -2.0, 10.0),
    effect(-3.0, -4.0, -2.0),
)


@pytest.mark.parametrize(
    ("effects", "verdict"),
    [
        ([YES, YES, YES], "holds"),
        ([YES, YES, NO], "holds in part"),
        ([YES, OPEN, OPEN], "holds in part"),
        ([SMALL, SMALL], "holds in part"),
        ([SMALL, NO], "holds in part"),
        ([OPEN, NO], "undecided"),
        ([OPEN, OPEN], "undecided"),
        ([NO, NO, NO], "does not hold"),
    ],
)
def test_several_conditions(effects, verdict):
    assert rule_r(effects, [12.8] * len(effects)) == verdict
    assert rule_r(effects[::-1], [12.8] * len(effects)) == verdict


@given(
    st.floats(0.1, 100),
    st.floats(-200, 200),
    st.floats(0, 100),
    st.floats(0, 100),
)
def test_negating_an_effect_never_keeps_holds(claimed, value, below, above):
    there = effect(value, value - below, value + above)
    back = effect(-value, -value - above, -value + below)
    verdicts = {rule_r([there], [claimed]), rule_r([back], [claimed])}
    assert verdicts != {Verdict.HOLDS}
    if Verdict.HOLDS in verdicts:
        assert Verdict.FAILS in verdicts


@pytest.mark.parametrize(
    ("effects", "claimed", "named"),
    [([], [], "got 0 and 0"), ([YES], [1.0, 2.0], "got 1 and 2"), ([YES], [-1.0], "got -1.0")],
)
def test_bad_arguments_are_named(effects, claimed, named):
    with pytest.raises(ValueError, match=named):
        rule_r(effects, claimed)
