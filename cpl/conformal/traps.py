r"""Traps: rules that look harmless and lose the guarantee, each with the scores that show it.

Every function plays one sequence against one rule in exact arithmetic and returns a `Trap`. The
default numbers are small enough to be followed by hand.
"""

# pyright: reportMissingTypeStubs=false
from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from itertools import cycle, islice
from typing import TYPE_CHECKING

from cpl.conformal.rational import Number, count, level, positive, rational
from cpl.conformal.reference import (
    ExactPath,
    StepSize,
    follow,
    follow_as_printed,
    trailing_maximum,
    trailing_range,
)

if TYPE_CHECKING:
    import pandas as pd

__all__ = [
    "TRAPS",
    "Trap",
    "clipped_at_zero",
    "clipped_comparison",
    "clipped_state",
    "constant_scores_and_trailing_range",
    "every_dangerous_step_missed",
    "floored_trailing_maximum",
    "past_trailing_maximum",
    "printed_theorem",
    "printed_update",
    "trailing_maximum_frozen",
    "traps_table",
]


@dataclass(frozen=True, kw_only=True)
class Trap:
    """A sequence, what a rule made of it, and what to learn from that."""

    name: str
    """What the rule is, in words."""
    lesson: str
    """What goes wrong, and why."""
    alpha: Fraction
    """The miscoverage level that was asked for."""
    path: ExactPath
    """What happened."""
    start: int = 0
    """First time from which the error rate is taken (0-based)."""
    danger: frozenset[int] = frozenset()
    """Times that matter more than others, where there are any."""

    @property
    def error_rate(self) -> float:
        """Share of misses from `start` on; `alpha` was asked for."""
        late = self.path.err[self.start :]
        return sum(late) / len(late)

    @property
    def danger_error_rate(self) -> float:
        """Share of misses among the dangerous times.

        Raises:
            ValueError: if this trap has no dangerous times.
        """
        if not self.danger:
            msg = f"danger must hold at least one time, but the trap {self.name!r} has none"
            raise ValueError(msg)
        return sum(self.path.err[t] for t in self.danger) / len(self.danger)


def trailing_maximum_frozen(
    *, alpha: Number = 0.1, c: Number = 0.1, window: int = 10, second: Number = 0.05, T: int = 200
) -> Trap:
    """Freeze the trailing maximum below zero: one large score, one small, then perfection.

    Examples:
        By hand: +0.09, then nine steps of -0.01 to 0, then one small step below zero, while the
        step size falls to zero because the window holds zeros only.

        >>> trap = trailing_maximum_frozen()
        >>> float(trap.path.q[11]), float(trap.path.q[-1]), trap.error_rate
        (-0.0005, -0.0005, 1.0)
    """
    scores = [Fraction(1), rational(second, "second"), *[Fraction(0)] * count(T, "T")]
    return Trap(
        name="trailing maximum, current score included",
        lesson="The quantile freezes below zero, and perfect predictions (score 0) are rejected "
        "for ever: the step is zero, so no miss has a consequence.",
        alpha=level(alpha),
        path=follow(scores, alpha=alpha, eta=trailing_maximum(c, window)),
        start=count(window, "window") + 1,
    )


def floored_trailing_maximum(
    *,
    alpha: Number = 0.1,
    c: Number = 0.1,
    window: int = 11,
    floor: Number = 0.01,
    T: int = 2200,
) -> Trap:
    """Show that a floor under the trailing maximum is not enough.

    The adversary shows 1 as soon as the quantile is back at zero and the window is empty of ones.
    The quantile then falls in large steps and climbs back in small ones, missing all the while.

    Examples:
        By hand: one miss, ten covers down to -0.01, then 12 misses of +0.0009 back to zero:
        13 misses in a cycle of 23 or so.

        >>> round(floored_trailing_maximum().error_rate, 2)
        0.55
        >>> round(floored_trailing_maximum(floor=0.001, T=6100).error_rate, 2)
        0.92
    """
    length = count(window, "window")
    rule = trailing_maximum(c, length, floor=positive(c, "c") * positive(floor, "floor"))

    def score(q: Fraction, past: list[Fraction]) -> Fraction:
        return Fraction(q >= 0 and not any(past[-length:]))

    return Trap(
        name="trailing maximum with a floor",
        lesson="Large steps down and small steps back up: most of the time is spent missing.",
        alpha=level(alpha),
        path=follow(_adapt(score, alpha, rule, count(T, "T")), alpha=alpha, eta=rule),
    )


