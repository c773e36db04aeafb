"""Can the robot move without a fresh order? Every interleaving of a small model is looked at.

Policy, watchdog, second, robot, the link between policy and watchdog and the cable to the robot
take turns of 0.05 s. In each turn an adversary chooses what becomes of each datagram (it arrives,
it waits, it comes twice; waiting for ever is loss), whether the cable carries, loses or delays,
and, as often as it is allowed, which process is killed, hangs or goes on. All choices are followed.

The model decides nothing itself: whether an order is taken, what the robot is asked for and when a
watchdog is believed dead is what :func:`cpl.robot.lease.take`, :func:`cpl.robot.lease.ask` and
:func:`cpl.robot.second.judge` say, the functions that run. Only their time is another: whole turns.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from itertools import product
from typing import NamedTuple

from cpl.robot.envelope import Envelope
from cpl.robot.interfaces import ZERO, Mode
from cpl.robot.lease import LeaseConfig, LeaseState, ask, end, take
from cpl.robot.packets import Order
from cpl.robot.second import PATIENCE_S, Pulse, Seen, judge

__all__ = ["FRESH", "TURN_S", "Found", "search"]

TURN_S = 0.05  # [s]
LEASE = LeaseConfig(lease_s=4, zero_s=10, answer_s=5, link_s=20)  # turns: the defaults
FRESH = 5  # [turns] an order's lease, and a turn on the way
PATIENCE = PATIENCE_S / TURN_S
OF_SECOND = 5  # [turns] a watchdog's patience with its second
SILENT = 6  # [turns] a policy's patience with its watchdog
STALE = 4  # [turns] an order that rests on what is so old is none, however much older it is
OLD = 15  # [turns] nor does it matter how much longer than this an order has been held
UNHEARD = 21  # [turns] or the robot has not answered
CALM = 10  # [turns] or nothing has happened
GO = (0.5, 0.0, 0.0)
WELL, HUNG, DEAD = 0, 1, 2
NOTHING = -2  # nothing is delayed


class State(NamedTuple):
    """Everything there is to know, with ages in turns in the place of times.

    `basis`, `decided`, `order`, `since` and `held` are the ages of the report that the policy
    knows, of the one that its next order rests on, of the one that an order under way rests on, of
    the one that the watchdog's order rests on, and of the one that the robot's velocity comes from.
    -1 is none: no order is under way, the robot stands still. `calm` counts since the adversary
    last hurt a process or the cable; `left` is how often it may hurt a process.
    """

    policy: int = WELL
    watchdog: int = WELL
    second: int = WELL
    basis: int = 0
    decided: int = 0
    order: int = -1
    walks: bool = True
    moves: bool = True
    since: int = 1
    tripped: bool = False
    quiet: int = 0
    answered: int = 0
    beat: int = 0
    beat_of_second: int = 0
    report: int = 0
    taken_over: bool = False
    held: int = 1
    delayed: int = NOTHING
    calm: int = CALM
    left: int = 1


@dataclass(frozen=True, kw_only=True)
class Found:
    """What a search found.

    Attributes:
        depth: How far it looked [turns].
        faults: How many times a process could be killed, hang or go on.
        states: How many different ones there are.
        steps: How many choices of the adversary were followed.
        oldest: The oldest order that moved the robot, whatever happened [turns].
        settled: From so many turns on after process or cable were last hurt the robot stands still,
            or moves on an order that is fresh.
    """

    depth: int
    faults: int
    states: int
    steps: int
    oldest: int
    settled: int


def search(depth: int, faults: int = 1) -> Found:
    """Follow all choices from a robot that walks.

    Args:
        depth: How far to look [turns].
        faults: How many times a process may be killed, hang or go on.

    >>> search(4).settled
    0
    """
    begun = State(left=faults)
    seen, layer, steps = {begun}, {begun}, 0
    oldest, settled = begun.held, 0
    for _ in range(depth):
        after: set[State] = set()
        for state in layer:
            for following in _turns(state):
                steps += 1
                after.add(following)
        layer = after - seen
        seen |= layer
        for state in layer:
            oldest = max(oldest, state.held)
            if state.held > FRESH:
                settled = max(settled, state.calm + 1)
    return Found(
        depth=depth,
        faults=faults,
        states=len(seen),
        steps=steps,
        oldest=oldest,
        settled=settled,
    )


def _turns(state: State) -> Iterator[State]:
    """Yield what may be after one turn."""
    for hurt in _hurt(_older(state)):
        times = (0, 1, 2) if hurt.order >= 0 and hurt.watchdog == WELL else (0,)
        for arrivals, heard in product(times, _reports(hurt)):
            for carried in _cable(_stand_by(_watch(heard, arrivals))):
                yield from _decide(carried)


def _older(state: State) -> State:
    """Let a turn pass."""
    tripped, order = state.tripped, state.order + 1
    return state._replace(
        basis=min(state.basis + 1, STALE),
        decided=min(state.decided + 1, STALE),
        order=order if 0 < order < STALE else -1,
        since=0 if tripped else min(state.since + 1, OLD),
        quiet=min(state.quiet + 1, OLD) if tripped else 0,
        answered=0 if tripped else min(state.answered + 1, UNHEARD),
        beat=min(state.beat + 1, 3),
        beat_of_second=min(state.beat_of_second + 1, OF_SECOND + 1),
        report=min(state.report + 1, SILENT + 1),
        held=min(state.held + 1, OLD) if state.held >= 0 else -1,
        delayed=min(state.delayed + 1, OLD) if state.delayed >= 0 else state.delayed,
        calm=min(state.calm + 1, CALM),
    )


def _hurt(state: State) -> Iterator[State]:
    """Let nobody, or one process, be hurt or go on."""
    yield state
    if state.left == 0:
        return
    less = state._replace(left=state.left - 1, calm=0)
    for who in ("policy", "watchdog", "second"):
        was = getattr(state, who)
        if was != DEAD:
            yield less._replace(**{who: DEAD})
            yield less._replace(**{who: HUNG if was == WELL else WELL})


def _reports(state: State) -> Iterator[State]:
    """Let the watchdog's report be lost, come at once, or come two turns late."""
    yield state
    if state.watchdog == WELL and state.policy == WELL:
        yield state._replace(basis=0, report=0)
        if state.basis > 2:
            yield state._replace(basis=2, report=0)


