"""Many online trackers side by side: one array of scores in, one array of thresholds out."""

import math
from typing import Protocol, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cpl.conformal import _kernels, _states
from cpl.conformal._steppers import Stepper
from cpl.conformal._validate import as_integer, as_number, as_probability
from cpl.conformal.rules import PI, Decaying, Fixed, Rule, RunningMax, StepRule, as_rule
from cpl.conformal.state import StateRule

__all__ = ["BatchTracker"]

FloatArray: TypeAlias = NDArray[np.float64]
BoolArray: TypeAlias = NDArray[np.bool_]
IntArray: TypeAlias = NDArray[np.int64]


class BatchTracker:
    r"""Follow the (1 - alpha)-quantile of n independent streams that advance together.

    $$q_{t+1} = q_t + \eta_t (\mathrm{err}_t - \alpha), \qquad \mathrm{err}_t = 1\{s_t > q_t\}$$

    Paper: eq. (4), corrected. Stream by stream the same numbers as ``Tracker``, bit for bit. A
    mask says which streams have a score now; the others stand still. Streams begin anew, or carry
    on into the next episode, each when its own episode ends.

    Args:
        rule: How large the steps are; each stream has its own state.
        n: The number of streams, >= 1.
        alpha: The miscoverage aimed at, in (0, 1).
        delay: The number of steps h >= 1 after which an error is known; counted in each stream's
            own scores.
        q0: The first threshold [score].

    Raises:
        ValueError: If an argument is out of range, naming it and its value.

    Examples:
        The second stream has no score in the first step:

        >>> trackers = BatchTracker(Fixed(eta=1.0), 2, alpha=0.25)
        >>> trackers.update([2.0, 9.0], np.array([True, False]))
        array([ True, False])
        >>> trackers.q
        array([0.75, 0.  ])
        >>> trackers.update([0.5, 9.0])
        array([False,  True])
        >>> trackers.q
        array([0.5 , 0.75])
    """

    def __init__(
        self, rule: Rule, n: int, *, alpha: float, delay: int = 1, q0: float = 0.0
    ) -> None:
        self.rule = as_rule(rule)
        self.n = as_integer("n", n, minimum=1)
        self.alpha = as_probability("alpha", alpha)
        self.delay = as_integer("delay", delay, minimum=1)
        self.q0 = as_number("q0", q0) + 0.0  # no negative zero
        self._states: _States | None = None
        self._steps: _Steps | None = None
        self._integral: _Integrals | None = None
        if isinstance(rule, StateRule):
            self._states = _States(rule, self.n, self.alpha, self.q0)
        elif isinstance(rule, PI):
            self._steps = _steps_of(rule.rule, self.n)
            self._integral = _Integrals(rule, self.n, self.alpha)
        else:
            self._steps = _steps_of(rule, self.n)
        self._q = np.full(self.n, self.q0)
        self._p = self._q.copy()  # the proportional state, where an integral comes on top of it
        late = self.delay - 1
        self._late_scores = np.zeros((self.n, late))
        self._late_met = np.zeros((self.n, late))
        self._first = np.zeros(self.n, dtype=np.int64)  # where each stream's oldest one stands
        self._pending = np.zeros(self.n, dtype=np.int64)

    def __repr__(self) -> str:
        return (
            f"BatchTracker({self.rule!r}, {self.n}, alpha={self.alpha}, delay={self.delay}, "
            f"q0={self.q0})"
        )

    @property
    def q(self) -> FloatArray:
        """The thresholds that the next scores meet [score], shape (n,), a copy."""
        return self._q.copy()

    @property
    def pending(self) -> IntArray:
        """How many scores of each stream have not been fed back yet, < ``delay``; a copy."""
        return self._pending.copy()

    def update(self, scores: ArrayLike, mask: BoolArray | None = None) -> BoolArray:
        """Take this step's scores, each acted on ``delay`` steps later; see `Tracker.update`.

        Args:
            scores: Shape (n,), finite where the mask is True; what stands elsewhere is not read.
            mask: Which streams have a score, bool (n,); all of them by default.

        Returns:
            Whether each was missed, ``scores > q``; False where the mask is.

        Raises:
            ValueError: If an argument is refused, or moves a threshold out of the range of
                floats. No stream has changed.
        """
        rows, values = self._chosen(scores, mask)
        met = self._q[rows]
        errs = values > met
        if self.delay == 1:
            self._apply(rows, values, met)
            return self._spread(rows, errs)
        room = self.delay - 1
        full = self._pending[rows] == room
        due = rows[full]
        if due.size:
            at = self._first[due]
            self._apply(due, self._late_scores[due, at], self._late_met[due, at])
            self._first[due] = (at + 1) % room
            self._pending[due] -= 1
        place = (self._first[rows] + self._pending[rows]) % room
        self._late_scores[rows, place] = values
        self._late_met[rows, place] = met
        self._pending[rows] += 1
        return self._spread(rows, errs)

    def feedback(
        self, scores: ArrayLike, met: ArrayLike, mask: BoolArray | None = None
    ) -> BoolArray:
        """Take scores that arrive late, with the thresholds they met; see `Tracker.feedback`.

        For a loop in which the outcome of a forecast is seen h steps after its threshold was
        issued; the caller keeps the queue, so ``delay`` is 1.

        Args:
            scores: As in ``update``.
            met: The threshold that each score met, shape (n,); it may be infinite.
            mask: As in ``update``.

        Returns:
            Whether each was missed, ``scores > met``; False where the mask is.

        Raises:
            ValueError: As in ``update``, or if the trackers keep queues of their own.
        """
        if self.delay != 1:
            msg = f"delay must be 1 for feedback (the caller keeps the queue), got {self.delay!r}"
            raise ValueError(msg)
        rows, values = self._chosen(scores, mask)
        limits = _vector("met", met, self.n)[rows]
        if np.isnan(limits).any():
            msg = f"met must not be NaN, got stream {int(rows[np.isnan(limits)][0])}"
            raise ValueError(msg)
        self._apply(rows, values, limits)
        return self._spread(rows, values > limits)

    def drop_pending(self, mask: BoolArray | None = None) -> int:
        """End episodes that the next ones carry on: forget the errors not yet fed back.

        Args:
            mask: Whose episodes end, bool (n,); all by default.

        Returns:
            How many were dropped.
        """
        rows = self._rows(mask)
        dropped = int(self._pending[rows].sum())
        self._pending[rows] = 0
        return dropped

    def reset(self, mask: BoolArray | None = None, *, q0: float | None = None) -> None:
        """Start streams anew: threshold at ``q0``, the rule without memory, nothing under way.

        Args:
            mask: Which streams, bool (n,); all by default.
            q0: The threshold to start from; None is the one the trackers were made with.
        """
        rows = self._rows(mask)
        start = self.q0 if q0 is None else as_number("q0", q0) + 0.0
        self._q[rows] = start
        self._p[rows] = start
        self._pending[rows] = 0
        if self._states is not None:
            self._states.reset(rows, start)
        if self._steps is not None:
            self._steps.reset(rows)
        if self._integral is not None:
            self._integral.reset(rows)

    def _apply(self, rows: IntArray, scores: FloatArray, met: FloatArray) -> None:
        """Move streams by one event each; nothing is changed before the last check."""
        if self._steps is None:
            self._apply_states(rows, scores, met)
            return
        errs = scores > met
        steps = self._steps.peek(rows, scores)
        p = self._p[rows]
        with np.errstate(over="ignore", invalid="ignore"):  # refused below
            p = np.where(errs, p + steps * (1.0 - self.alpha), p - steps * self.alpha)
        _refuse(~np.isfinite(p), scores)
        self._steps.push(rows, scores)
        self._p[rows] = p
        self._q[rows] = p if self._integral is None else self._integral.onto(rows, p, errs)

    def _apply_states(self, rows: IntArray, scores: FloatArray, met: FloatArray) -> None:
        if self._states is not None:
            after = self._states.after(rows, scores, met)
            _refuse(np.isnan(after[:, 0]), scores)
            self._states.states[rows] = after
            self._q[rows] = after[:, 0]

    def _chosen(self, scores: ArrayLike, mask: BoolArray | None) -> tuple[IntArray, FloatArray]:
        rows = self._rows(mask)
        values = _vector("scores", scores, self.n)[rows]
        good = np.isfinite(values)
        if not good.all():
            at, wrong = int(rows[~good][0]), float(values[~good][0])
            msg = f"scores must be finite, got scores[{at}] = {wrong!r}"
            raise ValueError(msg)
        return rows, values

    def _rows(self, mask: BoolArray | None) -> IntArray:
        if mask is None:
            return np.arange(self.n)
        if mask.shape != (self.n,) or mask.dtype != np.bool_:
            msg = f"mask must be bool of shape ({self.n},), got {mask.dtype} {mask.shape}"
            raise ValueError(msg)
        return np.flatnonzero(mask)

    def _spread(self, rows: IntArray, errs: BoolArray) -> BoolArray:
        everywhere = np.zeros(self.n, dtype=np.bool_)
        everywhere[rows] = errs
        return everywhere