def past_trailing_maximum(
    *, alpha: Number = 0.1, c: Number = 0.1, window: int = 10, cycles: int = 100
) -> Trap:
    r"""Leave the current score out of the trailing maximum: `window` zeros, then a one, repeated.

    $$\text{error rate} = \alpha + \frac{1-\alpha}{w+1}$$

    The one is always missed and never counted, because the step is zero when it comes; the zeros
    are missed at rate `alpha`.

    Examples:
        By hand: 0.1 + 0.9 / 11 = 2 / 11: of 11 steps, the one and a zero.

        >>> trap = past_trailing_maximum()
        >>> round(trap.error_rate, 6), round(2 / 11, 6)
        (0.181818, 0.181818)
    """
    length = count(window, "window")
    scores = [*[Fraction(0)] * length, Fraction(1)] * (count(cycles, "cycles") + 1)
    return Trap(
        name="trailing maximum, current score excluded",
        lesson="The miss that matters finds a step of zero, so it is never made up for.",
        alpha=level(alpha),
        path=follow(scores, alpha=alpha, eta=trailing_maximum(c, length, include_current=False)),
        start=length + 1,
    )


def constant_scores_and_trailing_range(
    *, alpha: Number = 0.1, lr: Number = 0.1, window: int = 10, score: Number = 1, T: int = 200
) -> Trap:
    """Freeze the trailing range with constant scores: 100 % errors.

    Examples:
        By hand: the first step takes q to 0.09 < 1; the range of equal scores is zero from then on.

        >>> trap = constant_scores_and_trailing_range()
        >>> float(trap.path.q[1]), float(trap.path.q[-1]), trap.error_rate
        (0.09, 0.09, 1.0)
    """
    scores = [positive(score, "score")] * count(T, "T")
    return Trap(
        name="trailing range",
        lesson="Constant scores have no range: the step is zero, wherever the quantile stands.",
        alpha=level(alpha),
        path=follow(scores, alpha=alpha, eta=trailing_range(lr, window)),
    )


def clipped_state(*, alpha: Number = 0.1, eta: Number = 0.1, B: Number = 1, T: int = 200) -> Trap:
    """Clip the state to [0, B] and show `B` for ever: every second step is missed.

    Examples:
        By hand: at 1 the score 1 is covered, down to 0.99; there it is missed, up to 1.08, cut
        to 1.

        >>> clipped_state().error_rate
        0.5
    """
    a, step, top = level(alpha), positive(eta, "eta"), positive(B, "B")
    climb = (top / (step * (1 - a))).__ceil__()
    return Trap(
        name="state clipped to [0, B]",
        lesson="What is cut off at the top is a promise of future covers, and it is gone.",
        alpha=a,
        path=follow([top] * (climb + count(T, "T")), alpha=a, eta=step, keep_within=(0, top)),
        start=climb,
    )


def clipped_at_zero(*, alpha: Number = 0.1, eta: Number = 0.1, T: int = 200) -> Trap:
    """Keep the state from falling below 0 and show zeros: no miss at all.

    The upper side of the bound survives this clipping, the lower does not: 110 steps or more
    should hold at least one miss.

    Examples:
        >>> clipped_at_zero().error_rate
        0.0
    """
    return Trap(
        name="state clipped at zero",
        lesson="Never too many misses, but possibly none: the lower side of the bound is lost.",
        alpha=level(alpha),
        path=follow([0] * count(T, "T"), alpha=alpha, eta=eta, keep_within=(0, None)),
    )


def clipped_comparison(
    *, alpha: Number = 0.1, eta: Number = 0.1, B: Number = 1, calm: int = 10_000
) -> Trap:
    """Compare with a clipped threshold, leave the state free: it winds up during a calm.

    Examples:
        By hand: 10,000 covers of -0.01 take q to -100; then 1,112 misses are needed to come back to
        0, where 12 would do.

        >>> trap = clipped_comparison()
        >>> float(trap.path.q[10_000]), trap.error_rate
        (-100.0, 1.0)
    """
    a, step, top = level(alpha), positive(eta, "eta"), positive(B, "B")
    back = (count(calm, "calm") * a / (1 - a)).__ceil__()
    return Trap(
        name="only the comparison clipped",
        lesson="In a calm the state falls without end, and in the storm all is missed until it is "
        "back: the integrator winds up.",
        alpha=a,
        path=follow(
            [Fraction(0)] * calm + [top] * back, alpha=a, eta=step, compare_within=(0, top)
        ),
        start=calm,
    )


