r"""The tracker in exact arithmetic, one plain loop: what adversaries and traps are played against.

Fractions instead of floats, because a worst case lives on the tie: whether a score that *equals*
the threshold is covered must not hang on the last bit. For speed, and for everything that is not a
proof, use `cpl.conformal.track`.
"""

# pyright: reportMissingTypeStubs=false
from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import TYPE_CHECKING

from cpl.conformal.rational import Number, count, level, positive, rational

if TYPE_CHECKING:
    import pandas as pd

__all__ = [
    "ExactPath",
    "StepSize",
    "follow",
    "follow_as_printed",
    "running_maximum",
    "trailing_maximum",
    "trailing_range",
]

StepSize = Callable[[Sequence[Fraction], int], Fraction]
"""The step size of time `t` (0-based), from all scores; a rule looks at `scores[:t + 1]` only."""


@dataclass(frozen=True, kw_only=True)
class ExactPath:
    """What happened, exactly. Times are 0-based: `q[0]` is the paper's q_1."""

    scores: tuple[Fraction, ...]
    """Scores."""
    q: tuple[Fraction, ...]
    """Thresholds: `scores[t]` meets `q[t]`; one more than there are scores."""
    err: tuple[bool, ...]
    """Misses: `scores[t] > q[t]`."""

    @property
    def error_rate(self) -> float:
        """Share of misses among all steps."""
        return sum(self.err) / len(self.err)

    def errors(self, start: int, W: int) -> int:
        """Count the misses in the `W` terms from `start`."""
        return sum(self.err[start : start + W])

    def as_table(self) -> pd.DataFrame:
        """Return the columns `t`, `score`, `q`, `err` as floats, one row a step."""
        import pandas as pd

        return pd.DataFrame(
            {
                "t": range(len(self.scores)),
                "score": [float(s) for s in self.scores],
                "q": [float(q) for q in self.q[:-1]],
                "err": self.err,
            }
        )


def follow(
    scores: Iterable[Number],
    *,
    alpha: Number,
    eta: Number | StepSize,
    delay: int = 1,
    q1: Number = 0,
    keep_within: tuple[Number, Number | None] | None = None,
    compare_within: tuple[Number, Number] | None = None,
) -> ExactPath:
    r"""Track a quantile exactly, on request with one of the clippings that break it.

    $$q_{t+1} = q_t + \eta_{t+1-h}\,(\mathrm{err}_{t+1-h} - \alpha)$$

    Paper: the update equation, corrected, with feedback delay `h`.

    Args:
        scores: any finite reals [score].
        alpha: miscoverage level in (0, 1).
        eta: a fixed step size > 0 [score], or a rule that gives the step of each time.
        delay: feedback delay `h >= 1` [steps].
        q1: first threshold [score].
        keep_within: clip the state to this range after each update (`None` above: no upper end).
        compare_within: compare scores with the threshold clipped to this range; the state is free.

    Returns:
        Thresholds and misses.

    Examples:
        By hand: 0.5 > 0 is a miss, up by 3/4; 0.75 = 0.75 is a tie, covered, down by 1/4.

        >>> path = follow([0.5, 0.75, 1], alpha=0.25, eta=1)
        >>> [str(q) for q in path.q], path.err
        (['0', '3/4', '1/2', '5/4'], (True, False, True))
    """
    a, h = level(alpha), count(delay, "delay")
    met = tuple(rational(s, "scores") for s in scores)
    size = eta if callable(eta) else _constant(positive(eta, "eta"))
    q, err = [rational(q1, "q1")], list[bool]()
    for t, s in enumerate(met):
        err.append(s > (_clip(q[t], *compare_within) if compare_within else q[t]))
        known = t + 1 - h
        change = size(met, known) * (err[known] - a) if known >= 0 else Fraction(0)
        q.append(_clip(q[t] + change, *keep_within) if keep_within else q[t] + change)
    return ExactPath(scores=met, q=tuple(q), err=tuple(err))


def follow_as_printed(scores: Iterable[Number], *, alpha: Number, eta: Number) -> ExactPath:
    r"""Run the update with the sign that the paper prints.

    $$q_{t+1} = q_t - \eta\,\nabla\rho_{1-\alpha}(\mathrm{err}_t-\alpha)
      = q_t - \eta\,(\mathrm{err}_t-\alpha)$$

    Paper: the update equation, as printed (erratum 1).

    Examples:
        By hand: the first miss takes q to -3/4, and everything is a miss from there on.

        >>> path = follow_as_printed([0.5, 0.75, 1], alpha=0.25, eta=1)
        >>> [str(q) for q in path.q], path.err
        (['0', '-3/4', '-3/2', '-9/4'], (True, True, True))
    """
    a, step = level(alpha), positive(eta, "eta")
    met = tuple(rational(s, "scores") for s in scores)
    q, err = [Fraction(0)], list[bool]()
    for s in met:
        err.append(s > q[-1])
        q.append(q[-1] - step * (err[-1] - a))
    return ExactPath(scores=met, q=tuple(q), err=tuple(err))


def running_maximum(c: Number) -> StepSize:
    """Return the rule `c` times the largest score so far, the current one included.

    Examples:
        >>> rule = running_maximum(0.5)
        >>> [str(rule([Fraction(1), Fraction(3), Fraction(2)], t)) for t in range(3)]
        ['1/2', '3/2', '3/2']
    """
    share = positive(c, "c")
    seen: list[Fraction] = []

    def size(scores: Sequence[Fraction], t: int) -> Fraction:
        # Called with t = 0, 1, 2, ...: remember the maxima, to stay linear in time.
        while len(seen) <= t:
            score = scores[len(seen)]
            seen.append(max(seen[-1], score) if seen else score)
        return share * seen[t]

    return size


def trailing_maximum(
    c: Number, window: int, *, include_current: bool = True, floor: Number = 0
) -> StepSize:
    """Return the rule `c` times the largest of the last `window` scores, but at least `floor`.

    Examples:
        >>> rule = trailing_maximum(0.5, window=2, floor=0.25)
        >>> [str(rule([Fraction(1), Fraction(3), Fraction(0), Fraction(0)], t)) for t in range(4)]
        ['1/2', '3/2', '3/2', '1/4']
    """
    share, length, least = positive(c, "c"), count(window, "window"), rational(floor, "floor")

    def size(scores: Sequence[Fraction], t: int) -> Fraction:
        end = t + 1 if include_current else t
        return max(least, share * max(scores[max(end - length, 0) : end], default=Fraction(0)))

    return size


def trailing_range(lr: Number, window: int) -> StepSize:
    """Return the rule of the public PID code: `lr` times the range of the scores before this one.

    The first step is `lr` itself.

    Examples:
        >>> [str(trailing_range(0.5, window=2)([Fraction(1), Fraction(3)], t)) for t in (0, 1, 2)]
        ['1/2', '0', '1']
    """
    share, length = positive(lr, "lr"), count(window, "window")

    def size(scores: Sequence[Fraction], t: int) -> Fraction:
        past = scores[max(t - length, 0) : t]
        return share * (max(past) - min(past)) if t else share

    return size


def _constant(eta: Fraction) -> StepSize:
    def size(scores: Sequence[Fraction], t: int) -> Fraction:
        del scores, t
        return eta

    return size


def _clip(q: Fraction, low: Number, high: Number | None) -> Fraction:
    above = max(q, rational(low, "low"))
    return above if high is None else min(above, rational(high, "high"))
