"""The online tracker: one score in, one threshold out, in plain Python."""

import copy
import math
from collections import deque
from collections.abc import Iterator
from sys import float_info
from typing import SupportsFloat

import numpy as np
from numpy.typing import ArrayLike

from cpl.conformal._validate import (
    as_bounds,
    as_integer,
    as_number,
    as_probability,
    as_score,
    as_scores,
)
from cpl.conformal.rules import PI, Fixed, Rule, as_rule
from cpl.conformal.sequence import Track
from cpl.conformal.state import Running, StateRule

__all__ = ["Tracker"]


class Tracker:
    r"""Follow the (1 - alpha)-quantile of scores that come one at a time.

    $$q_{t+1} = q_t + \eta_t (\mathrm{err}_t - \alpha), \qquad \mathrm{err}_t = 1\{s_t > q_t\}$$

    Paper: eq. (4), corrected. ``q`` is the threshold that the next score meets. A score equal to
    it is covered.

    With ``delay=1`` the error of time t is known when q[t+1] is formed. With ``delay=h`` the
    event of time t takes effect when q[t+h] is formed: ``update`` still takes the score of time t
    at time t (as a simulation has it), says at once whether it was covered, and keeps the event
    back. A *live* loop does not have that score yet: it keeps the threshold it issued, and hands
    both in with ``feedback`` when the score arrives. Both give the same thresholds.

    Memory is O(delay) for every rule, plus what the rule itself keeps (the window of the trailing
    ones, the state of a member of the family); time O(1) an update, plus what that takes.

    An update that is refused, for whatever reason, leaves the tracker as it was.

    Args:
        rule: How large the steps are, e.g. ``Fixed(eta=0.05)``.
        alpha: The miscoverage aimed at, in (0, 1).
        delay: The number of steps h >= 1 after which an error is known.
        q0: The first threshold [score].
        bounds: A declared range (low, high) of the scores; scores outside it are refused.

    Raises:
        ValueError: If an argument is out of range, naming it and its value.

    Examples:
        A miss lifts the threshold by (1 - alpha) eta = 0.75, a covered score lowers it by 0.25:

        >>> tracker = Tracker(Fixed(eta=1.0), alpha=0.25)
        >>> [(tracker.q, tracker.update(score)) for score in (2.0, 0.75, 0.6)]
        [(0.0, True), (0.75, False), (0.5, True)]
        >>> tracker.q
        1.25
        >>> tracker.update(float("nan"))
        Traceback (most recent call last):
        ...
        ValueError: score must be finite, got nan
        >>> tracker.q
        1.25
    """

    __slots__ = (
        "_constant",
        "_down",
        "_high",
        "_integral",
        "_low",
        "_p",
        "_pending",
        "_q",
        "_running",
        "_stepper",
        "_up",
        "alpha",
        "bounds",
        "delay",
        "q0",
        "rule",
    )

    def __init__(
        self,
        rule: Rule,
        *,
        alpha: float,
        delay: int = 1,
        q0: float = 0.0,
        bounds: tuple[float, float] | None = None,
    ) -> None:
        self.rule = as_rule(rule)
        self.alpha = as_probability("alpha", alpha)
        self.delay = as_integer("delay", delay, minimum=1)
        self.q0 = as_number("q0", q0) + 0.0  # no negative zero
        self.bounds = as_bounds(bounds)
        # One comparison with the range refuses NaN, the infinities and what lies outside.
        self._low, self._high = self.bounds or (-float_info.max, float_info.max)
        # The two moves of a fixed step with ordinary feedback need no rule to be asked; a step
        # below a tenth of the greatest number's last place cannot move q out of range, either.
        eta = rule.eta if isinstance(rule, Fixed) else 0.0
        self._constant = self.delay == 1 and 0.0 < eta < 1e290
        self._up, self._down = eta * (1.0 - self.alpha), eta * self.alpha
        self.reset()

    def __repr__(self) -> str:
        return f"Tracker({self.rule!r}, alpha={self.alpha}, delay={self.delay}, q={self.q})"

    @property
    def q(self) -> float:
        """The threshold that the next score meets [score]; some rules let it be infinite."""
        return self._q

    @property
    def pending(self) -> int:
        """The number of scores taken whose errors have not been fed back yet, < ``delay``."""
        return len(self._pending)

    def update(self, score: SupportsFloat) -> bool:
        """Take the score of this step; return whether it was missed, ``score > q``.

        Args:
            score: A finite number, within the declared range if there is one. Narrower floats and
                integers are converted.

        Returns:
            The error of this step, known to the caller at once; the tracker itself acts on it
            ``delay`` steps later.

        Raises:
            ValueError: If the score is refused, or moves the threshold out of the range of
                floats. The tracker is unchanged.
        """
        if type(score) is not float or not self._low <= score <= self._high:
            score = as_score(score, self.bounds)
        q = self._q
        if self._constant:
            if score > q:
                self._q = q + self._up
                return True
            self._q = q - self._down
            return False
        err = score > q
        pending = self._pending
        if len(pending) + 1 < self.delay:
            pending.append((score, q))
        elif pending:
            self._apply(*pending[0])
            pending.popleft()
            pending.append((score, q))
        else:
            self._apply(score, q)
        return err

    def feedback(self, score: SupportsFloat, met: float) -> bool:
        """Take a score that arrives late, with the threshold it met; it takes effect now.

        For a live loop, where the outcome of a forecast is seen h steps after the threshold was
        issued: keep ``(forecast, tracker.q)`` in a queue, and hand in the oldest one's score and
        threshold. What is left in the queue when an episode ends is dropped with the queue.

        Args:
            score: As in ``update``.
            met: The threshold that this score met, i.e. ``q`` when the forecast was made; it may
                be infinite.

        Returns:
            Whether the score was missed, ``score > met``.

        Raises:
            ValueError: If an argument is refused, or the tracker keeps a queue of its own
                (``delay`` > 1). The tracker is unchanged.

        Examples:
            Feedback that comes two steps late, as a live loop gets it and as a simulation does:

            >>> live = Tracker(Fixed(eta=1.0), alpha=0.25)
            >>> simulated = Tracker(Fixed(eta=1.0), alpha=0.25, delay=2)
            >>> issued, thresholds = [], []
            >>> for t, score in enumerate([2.0, 2.0, 2.0, 2.0]):
            ...     if t >= 2:
            ...         _ = live.feedback(*issued[t - 2])
            ...     issued.append((score, live.q))
            ...     thresholds.append((live.q, simulated.q))
            ...     _ = simulated.update(score)
            >>> thresholds
            [(0.0, 0.0), (0.0, 0.0), (0.75, 0.75), (1.5, 1.5)]
        """
        if self.delay != 1:
            msg = f"delay must be 1 for feedback (the caller keeps the queue), got {self.delay!r}"
            raise ValueError(msg)
        checked = as_score(score, self.bounds)
        if not isinstance(met, float) or math.isnan(met):
            met = as_number("met", met)
        self._apply(checked, met)
        return checked > met

    def extend(self, scores: ArrayLike) -> Track:
        """Take scores one after the other, as ``update`` does, in one plain Python loop.

        Args:
            scores: Finite numbers, shape (T,).

        Returns:
            The thresholds met and the errors. If any score is refused, none is taken.

        Examples:
            >>> Tracker(Fixed(eta=1.0), alpha=0.25).extend([2.0, 0.75, 0.6]).q
            array([0.  , 0.75, 0.5 ])
        """
        checked = as_scores(scores, ndim=1, bounds=self.bounds)
        values: list[float] = checked.tolist()
        if self._constant:
            met = _march(values, self._q, self._up, self._down)
            q = np.fromiter(met, np.float64, len(values) + 1)
            self._q = float(q[-1])
            return Track(q[:-1], checked > q[:-1])
        q = np.array(self._extend_any(values), dtype=np.float64)
        return Track(q, checked > q)

    def drop_pending(self) -> int:
        """End an episode that the next one carries on: forget the errors not yet fed back.

        With delay h the last h - 1 scores of an episode are still under way when it ends, and
        they never arrive. The threshold and what the rule remembers stay.

        Returns:
            How many were dropped.
        """
        dropped = len(self._pending)
        self._pending.clear()
        return dropped

    def reset(self, q0: float | None = None) -> None:
        """Start anew: the threshold at ``q0``, the rule without memory, nothing under way.

        Args:
            q0: The threshold to start from; None is the one the tracker was made with.
        """
        start = self.q0 if q0 is None else as_number("q0", q0) + 0.0
        rule = self.rule
        self._q = start
        self._p = start  # the proportional state, where an integral comes on top of it
        self._pending: deque[tuple[float, float]] = deque()
        self._running = self._stepper = self._integral = None
        if isinstance(rule, StateRule):
            self._running = Running(rule, self.alpha, start)
        elif isinstance(rule, PI):
            self._stepper = rule.rule.stepper()
            self._integral = _Integral(rule, self.alpha)
        else:
            self._stepper = rule.stepper()

    def _apply(self, score: float, met: float) -> None:
        """Move by one event of feedback; nothing is changed before the last check."""
        if self._stepper is None:
            self._apply_state(score, met)
            return
        err = score > met
        step = self._stepper.peek(score)
        p = self._q if self._integral is None else self._p
        p = p + step * (1.0 - self.alpha) if err else p - step * self.alpha
        if p - p != 0.0:
            raise ValueError(_overflow(score))
        self._stepper.push(score)
        self._p = p
        self._q = p if self._integral is None else self._integral.onto(p, err)

    def _apply_state(self, score: float, met: float) -> None:
        if self._running is not None:
            if not self._running.take(score, met):
                raise ValueError(_overflow(score))
            self._q = self._running.q

    def _extend_any(self, scores: list[float]) -> list[float]:
        trial = copy.deepcopy(self)
        met: list[float] = []
        for score in scores:
            met.append(trial.q)
            trial.update(score)
        for name in ("_p", "_q", "_pending", "_running", "_stepper", "_integral"):
            setattr(self, name, getattr(trial, name))
        return met


class _Integral:
    """The integral part of ``PI``: it counts, so that its sum has no rounding of its own."""

    __slots__ = ("alpha", "events", "misses", "rule")

    def __init__(self, rule: PI, alpha: float) -> None:
        self.rule = rule
        self.alpha = alpha
        self.misses = 0
        self.events = 0

    def onto(self, p: float, err: bool) -> float:
        """Count one more event and return ``p`` plus the integral."""
        rule = self.rule
        known = self.misses
        self.misses += err
        self.events += 1
        if rule.lag == 0:
            known = self.misses
        x = known - (self.events - rule.lag) * self.alpha
        z = x * math.log(self.events) / (rule.C_sat * self.events)
        if rule.K_I == 0.0:
            return p
        if abs(z) >= 0.5 * math.pi:
            return math.copysign(math.inf, z)
        return p + rule.K_I * math.tan(z)


def _march(scores: list[float], q: float, up: float, down: float) -> Iterator[float]:
    """Yield the thresholds of a fixed step, the one after the last score included."""
    yield q
    for score in scores:
        q = q + up if score > q else q - down
        yield q


def _overflow(score: float) -> str:
    return f"score must not move the threshold beyond the range of floats, got {score!r}"
