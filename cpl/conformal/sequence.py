"""Trackers over whole sequences, compiled: one stream, many streams, episodes."""

from collections.abc import Sequence
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cpl.conformal import _kernels, _states
from cpl.conformal._validate import (
    Bounds,
    as_bounds,
    as_integer,
    as_number,
    as_probability,
    as_scores,
)
from cpl.conformal.rules import PI, Rule, StepRule, as_rule
from cpl.conformal.state import StateRule

__all__ = ["Track", "fed_back", "step_sizes", "track", "track_episodes", "track_many"]

FloatArray: TypeAlias = NDArray[np.float64]
BoolArray: TypeAlias = NDArray[np.bool_]
IntArray: TypeAlias = NDArray[np.int64]


class Track(NamedTuple):
    """What a tracker did along a sequence.

    Attributes:
        q: The thresholds [score], shape (T,) or (N, T): ``q[t]`` is the one ``scores[t]`` met.
        err: Whether each score was missed, ``scores > q``, same shape, bool.
    """

    q: FloatArray
    err: BoolArray


def track(
    scores: ArrayLike,
    rule: Rule,
    *,
    alpha: float,
    delay: int = 1,
    q0: float = 0.0,
    bounds: Bounds | None = None,
) -> Track:
    r"""Follow the (1 - alpha)-quantile of a whole sequence of scores.

    $$q_{t+1} = q_t + \eta_t (\mathrm{err}_t - \alpha), \qquad \mathrm{err}_t = 1\{s_t > q_t\}$$

    Paper: eq. (4), corrected. With ``delay`` h the event of time t takes effect when q[t+h] is
    formed, with the step that belongs to it; events are applied in order. The same numbers as
    ``Tracker``, bit for bit, compiled.

    Args:
        scores: Finite scores, shape (T,); integers and narrower floats are converted. T may be 0.
        rule: How large the steps are, e.g. ``Fixed(eta=0.05)``.
        alpha: The miscoverage aimed at, in (0, 1).
        delay: The number of steps h >= 1 after which an error is known; 1 is ordinary feedback.
        q0: The first threshold [score].
        bounds: A declared range (low, high) of the scores; scores outside it are refused.

    Returns:
        The thresholds met and the errors, ``Track(q, err)``.

    Raises:
        ValueError: If an argument is refused, naming it and its value.

    Examples:
        A miss lifts q by (1 - alpha) eta = 0.75, a covered score lowers it by 0.25; a tie
        (time 2) is covered:

        >>> from cpl.conformal import Fixed
        >>> q, err = track([2.0, 0.9, 0.5, 0.6], Fixed(eta=1.0), alpha=0.25)
        >>> q
        array([0.  , 0.75, 1.5 , 1.25])
        >>> err
        array([ True,  True, False, False])

        One step later, q[2] is the first that knows of the miss at time 0:

        >>> track([2.0, 0.9, 0.5, 0.6], Fixed(eta=1.0), alpha=0.25, delay=2).q
        array([0.  , 0.  , 0.75, 1.5 ])
    """
    setting = _Setting(rule, alpha, delay, q0)
    checked = as_scores(scores, ndim=1, bounds=as_bounds(bounds))
    ends = np.array([checked.size], dtype=np.int64)
    return setting.follow(checked, setting.steps(checked[None, :]), ends)


def track_many(
    scores: ArrayLike,
    rule: Rule,
    *,
    alpha: float,
    delay: int = 1,
    q0: float = 0.0,
    bounds: Bounds | None = None,
) -> Track:
    """Do ``track`` for many independent streams at once.

    Args:
        scores: Finite scores, shape (N, T), one stream a row; N and T may be 0.
        rule: As in ``track``; each stream has its own state.
        alpha: As in ``track``.
        delay: As in ``track``.
        q0: As in ``track``, the same for all streams.
        bounds: As in ``track``.

    Returns:
        ``Track(q, err)`` of shape (N, T), row by row what ``track`` gives, bit for bit.

    Raises:
        ValueError: If an argument is refused, naming it and its value.

    Examples:
        >>> from cpl.conformal import Fixed
        >>> track_many([[2.0, 0.9], [0.0, 0.0]], Fixed(eta=1.0), alpha=0.25).q
        array([[ 0.  ,  0.75],
               [ 0.  , -0.25]])
    """
    setting = _Setting(rule, alpha, delay, q0)
    checked = as_scores(scores, ndim=2, bounds=as_bounds(bounds))
    return setting.follow_rows(checked, setting.steps(checked))


