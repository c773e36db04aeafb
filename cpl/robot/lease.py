"""How long does an order hold? The watchdog's decision, as pure functions of state and time.

An order holds for `lease_s` from the moment at which it was *decided*, not at which it came. What
ends it is latched: a watchdog that tripped asks for zero, then lets the robot stand, and obeys no
more. `take` and `ask` are the functions that run, and those that `cpl.robot.search` and
`cpl.robot.certificates` check.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from cpl.robot.envelope import Envelope, clamp
from cpl.robot.interfaces import ZERO, Command, Mode
from cpl.robot.packets import Order

__all__ = ["LeaseConfig", "LeaseState", "ask", "end", "take"]


@dataclass(frozen=True, kw_only=True)
class LeaseConfig:
    """How long an order holds.

    Args:
        lease_s: An order that was decided longer ago than this is none [s].
        zero_s: After so long at zero velocity, stand, for good [s].
        answer_s: While the robot has not answered for this long it is asked for zero, so that a
            link that comes back carries zero first [s].
        link_s: Without an answer for this long it is over [s].
    """

    lease_s: float = 0.2
    zero_s: float = 0.5
    answer_s: float = 0.25
    link_s: float = 1.0

    def __post_init__(self) -> None:
        for name in self.__dataclass_fields__:
            if not 0 < getattr(self, name) < 60:
                raise ValueError(f"{name} must be in (0, 60), not {getattr(self, name)}")


@dataclass(frozen=True, kw_only=True)
class LeaseState:
    """What a watchdog remembers.

    Args:
        number: Of the last order taken.
        since_s: When that was decided, by the watchdog's clock [s].
        mode: What it asked for; IDLE before there is one.
        command: v_x [m/s], v_y [m/s], yaw rate [rad/s], inside the envelope.
        tripped: Why orders are no longer obeyed; empty while they are.
        quiet_s: Since when it is tripped [s].
    """

    number: int = 0
    since_s: float = 0.0
    mode: Mode = Mode.IDLE
    command: Command = ZERO
    tripped: str = ""
    quiet_s: float = 0.0


def take(
    state: LeaseState, order: Order, now: float, config: LeaseConfig, envelope: Envelope
) -> LeaseState:
    """Take an order of this run, if it is newer than the last and fresh.

    Args:
        state: What was remembered.
        order: Its seal, its run and its sender were looked at already.
        now: The watchdog's time [s].
        config: How long an order holds.
        envelope: What no command leaves.

    >>> order = Order(run=1, hello=1, number=1, heard_s=4.9, mode=Mode.WALK, command=(0.5, 0, 0))
    >>> [take(LeaseState(), order, t, LeaseConfig(), Envelope()).mode.name for t in (5.0, 9.0)]
    ['WALK', 'IDLE']
    """
    if state.tripped or order.number <= state.number:
        return state
    if order.last:  # whoever asks for the end may be late
        return end(replace(state, number=order.number), now, "told to end")
    if not 0 <= now - order.heard_s < config.lease_s or order.mode is Mode.IDLE:
        return state
    walks = order.mode is Mode.WALK
    return replace(
        state,
        number=order.number,
        since_s=order.heard_s,
        mode=order.mode,
        command=clamp(order.command, envelope) if walks else ZERO,
    )


def end(state: LeaseState, now: float, why: str) -> LeaseState:
    """Obey no more: zero velocity from now on, then stand."""
    return state if state.tripped else replace(state, tripped=why, quiet_s=now)


def ask(
    state: LeaseState, now: float, answered_s: float, config: LeaseConfig
) -> tuple[LeaseState, Mode, Command]:
    """Return what to ask the robot for at a time.

    Args:
        state: What was remembered.
        now: The watchdog's time [s].
        answered_s: When the robot last answered [s].
        config: How long an order holds.

    Returns:
        What is to be remembered, a mode, and a velocity that is zero unless an order is fresh.

    >>> state = LeaseState(number=1, since_s=0.0, mode=Mode.WALK, command=(0.5, 0.0, 0.0))
    >>> [ask(state, t, t, LeaseConfig())[1:] for t in (0.1, 0.3)]
    [(<Mode.WALK: 2>, (0.5, 0.0, 0.0)), (<Mode.WALK: 2>, (0.0, 0.0, 0.0))]
    >>> tripped, mode, _ = ask(state, 0.8, 0.8, LeaseConfig())
    >>> mode.name, tripped.tripped
    ('STAND', 'no order came in time')
    """
    if state.mode is not Mode.WALK:
        return state, state.mode, ZERO
    age = now - state.since_s
    if age < 0:
        state = end(state, now, "its clock ran backwards")
    elif age >= config.lease_s + config.zero_s:
        state = end(state, now - config.zero_s, "no order came in time")
    elif now - answered_s > config.link_s:
        state = end(state, now, "the robot does not answer")
    if state.tripped:
        stands = not 0 <= now - state.quiet_s < config.zero_s
        return state, Mode.STAND if stands else Mode.WALK, ZERO
    fresh = age < config.lease_s and now - answered_s <= config.answer_s
    return state, Mode.WALK, state.command if fresh else ZERO