def every_dangerous_step_missed(
    *, alpha: Number = 0.1, eta: Number = 0.1, B: Number = 1, every: Number = 12.5, T: int = 10_000
) -> Trap:
    """Cover 90 % of all steps and miss every dangerous one.

    A dangerous step (score `B`) comes once in `every` steps, the others score 0. Because dangers
    are rarer than `alpha`, the misses on them leave room for some more, which the tracker spends
    on harmless steps; the quantile is never near `B` when it would be needed.

    Raises:
        ValueError: if `every < 1 / alpha + 1`, which leaves no room.

    Examples:
        By hand: 8 % of the steps are dangerous and all of them missed; 2 % are missed for nothing.

        >>> trap = every_dangerous_step_missed()
        >>> len(trap.danger) / 10_000, trap.error_rate, trap.danger_error_rate
        (0.08, 0.1001, 1.0)
    """
    a, top, apart = level(alpha), positive(B, "B"), positive(every, "every")
    if apart < 1 / a + 1:
        msg = f"every must be >= 1 / alpha + 1 = {1 / a + 1}, got {every!r}"
        raise ValueError(msg)
    steps = count(T, "T")
    dangers = (int(apart * (k + 1)) - 1 for k in range(int(steps / apart)))
    danger = frozenset(t for t in dangers if t < steps)
    return Trap(
        name="every dangerous step missed",
        lesson="Coverage is an average over time. It says nothing about when the misses fall.",
        alpha=a,
        path=follow([top if t in danger else 0 for t in range(steps)], alpha=a, eta=eta),
        danger=danger,
    )


def printed_theorem() -> Trap:
    """Break Theorem 1 as printed, with alpha = 0.1, eta = 1, B = 0.85, T0 = 2, W = 1.

    Examples:
        By hand: 0 is covered, q falls to -0.1; 0.85 is missed, q rises to 0.8; 0.85 is missed. The
        printed sum over t = 2, 3 is 2, its bound 0.1 + 1.85 = 1.95.

        >>> printed_theorem().path.err
        (False, True, True)
    """
    return Trap(
        name="Theorem 1 as printed",
        lesson="The sum from T0 to T0 + W has W + 1 terms, and one more miss than W terms allow.",
        alpha=Fraction(1, 10),
        path=follow([0, 0.85, 0.85], alpha=0.1, eta=1),
        start=1,
    )


def printed_update(*, alpha: Number = 0.1, eta: Number = 0.05, T: int = 1000) -> Trap:
    """Run the update as printed on scores spread evenly over (0, 1): all are missed.

    Examples:
        >>> printed_update().error_rate
        1.0
    """
    spread = islice(cycle(Fraction(k * 7 % 20 + 1, 21) for k in range(20)), count(T, "T"))
    return Trap(
        name="update as printed",
        lesson="With the minus sign a miss lowers the quantile; below zero there is no way back.",
        alpha=level(alpha),
        path=follow_as_printed(spread, alpha=alpha, eta=eta),
    )


TRAPS: tuple[Callable[[], Trap], ...] = (
    printed_update,
    printed_theorem,
    trailing_maximum_frozen,
    floored_trailing_maximum,
    past_trailing_maximum,
    constant_scores_and_trailing_range,
    clipped_state,
    clipped_at_zero,
    clipped_comparison,
    every_dangerous_step_missed,
)
"""All traps, with their default numbers."""


def traps_table() -> pd.DataFrame:
    """Run all traps with their default numbers.

    Returns:
        Columns `trap`, `alpha`, `error_rate` and `lesson`, one row a trap.
    """
    import pandas as pd

    rows = [
        {
            "trap": trap.name,
            "alpha": float(trap.alpha),
            "error_rate": trap.error_rate,
            "lesson": trap.lesson,
        }
        for trap in (play() for play in TRAPS)
    ]
    return pd.DataFrame(rows)


def _adapt(
    score: Callable[[Fraction, list[Fraction]], Fraction],
    alpha: Number,
    rule: StepSize,
    T: int,
) -> list[Fraction]:
    """Return the scores of an adversary that sees the quantile (prompt feedback)."""
    a, q = level(alpha), Fraction(0)
    scores: list[Fraction] = []
    for t in range(T):
        scores.append(score(q, scores))
        q += rule(scores, t) * ((scores[-1] > q) - a)
    return scores