def track_episodes(
    episodes: Sequence[ArrayLike],
    rule: Rule,
    *,
    alpha: float,
    carry: bool,
    delay: int = 1,
    q0: float = 0.0,
    bounds: Bounds | None = None,
) -> tuple[Track, ...]:
    """Follow the quantile through episodes, starting anew in each or carrying on.

    With ``carry=False`` an episode is a sequence of its own. With ``carry=True`` threshold, rule
    and integral run on. What does not run on is the feedback under way: with delay h the last
    h - 1 scores of an episode are known only after its end, so they are never fed back, and the
    rule never sees them either (``fed_back`` says which count). The bound of the paper holds
    within an episode in the first case, across all that was fed back in the second.

    Args:
        episodes: The episodes' scores, each of shape (T_e,), T_e >= 0.
        rule: As in ``track``.
        alpha: As in ``track``.
        carry: Whether an episode begins where the one before ended. Both are sensible and differ
            much in short episodes, so there is no default.
        delay: As in ``track``.
        q0: The first threshold; of each episode if they start anew.
        bounds: As in ``track``.

    Returns:
        One ``Track`` an episode.

    Raises:
        ValueError: If an argument is refused, naming it and its value.

    Examples:
        >>> from cpl.conformal import Fixed
        >>> episodes = [[2.0, 2.0], [2.0, 2.0]]
        >>> [t.q.tolist() for t in track_episodes(episodes, Fixed(eta=1), alpha=0.25, carry=False)]
        [[0.0, 0.75], [0.0, 0.75]]
        >>> [t.q.tolist() for t in track_episodes(episodes, Fixed(eta=1), alpha=0.25, carry=True)]
        [[0.0, 0.75], [1.5, 2.25]]

        With delay 2 the miss at each episode's end is never known:

        >>> carried = track_episodes(episodes, Fixed(eta=1), alpha=0.25, carry=True, delay=2)
        >>> [t.q.tolist() for t in carried]
        [[0.0, 0.0], [0.75, 0.75]]
    """
    setting = _Setting(rule, alpha, delay, q0)
    limits = as_bounds(bounds)
    checked = [
        as_scores(scores, ndim=1, bounds=limits, name=f"episodes[{number}]")
        for number, scores in enumerate(episodes)
    ]
    ends = np.cumsum([scores.size for scores in checked], dtype=np.int64)
    if not carry:
        return tuple(
            setting.follow(scores, setting.steps(scores[None, :]), np.array([scores.size]))
            for scores in checked
        )
    joined = np.concatenate([np.empty(0), *checked])
    known = fed_back([scores.size for scores in checked], delay=setting.delay)
    steps = np.zeros((1, joined.size))
    steps[:, known] = setting.steps(joined[None, known])
    q, err = setting.follow(joined, steps, ends)
    return tuple(
        Track(q[end - scores.size : end], err[end - scores.size : end])
        for scores, end in zip(checked, ends.tolist(), strict=True)
    )


def fed_back(lengths: Sequence[int], *, delay: int) -> BoolArray:
    """Say which scores of consecutive episodes ever reach the tracker.

    Args:
        lengths: The episodes' lengths [steps], each >= 0.
        delay: The number of steps h >= 1 after which an error is known.

    Returns:
        False for the last h - 1 scores of each episode, else True; shape (sum of lengths,).

    Raises:
        ValueError: If an argument is refused, naming it and its value.

    Examples:
        >>> fed_back([3, 1], delay=2)
        array([ True,  True, False, False])
    """
    late = as_integer("delay", delay, minimum=1) - 1
    sizes = [as_integer(f"lengths[{k}]", size, minimum=0) for k, size in enumerate(lengths)]
    known = [max(size - late, 0) for size in sizes]
    pattern = [count for size, k in zip(sizes, known, strict=True) for count in (k, size - k)]
    return np.repeat(np.tile([True, False], len(sizes)), np.array(pattern, dtype=np.int64))


