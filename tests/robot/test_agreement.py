"""Camera and legs: what is usual passes, what is not ends the run, and that is latched."""

from math import hypot, inf, nan

import pytest
from hypothesis import given
from hypothesis import strategies as st

from cpl.robot.agreement import Agreement, AgreementConfig, compare

CONFIG = AgreementConfig()


def walk(places, config=CONFIG):
    """Compare `(camera, legs)` ten times a second; return the states."""
    state, states = Agreement(), []
    for k, (camera, legs) in enumerate(places):
        state = compare(state, k / 10, camera, legs, config)
        states.append(state)
    return states


def test_two_places_that_agree_do_so_for_ever():
    states = walk([((0.1 * k, 0.02 * k), (0.1 * k, 0.0)) for k in range(60)])
    assert not states[-1].broken
    assert states[-1].walked_m == pytest.approx(5.9)
    assert len(states[-1].parts) <= 11


@pytest.mark.parametrize(
    ("camera", "legs"),
    [
        (lambda k: (0.0, 0.0), lambda k: (0.1 * k, 0.0)),  # a camera that stands still
        (lambda k: (0.1 * k, 0.0), lambda k: (0.0, 0.0)),  # legs that do
        (lambda k: (0.0, 0.1 * k), lambda k: (0.1 * k, 0.0)),  # a frame that is turned
        (lambda k: (0.1 * k - 0.5 * (k > 9), 0.0), lambda k: (0.1 * k, 0.0)),  # a jump
        (lambda k: (0.1 * max(k - 10, 0), 0.0), lambda k: (0.1 * k, 0.0)),  # a second late
    ],
)
def test_two_places_that_part_stay_parted(camera, legs):
    states = walk([(camera(k), legs(k)) for k in range(12)] + [((0.0, 0.0), (0.0, 0.0))] * 5)
    first = next(k for k, state in enumerate(states) if state.broken)
    assert all(state.broken for state in states[first:])
    assert hypot(*states[first].parts[-1][1:]) <= 0.65  # a jump may be farther than a limit


@pytest.mark.parametrize("legs", [(nan, 0.0), (0.0, inf)])
def test_legs_that_say_no_number_agree_with_nothing(legs):
    assert walk([((0.0, 0.0), legs)])[0].broken


@given(st.lists(st.tuples(*[st.floats(-4, 4)] * 4), max_size=20))
def test_what_is_not_parted_is_near(places):
    for state, (x, y, u, v) in zip(walk([(p[:2], p[2:]) for p in places]), places, strict=True):
        assert state.broken or hypot(x - u, y - v) <= CONFIG.apart_m


def test_limits_are_checked():
    with pytest.raises(ValueError, match="apart_m must be finite and above 0, not -1"):
        AgreementConfig(apart_m=-1)
