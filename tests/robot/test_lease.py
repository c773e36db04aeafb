"""No order outlives its lease, from whenever it was decided; what ended is over."""

from math import hypot, inf

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cpl.robot import Envelope, LeaseConfig, Mode, within
from cpl.robot.lease import LeaseState, ask, end, take
from cpl.robot.packets import Order

CONFIG, ENVELOPE = LeaseConfig(), Envelope()
GO, ZERO = (0.5, 0.1, 0.2), (0.0, 0.0, 0.0)
anything = st.floats(allow_nan=True, allow_infinity=True)
commands = st.tuples(anything, anything, anything)


def order(number, heard_s, mode=Mode.WALK, command=GO, last=False):
    return Order(
        run=1, hello=2, number=number, heard_s=heard_s, mode=mode, command=command, last=last
    )


def after(*events, state=None):
    """Return the state after orders `(time, order)`."""
    state = state or LeaseState()
    for now, wanted in events:
        state = take(state, wanted, now, CONFIG, ENVELOPE)
    return state


def asked(state, now, answered_s=None):
    return ask(state, now, now if answered_s is None else answered_s, CONFIG)


def test_a_silent_policy_means_zero_then_stand():
    assert asked(LeaseState(), 0.0)[1:] == (Mode.IDLE, ZERO)
    state = after((1.0, order(1, 1.0, command=(3.0, 0.0, 0.0))))
    assert 0.99 < hypot(*asked(state, 1.19)[2]) <= 1.0
    state, mode, command = asked(state, 1.21)
    assert (mode, command, state.tripped) == (Mode.WALK, ZERO, "")
    state = after((1.3, order(2, 1.3)), state=state)  # late, but in time
    assert asked(state, 1.35)[1:] == (Mode.WALK, GO)
    state, mode, command = asked(state, 2.01)
    assert (mode, command, state.tripped) == (Mode.STAND, ZERO, "no order came in time")
    state = after((2.1, order(3, 2.1)), state=state)  # too late
    assert asked(state, 2.15)[1:] == (Mode.STAND, ZERO)


def test_an_order_is_as_old_as_what_it_rests_on_and_not_as_its_arrival():
    """What waits in a queue while the watchdog hangs, or the laptop sleeps, is none any more."""
    assert after((9.0, order(1, 5.0))).mode is Mode.IDLE
    state = after((5.15, order(1, 5.0)))
    assert asked(state, 5.19)[2] == GO
    assert asked(state, 5.21)[2] == ZERO
    assert after((5.0, order(1, 6.0))).mode is Mode.IDLE  # from the future


def test_orders_are_obeyed_in_order_only():
    state = after((1.0, order(5, 1.0)), (1.01, order(5, 1.01, command=ZERO)))
    state = after((1.02, order(4, 1.02, command=ZERO)), state=state)
    assert (state.number, state.command) == (5, GO)


def test_zero_is_asked_for_while_the_robot_does_not_answer_and_then_it_is_over():
    state = after((1.0, order(1, 1.0)))
    assert asked(state, 1.1, answered_s=0.8)[2] == ZERO
    assert asked(state, 1.1, answered_s=0.9)[2] == GO
    assert asked(state, 1.1, answered_s=0.0)[0].tripped == "the robot does not answer"
    assert asked(state, 1.1, answered_s=-inf)[2] == ZERO


def test_a_clock_that_runs_backwards_ends_it():
    state, mode, command = asked(after((1.0, order(1, 1.0))), 0.5)
    assert (mode, command, state.tripped) == (Mode.WALK, ZERO, "its clock ran backwards")


def test_the_last_order_may_be_late_and_ends_it():
    state = after((1.0, order(1, 1.0)), (1.1, order(2, 0.0, last=True)))
    assert state.tripped == "told to end"
    assert asked(state, 1.11)[1:] == (Mode.WALK, ZERO)
    assert asked(state, 1.7)[1:] == (Mode.STAND, ZERO)
    assert after((1.2, order(3, 1.2)), state=state) == state


def test_a_robot_that_was_asked_for_nothing_is_asked_for_nothing():
    for state in (LeaseState(), end(LeaseState(), 1.0, "told to end")):
        assert asked(state, 1.5)[1:] == (Mode.IDLE, ZERO)


def test_limits_are_checked():
    for name in LeaseConfig.__dataclass_fields__:
        with pytest.raises(ValueError, match=f"{name} must be in"):
            LeaseConfig(**{name: 0})


events = st.lists(
    st.tuples(
        st.floats(0, 0.4), st.sampled_from(["walk", "stand", "last", "end", ""]), commands,
        st.floats(-0.1, 0.5), st.floats(0, 2),
    ),
    max_size=15,
)  # fmt: skip


@settings(max_examples=100)
@given(events)
def test_nothing_moves_without_a_fresh_order(happened):
    state, now, decided, tripped = LeaseState(), 0.0, -inf, False
    for number, (wait, what, command, late, silent) in enumerate(happened, 1):
        now += wait
        mode = Mode.STAND if what == "stand" else Mode.WALK
        if what == "end":
            state = end(state, now, "told to end")
        elif what:
            before = state
            wanted = order(number, now - late, mode, command, what == "last")
            state = take(state, wanted, now, CONFIG, ENVELOPE)
            decided = now - late if state != before and not state.tripped else decided
        state, mode, sent = ask(state, now, now - silent, CONFIG)
        assert within(sent, ENVELOPE)
        assert (state.tripped != "") >= tripped
        tripped = state.tripped != ""
        if sent != ZERO:
            assert mode is Mode.WALK
            assert not tripped
            assert 0 <= now - decided < CONFIG.lease_s
            assert silent <= CONFIG.answer_s