class _States:
    """What a state rule keeps of each stream, a row each."""

    def __init__(self, rule: StateRule, n: int, alpha: float, q0: float) -> None:
        self.rule, self.alpha = rule, alpha
        self.numbers = rule.numbers(alpha)
        self.states = np.tile(rule.begin(alpha, q0), (n, 1))

    def after(self, rows: IntArray, scores: FloatArray, met: FloatArray) -> FloatArray:
        """Return some streams' states after one event each."""
        states = self.states[rows]
        _states.take_rows(type(self.rule).update, states, self.numbers, scores, met)
        return states

    def reset(self, rows: IntArray, q0: float) -> None:
        """Start some streams anew."""
        self.states[rows] = self.rule.begin(self.alpha, q0)


class _Steps(Protocol):
    """What a rule remembers of each stream; `rows` says which streams have an event."""

    def peek(self, rows: IntArray, scores: FloatArray) -> FloatArray:
        """Return the events' steps, changing nothing."""
        ...

    def push(self, rows: IntArray, scores: FloatArray) -> None:
        """Take the scores in."""
        ...

    def reset(self, rows: IntArray) -> None:
        """Forget everything about some streams."""
        ...


class _Constant:
    def __init__(self, eta: float) -> None:
        self.eta = eta

    def peek(self, rows: IntArray, scores: FloatArray) -> FloatArray:
        return np.full(rows.size, self.eta)

    def push(self, rows: IntArray, scores: FloatArray) -> None:
        pass

    def reset(self, rows: IntArray) -> None:
        pass


