"""Adversaries that see everything, against any rule: how badly can scores in [0, B] be chosen?

A worst case that is found by an adversary is attained; that nothing is worse is known only where
the rule has few states (`counts_worst`, `cpl.conformal.search`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from math import inf, nextafter

import numpy as np
from numpy.typing import NDArray

from cpl.conformal.rules import Rule
from cpl.conformal.tracker import Tracker

__all__ = ["ADVERSARIES", "Attack", "Shift", "attack", "counts_worst", "level_worst", "shift"]

Move = Callable[[int, float, float], float]
"""From the time, the threshold and B to a score in [0, B]."""


def _above(q: float, B: float) -> float:
    """Return the least score that is missed, or B where none is."""
    return min(max(nextafter(q, inf), 0.0), B) if q < B else B


def _patient(wait: int, low: float) -> Move:
    return lambda t, q, B: low * B if t < wait else B


def _creeping(wait: int, factor: float) -> Move:
    """Lie low, then grow by a factor a step, always just beyond the threshold."""
    return lambda t, q, B: 0.0 if t < wait else min(max(_above(q, B), q * factor), B)


def _lulling(wait: int) -> Move:
    """Cover exactly, so that the threshold creeps down as far as it will; then strike."""
    return lambda t, q, B: min(max(q, 0.0), B) if t < wait else B


def _waves(calm: int, storm: int) -> Move:
    return lambda t, q, B: 0.0 if t % (calm + storm) < calm else B


ADVERSARIES: dict[str, Move] = {
    "the greatest score, always": _patient(0, 0.0),
    "one zero, then the greatest": _patient(1, 0.0),
    "just beyond the threshold": _creeping(0, 1.0),
    "a tenth beyond": _creeping(1, 1.1),
    **{f"zeros for {n}, then the greatest": _patient(n, 0.0) for n in (20, 200, 600)},
    **{f"a hundredth for {n}, then the greatest": _patient(n, 0.01) for n in (60, 600)},
    **{f"zeros for {n}, then just beyond": _creeping(n, 1.0) for n in (20, 200, 600)},
    "exact covers for 100, then the greatest": _lulling(100),
    "waves of 30 and 10": _waves(30, 10),
    "waves of 9 and 3": _waves(9, 3),
}


@dataclass(frozen=True, kw_only=True)
class Attack:
    """The worst that was found.

    Attributes:
        misses: Most misses in any W steps in a row.
        by: The adversary.
        run: Most misses in a row, at most the number of steps played after its beginning.
        run_by: The adversary.
    """

    misses: int
    by: str
    run: int
    run_by: str


def attack(rule: Rule, *, alpha: float, W: int, B: float = 1.0, steps: int = 800) -> Attack:
    """Let all adversaries play against a rule.

    Args:
        rule: The rule.
        alpha: The miscoverage that it aims at.
        W: Length of the windows in which misses are counted [steps].
        B: The greatest score.
        steps: How long each plays [steps].

    Examples:
        Against a fixed step the simple adversary attains the theorem's 14 of 40:

        >>> from cpl.conformal import Fixed
        >>> found = attack(Fixed(eta=0.1), alpha=0.1, W=40)
        >>> found.misses, found.run
        (14, 12)
    """
    worst, longest = (0, ""), (0, "")
    for name, move in ADVERSARIES.items():
        err = np.fromiter(_played(rule, alpha, B, move, steps), np.int64, steps)
        summed = np.concatenate([[0], np.cumsum(err)])
        misses = int((summed[W:] - summed[:-W]).max())
        worst = max(worst, (misses, name), key=lambda pair: pair[0])
        longest = max(longest, (_run(err), name), key=lambda pair: pair[0])
    return Attack(misses=worst[0], by=worst[1], run=longest[0], run_by=longest[1])


def _played(rule: Rule, alpha: float, B: float, move: Move, steps: int) -> Iterator[bool]:
    # A tie with the greatest score is a cover; a sum of rounded steps just below it is none.
    tracker, top = Tracker(rule, alpha=alpha), B * (1 - 1e-9)
    for t in range(steps):
        yield tracker.update(move(t, tracker.q, top))


def _run(err: NDArray[np.int64]) -> int:
    longest = now = 0
    for missed in err.tolist():
        now = now + 1 if missed else 0
        longest = max(longest, now)
    return longest


def counts_worst(threshold: Callable[[int, int], float], *, W: int, T: int, B: float = 1.0) -> int:
    """Search a rule whose threshold depends on the numbers of misses and events alone, exactly.

    Args:
        threshold: From misses and events to the threshold (as ``UPOCP``'s).
        W: Window [steps].
        T: Windows that end at most here are searched [steps]; the work grows like T^2 W.
        B: The greatest score.

    Returns:
        The most misses in any W steps in a row that end by time T, over all scores in [0, B].

    Examples:
        A fixed step of 1 with alpha = 1/2 and B = 1 counts, too: as in `search_windows`, 3 of 4.

        >>> counts_worst(lambda misses, events: misses - events / 2, W=4, T=12)
        3
    """
    # reached[n] at time t: whether n misses are possible.
    reached = np.zeros((T + 1, T + 2), dtype=np.bool_)
    reached[0, 0] = True
    q = np.array([[threshold(n, t) if n <= t else np.nan for n in range(T + 1)] for t in range(T)])
    for t in range(T):
        live = np.flatnonzero(reached[t, : t + 1])
        reached[t + 1, live[q[t, live] >= 0]] = True
        reached[t + 1, live[q[t, live] < B] + 1] = True
    best = 0
    for start in range(T - W + 1):
        gained = np.full(T + 2, -1)
        gained[np.flatnonzero(reached[start])] = 0
        for t in range(start, start + W):
            live = np.flatnonzero(gained[: t + 1] >= 0)
            after = np.full(T + 2, -1)
            covers, misses = live[q[t, live] >= 0], live[q[t, live] < B]
            after[covers] = gained[covers]
            after[misses + 1] = np.maximum(after[misses + 1], gained[misses] + 1)
            gained = after
        best = max(best, int(gained.max()))
    return best


def level_worst(gamma: float, *, alpha: float, W: int) -> int:
    r"""Return the most misses that ACI can make in W steps in a row, exactly.

    With the level's account $\ell = (\alpha - \alpha_t) / \gamma$ the rule is a fixed step of 1: a
    miss adds $1 - \alpha$, a covered score takes $\alpha$. A miss is possible while the level is at
    or above 0 (scores may always be a little greater than all before), a covered score while it is
    at or below 1. So it is the theorem's tracker with $B / \eta = 1 / \gamma$, its walls closed.

    Examples:
        >>> level_worst(0.1, alpha=0.1, W=40), level_worst(0.02, alpha=0.1, W=40)
        (15, 40)
    """
    # Closed walls: at a level of exactly 0 one more miss is possible.
    most = int(np.floor(alpha * W + 1 / gamma + 1 + 1e-9))
    return min(W, most)


@dataclass(frozen=True, kw_only=True)
class Shift:
    """How long a rule takes to follow scores that triple, and that are as they were again.

    Attributes:
        react: Steps after the rise until at most a fifth of the last 20 scores are missed; None if
            not within the stretch.
        forget: Steps after the fall until the mean of the last 20 thresholds is within a quarter
            of its mean before the rise; None if not.
        before: Mean threshold before the rise [score].
        missed: Share of scores missed while they were large.
    """

    react: int | None
    forget: int | None
    before: float
    missed: float


def shift(rule: Rule, *, alpha: float, stretch: int = 400, factor: float = 3.0) -> Shift:
    """Follow evenly spread scores through a rise and a fall; the same for every rule.

    Args:
        rule: The rule.
        alpha: The miscoverage that it aims at.
        stretch: Steps before, during and after [steps].
        factor: How much larger scores become.
    """
    even = np.array([_van_der_corput(t + 1) for t in range(stretch)])
    scores = np.concatenate([even, factor * even, even])
    found = Tracker(rule, alpha=alpha).extend(scores)
    window = np.ones(20) / 20
    missed = np.convolve(found.err, window)[: scores.size]
    shown = np.convolve(np.clip(found.q, -1e6, 1e6), window)[: scores.size]
    before = float(np.mean(np.clip(found.q[stretch // 2 : stretch], -1e6, 1e6)))
    calm = missed[stretch + 19 : 2 * stretch] <= 2 * alpha + 1e-12
    low = shown[2 * stretch + 19 :] <= 1.25 * before
    return Shift(
        react=int(np.argmax(calm)) + 20 if calm.any() else None,
        forget=int(np.argmax(low)) + 20 if low.any() else None,
        before=before,
        missed=float(found.err[stretch : 2 * stretch].mean()),
    )


def _van_der_corput(n: int) -> float:
    value, base = 0.0, 0.5
    while n:
        n, bit = divmod(n, 2)
        value += bit * base
        base /= 2
    return value