def _watch(state: State, arrivals: int) -> State:
    """Let the watchdog, if it is well, take an order that comes, and decide what to ask for."""
    if state.watchdog != WELL:
        return state
    walks, moves, since, tripped, quiet = _watchdog(
        state.walks,
        state.since,
        state.quiet if state.tripped else -1,
        state.order if arrivals else -1,
        arrivals,
        state.answered,
        state.beat_of_second,
        state.second == DEAD,
    )
    return state._replace(
        walks=walks,
        moves=moves,
        since=since,
        tripped=tripped,
        quiet=quiet,
        order=-1 if arrivals else state.order,
        beat=0,
    )


@cache
def _watchdog(
    walks: bool,
    since: int,
    quiet: int,
    order: int,
    arrivals: int,
    answered: int,
    beat: int,
    dead: bool,
) -> tuple[bool, bool, int, bool, int]:
    """Ask the functions that run."""
    lease = LeaseState(
        since_s=-since,
        mode=Mode.WALK if walks else Mode.STAND,
        command=GO if walks else ZERO,
        tripped="it is over" if quiet >= 0 else "",
        quiet_s=-max(quiet, 0),
    )
    for _ in range(arrivals):
        said = Order(run=1, hello=1, number=1, heard_s=-order, mode=Mode.WALK, command=GO)
        lease = take(lease, said, 0, LEASE, Envelope())
    pulse = Pulse(heard_s=-beat, closed=dead, idle=False)
    if judge(pulse, 0, OF_SECOND) is Seen.GONE:
        lease = end(lease, 0, "its second is gone")
    lease, mode, command = ask(lease, 0, -answered, LEASE)
    over = bool(lease.tripped)
    age = 0 if over else min(round(-lease.since_s), OLD)
    quiet = min(round(-lease.quiet_s), OLD) if over else 0
    return lease.mode is Mode.WALK and mode is Mode.WALK, command != ZERO, age, over, quiet


def _stand_by(state: State) -> State:
    """Let the second, and then the policy, see whether the watchdog is there."""
    if state.second == WELL:
        state = state._replace(beat_of_second=0)
        if not state.taken_over and _judged(state.beat, state.watchdog == DEAD) is Seen.GONE:
            state = state._replace(watchdog=DEAD, taken_over=True)
    if state.policy == WELL and state.report > SILENT:
        state = state._replace(watchdog=DEAD, taken_over=True)
    return state


@cache
def _judged(beat: int, dead: bool) -> Seen:
    return judge(Pulse(heard_s=-beat, closed=dead, idle=False), 0, PATIENCE)


def _cable(state: State) -> Iterator[State]:
    """Let what is sent to the robot arrive, be lost, or take a turn longer."""
    if state.delayed != NOTHING:  # what was delayed arrives first
        state = state._replace(held=state.delayed, delayed=NOTHING)
    taken = state.taken_over and WELL in (state.second, state.policy)
    if state.watchdog != WELL and not taken:
        yield state  # nobody speaks
        return
    sent = state.since if state.watchdog == WELL and state.moves else -1
    heard = state.watchdog == WELL and not state.tripped
    yield state._replace(held=sent, answered=0 if heard else state.answered)
    yield state._replace(calm=0)
    yield state._replace(delayed=sent, calm=0)


def _decide(state: State) -> Iterator[State]:
    """Let the policy send what it decided a turn ago, and decide anew.

    A newer order takes the place of one that waits, or is lost.
    """
    if state.policy != WELL:
        yield state
        return
    decided = state._replace(decided=state.basis)
    if state.decided < STALE:
        yield decided._replace(order=state.decided)
    if state.order >= 0 or state.decided >= STALE:
        yield decided