class _GreatestEver:
    def __init__(self, c: float, n: int) -> None:
        self.c = c
        self.greatest = np.zeros(n)

    def peek(self, rows: IntArray, scores: FloatArray) -> FloatArray:
        with np.errstate(over="ignore"):  # refused where the step is used
            return self.c * np.maximum(self.greatest[rows], np.abs(scores))

    def push(self, rows: IntArray, scores: FloatArray) -> None:
        self.greatest[rows] = np.maximum(self.greatest[rows], np.abs(scores))

    def reset(self, rows: IntArray) -> None:
        self.greatest[rows] = 0.0


class _Decay:
    """Steps by the number of events, from a table that grows."""

    def __init__(self, c: float, power: float, n: int) -> None:
        self.c, self.power = c, power
        self.events = np.zeros(n, dtype=np.int64)
        self.table = np.empty(0)

    def peek(self, rows: IntArray, scores: FloatArray) -> FloatArray:
        events = self.events[rows]
        if events.size and events.max() >= self.table.size:
            self.table = np.empty(2 * int(events.max()) + 64)
            _kernels.decay(self.c, self.power, self.table)
        return self.table[events]

    def push(self, rows: IntArray, scores: FloatArray) -> None:
        self.events[rows] += 1

    def reset(self, rows: IntArray) -> None:
        self.events[rows] = 0


class _OneByOne:
    """Any other rule: a stepper for each stream, asked in turn."""

    def __init__(self, rule: StepRule, n: int) -> None:
        self.rule = rule
        self.steppers: list[Stepper] = [rule.stepper() for _ in range(n)]

    def peek(self, rows: IntArray, scores: FloatArray) -> FloatArray:
        return np.array([own.peek(score) for own, score in self._pairs(rows, scores)])

    def push(self, rows: IntArray, scores: FloatArray) -> None:
        for own, score in self._pairs(rows, scores):
            own.push(score)

    def reset(self, rows: IntArray) -> None:
        for row in rows.tolist():
            self.steppers[row] = self.rule.stepper()

    def _pairs(self, rows: IntArray, scores: FloatArray) -> list[tuple[Stepper, float]]:
        chosen: list[int] = rows.tolist()
        values: list[float] = scores.tolist()
        return [(self.steppers[row], score) for row, score in zip(chosen, values, strict=True)]


def _steps_of(rule: StepRule, n: int) -> _Steps:
    match rule:
        case Fixed():
            return _Constant(rule.eta)
        case RunningMax():
            return _GreatestEver(rule.c, n)
        case Decaying():
            return _Decay(rule.c, rule.power, n)
        case _:
            return _OneByOne(rule, n)


class _Integrals:
    """The integral part of ``PI`` for each stream: counts of events and misses."""

    def __init__(self, rule: PI, n: int, alpha: float) -> None:
        self.rule, self.alpha = rule, alpha
        self.misses = np.zeros(n, dtype=np.int64)
        self.events = np.zeros(n, dtype=np.int64)

    def onto(self, rows: IntArray, p: FloatArray, errs: BoolArray) -> FloatArray:
        """Count one more event of each and return ``p`` plus the integral."""
        rule = self.rule
        known = self.misses[rows]
        self.misses[rows] += errs
        self.events[rows] += 1
        if rule.lag == 0:
            known = self.misses[rows]
        if rule.K_I == 0.0:
            return p
        events = self.events[rows]
        x = known - (events - rule.lag) * self.alpha
        # The C library's log and tan, as in Tracker: numpy's may differ in the last bit.
        logs = np.array([math.log(count) for count in events.tolist()])
        angles = x * logs / (rule.C_sat * events)
        lifts = [
            math.copysign(math.inf, z) if abs(z) >= 0.5 * math.pi else rule.K_I * math.tan(z)
            for z in angles.tolist()
        ]
        return p + np.array(lifts)

    def reset(self, rows: IntArray) -> None:
        self.misses[rows] = 0
        self.events[rows] = 0


def _refuse(bad: BoolArray, scores: FloatArray) -> None:
    """Refuse the scores after which a stream has no threshold."""
    if bad.any():
        wrong = float(scores[bad][0])
        msg = f"scores must not move the threshold beyond the range of floats, got {wrong!r}"
        raise ValueError(msg)


def _vector(name: str, values: ArrayLike, n: int) -> FloatArray:
    array = np.asarray(values)
    if array.dtype.kind not in "iuf" or array.shape != (n,):
        msg = f"{name} must be numbers of shape ({n},), got {array.dtype} {array.shape}"
        raise ValueError(msg)
    return array.astype(np.float64)
