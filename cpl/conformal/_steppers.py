"""The online half of the step rules: what a rule remembers between two feedback events.

A stepper is asked twice an event: ``peek(score)`` gives the event's step and changes nothing,
``push(score)`` then takes the score in. An update that is refused in between has left no trace.
"""

import math
from collections import deque
from typing import Protocol

__all__ = ["Constant", "Decay", "GreatestEver", "GreatestLately", "RangeBefore", "Stepper"]


class Stepper(Protocol):
    """The state of a step rule along one sequence of feedback events."""

    def peek(self, score: float) -> float:
        """Return the step of the event that brings ``score``, changing nothing."""
        ...

    def push(self, score: float) -> None:
        """Take the score in; the next event begins."""
        ...


class Constant:
    """One step for all events."""

    __slots__ = ("eta",)

    def __init__(self, eta: float) -> None:
        self.eta = eta

    def peek(self, score: float) -> float:
        return self.eta

    def push(self, score: float) -> None:
        pass


class Decay:
    """A step that depends on the number of events alone."""

    __slots__ = ("c", "events", "power")

    def __init__(self, c: float, power: float) -> None:
        self.c = c
        self.power = power
        self.events = 0

    def peek(self, score: float) -> float:
        return self.c * math.pow(self.events + 1.0, -self.power)

    def push(self, score: float) -> None:
        self.events += 1


class GreatestEver:
    """A share of the greatest magnitude up to and with this event's score."""

    __slots__ = ("c", "greatest")

    def __init__(self, c: float) -> None:
        self.c = c
        self.greatest = 0.0

    def peek(self, score: float) -> float:
        return self.c * max(self.greatest, abs(score))

    def push(self, score: float) -> None:
        self.greatest = max(self.greatest, abs(score))


class GreatestLately:
    """A share of the greatest magnitude among the last scores, this event's included."""

    __slots__ = ("before", "c")

    def __init__(self, c: float, window: int) -> None:
        self.c = c
        self.before = _Crest(window - 1)

    def peek(self, score: float) -> float:
        return self.c * max(self.before.height(), abs(score))

    def push(self, score: float) -> None:
        self.before.push(abs(score))


class RangeBefore:
    """A share of the range of the last scores, this event's excluded; the first step is ``lr``."""

    __slots__ = ("above", "below", "lr")

    def __init__(self, lr: float, window: int) -> None:
        self.lr = lr
        self.above = _Crest(window)
        self.below = _Crest(window)

    def peek(self, score: float) -> float:
        if self.above.pushed == 0:
            return self.lr
        return self.lr * (self.above.height() + self.below.height())

    def push(self, score: float) -> None:
        self.above.push(score)
        self.below.push(-score)


class _Crest:
    """The maximum of the last ``window`` values, in amortised constant time.

    Only values that no later one tops are kept, with their places: a decreasing queue, whose head
    is the maximum.
    """

    __slots__ = ("kept", "pushed", "window")

    def __init__(self, window: int) -> None:
        self.window = window
        self.kept: deque[tuple[int, float]] = deque()
        self.pushed = 0

    def height(self) -> float:
        return self.kept[0][1] if self.kept else 0.0

    def push(self, value: float) -> None:
        while self.kept and self.kept[-1][1] <= value:
            self.kept.pop()
        self.kept.append((self.pushed, value))
        self.pushed += 1
        if self.kept[0][0] < self.pushed - self.window:
            self.kept.popleft()
