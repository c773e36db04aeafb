"""Every way in which feedback can be late, out of order, lost or wrong, in small cases."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from functools import cache
from typing import NamedTuple

from cpl.conformal.rational import Number, count, level, positive

__all__ = ["TroubledExtremes", "search_trouble"]


@dataclass(frozen=True, kw_only=True)
class TroubledExtremes:
    """What an adversary of scores and of feedback can do.

    Attributes:
        states: States that can be reached.
        low: The lowest virtual quantile [score].
        high: The highest [score].
        most: Entry W - 1: the most misses in any W steps, over what is lost or wrong inside and
            before, as (misses, lost, false covers in the window, false covers before).
        least: The fewest, as (misses, lost, false misses in the window, false misses before).
    """

    states: int
    low: Fraction
    high: Fraction
    most: tuple[frozenset[tuple[int, int, int, int]], ...]
    least: tuple[frozenset[tuple[int, int, int, int]], ...]


class _State(NamedTuple):
    q: int
    misses: int  # reported misses on their way
    covers: int  # reported covers on their way
    lost: int  # scores that may still be lost, now and later
    false_misses: int
    false_covers: int


class _Event(NamedTuple):
    err: int
    lost: int
    false_miss: int
    false_cover: int


def search_trouble(
    alpha: Number,
    eta: Number,
    B: Number,
    W_max: int,
    *,
    outstanding: int,
    lost: int = 0,
    false_misses: int = 0,
    false_covers: int = 0,
) -> TroubledExtremes:
    """Search all scores and all ways to deliver their feedback, for `q_1 = 0`.

    Each step a score meets q; whether it is reported, truly or not, is decided within budgets for
    the whole sequence; then any of what is on its way arrives, in any order, as long as fewer than
    `outstanding` feedbacks stay behind. Budgets bound what is said of bursts and windows alike.

    Args:
        alpha: miscoverage level in (0, 1).
        eta: step size > 0 [score].
        B: largest score > 0 [score].
        W_max: longest window [steps].
        outstanding: thresholds whose feedback is still to come, the newest included.
        lost: budget of feedback that never comes.
        false_misses: budget of covers reported as misses.
        false_covers: budget of misses reported as covers.

    Examples:
        >>> prompt = search_trouble(0.5, 1, 1, 3, outstanding=1)
        >>> [max(found)[0] for found in prompt.most]
        [1, 2, 3]
    """
    budgets = (lost, false_misses, false_covers)
    start = _State(0, 0, 0, *(count(b, "budget", least=0) for b in budgets))
    game = _Game(alpha, positive(B, "B") / positive(eta, "eta"), count(outstanding, "outstanding"))
    after = game.explore(start)

    @cache
    def totals(state: _State, steps: int) -> frozenset[_Event]:
        """Return what windows of some length from a state can add up to."""
        if not steps:
            return frozenset([_Event(0, 0, 0, 0)])
        return frozenset(
            _Event(*(x + y for x, y in zip(event, rest, strict=True)))
            for event, following in after[state]
            for rest in totals(following, steps - 1)
        )

    most: list[frozenset[tuple[int, int, int, int]]] = []
    least: list[frozenset[tuple[int, int, int, int]]] = []
    for steps in range(1, count(W_max, "W_max") + 1):
        found = [(state, total) for state in after for total in totals(state, steps)]
        spent = [(start.false_covers - s.false_covers, start.false_misses - s.false_misses)
                 for s, _ in found]  # fmt: skip
        pairs = list(zip(found, spent, strict=True))
        most.append(frozenset((t.err, t.lost, t.false_cover, was[0]) for (_, t), was in pairs))
        least.append(frozenset((t.err, t.lost, t.false_miss, was[1]) for (_, t), was in pairs))
    virtual = [s.q + s.misses * game.up - s.covers * game.down for s in after]
    unit = positive(eta, "eta") / game.scale
    return TroubledExtremes(
        states=len(after),
        low=min(virtual) * unit,
        high=max(virtual) * unit,
        most=tuple(most),
        least=tuple(least),
    )


class _Game:
    """The tracker in whole numbers, and everything that can happen to its feedback."""

    def __init__(self, alpha: Number, ratio: Fraction, room: int) -> None:
        a = level(alpha)
        self.scale = math.lcm(a.denominator, ratio.denominator)
        self.down = int(a * self.scale)
        self.up, self.top, self.room = self.scale - self.down, int(ratio * self.scale), room

    def explore(self, start: _State) -> dict[_State, set[tuple[_Event, _State]]]:
        """Return all states that can be reached, with what can come next."""
        after: dict[_State, set[tuple[_Event, _State]]] = {}
        todo = [start]
        while todo:
            state = todo.pop()
            if state not in after:
                after[state] = set(self._moves(state))
                todo.extend(following for _, following in after[state])
        return after

    def _moves(self, state: _State) -> Iterator[tuple[_Event, _State]]:
        left = state[3:]
        for err in (0, 1):
            if (state.q >= self.top) if err else (state.q < 0):
                continue
            for event in _events(err, *left):
                told = err ^ (event.false_miss | event.false_cover)
                misses = state.misses + (told if not event.lost else 0)
                covers = state.covers + (1 - told if not event.lost else 0)
                rest = (b - spent for b, spent in zip(left, event[1:], strict=True))
                yield from self._arrivals(event, state.q, misses, covers, tuple(rest))

    def _arrivals(
        self, event: _Event, q: int, misses: int, covers: int, rest: tuple[int, ...]
    ) -> Iterator[tuple[_Event, _State]]:
        """Let any of what is on its way arrive, so that the next score finds room."""
        for m in range(misses + 1):
            for c in range(covers + 1):
                if misses - m + covers - c < self.room:
                    moved = q + m * self.up - c * self.down
                    yield event, _State(moved, misses - m, covers - c, *rest)


def _events(err: int, lost: int, false_misses: int, false_covers: int) -> Iterator[_Event]:
    """Return what can happen to a score's feedback, within what is left of the budgets."""
    yield _Event(err, 0, 0, 0)
    if lost:
        yield _Event(err, 1, 0, 0)
    if err and false_covers:
        yield _Event(err, 0, 0, 1)
    if not err and false_misses:
        yield _Event(err, 0, 1, 0)