def step_sizes(scores: ArrayLike, rule: Rule) -> FloatArray:
    """Return the step of every event of a sequence, for a bound or a picture.

    Args:
        scores: Finite scores, shape (T,).
        rule: The rule; of ``PI`` the steps of its proportional part. A state rule has none.

    Returns:
        The steps [score], shape (T,).

    Raises:
        ValueError: If an argument is refused, naming it and its value.

    Examples:
        >>> from cpl.conformal import RunningMax
        >>> step_sizes([1.0, 3.0, 2.0], RunningMax(c=0.5))
        array([0.5, 1.5, 1.5])
    """
    checked = as_scores(scores, ndim=1)
    if isinstance(as_rule(rule), StateRule):
        msg = f"rule must be one with steps, such as Fixed(eta=0.05), got {rule!r}"
        raise ValueError(msg)
    steps = _steps(rule, checked[None, :])
    return np.broadcast_to(steps, (1, checked.size))[0].copy()


class _Setting:
    """A tracker's checked arguments, and the kernel calls that they stand for."""

    def __init__(self, rule: Rule, alpha: float, delay: int, q0: float) -> None:
        self.rule = as_rule(rule)
        self.alpha = as_probability("alpha", alpha)
        self.delay = as_integer("delay", delay, minimum=1)
        self.q0 = as_number("q0", q0) + 0.0  # no negative zero

    def steps(self, scores: FloatArray) -> FloatArray:
        return _steps(self.rule, scores)

    def follow(self, scores: FloatArray, steps: FloatArray, ends: IntArray) -> Track:
        """Follow one stream, cut into episodes that carry on."""
        q = np.empty_like(scores)
        if not self._fill(scores, steps[0], ends, q):
            raise ValueError(_overflow(scores))
        return Track(q, scores > q)

    def follow_rows(self, scores: FloatArray, steps: FloatArray) -> Track:
        """Follow many streams of one episode: side by side, and one by one what is left over."""
        q = np.empty_like(scores)
        streams, length = scores.shape
        row_stride, stride = (int(size > 1) for size in steps.shape)
        done = self._fill_lanes(scores, steps, (row_stride, stride), q)
        ends = np.array([length], dtype=np.int64)
        for n in range(done, streams):
            if not self._fill(scores[n], steps[row_stride * n], ends, q[n]):
                raise ValueError(_overflow(scores))
        return Track(q, scores > q)

    def _fill_lanes(
        self, scores: FloatArray, steps: FloatArray, strides: tuple[int, int], q: FloatArray
    ) -> int:
        """Fill ``q`` of as many streams as go side by side; return how many those are."""
        if not isinstance(self.rule, StepRule):
            return 0
        streams, length = scores.shape
        many = streams - streams % _kernels.LANES
        last = np.empty(many)
        late = self._late(length)
        _kernels.follow_lanes(scores[:many], steps, *strides, late, self.alpha, self.q0, q, last)
        if not np.isfinite(last).all():
            raise ValueError(_overflow(scores))
        return many

    def _fill(self, scores: FloatArray, steps: FloatArray, ends: IntArray, q: FloatArray) -> bool:
        """Fill ``q`` of one stream; return whether its state stayed finite."""
        rule = self.rule
        if isinstance(rule, StateRule):
            return self._fill_state(rule, scores, ends, q)
        stride = int(steps.size > 1)
        where = scores, steps, stride, ends, self._late(scores.size), self.alpha, self.q0
        if isinstance(rule, PI):
            last = _kernels.follow_pi(*where, rule.K_I, rule.C_sat, rule.lag, q)
        else:
            last = _kernels.follow(*where, q)
        return bool(np.isfinite(last))

    def _fill_state(
        self, rule: StateRule, scores: FloatArray, ends: IntArray, q: FloatArray
    ) -> bool:
        """Fill ``q`` of one stream of a state rule; return whether there always was a threshold."""
        state = rule.begin(self.alpha, self.q0)
        late, settings = self._late(scores.size), rule.numbers(self.alpha)
        _states.follow_state(type(rule).update, state, settings, scores, ends, late, q)
        return not (np.isnan(q).any() or np.isnan(state[0]))

    def _late(self, length: int) -> int:
        """Return the delay; longer than the sequence is as good as for ever, and fits an int64."""
        return min(self.delay, length + 1)


def _steps(rule: Rule, scores: FloatArray) -> FloatArray:
    if isinstance(rule, StateRule):
        return np.zeros((1, 1))  # it has none, and nobody looks
    with np.errstate(over="ignore", invalid="ignore"):  # refused later, where it does harm
        return (rule.rule if isinstance(rule, PI) else rule).steps(scores)


def _overflow(scores: FloatArray) -> str:
    greatest = float(np.abs(scores).max())
    return f"scores must not move the threshold beyond the range of floats, got {greatest!r}"
