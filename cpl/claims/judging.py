r"""How an effect becomes a verdict: the rules of the second edition, the same for every row.

A claim is one or several *conditions*, each an effect with a 95 % interval, positive in the claimed
direction, and a margin $m$: the smallest effect that would matter. With $c$ the claimed size, where
the paper gives one, an effect has to reach $n = \max(m, c / 2)$.

- *no difference*: the interval lies inside $(-m, m)$, whether or not it contains 0;
- *holds*: the interval excludes 0 in the claimed direction and the effect reaches $n$;
- *does not hold*: the interval lies wholly below $n$;
- *holds in part*: the interval excludes 0, but the effect is not shown to reach $n$;
- *undecided*: everything else.

With more data the interval shrinks to the truth, and each truth but the boundaries themselves ends
in one of the decided verdicts: no row stays undecided for want of a margin.

A claim that two things are *the same* reads the same interval the other way round: it holds inside
the margin, does not hold wholly outside, and is undecided across its edge.

Over the conditions: all hold, and the claim holds. One refuted (*does not hold* or *no
difference*), and it is refuted as it was stated: it *holds in part* if another condition stands,
else it *does not hold*, or shows *no difference* where none of them does.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from math import ceil

from cpl.claims.verdict import Finding, Verdict
from cpl.stats import Estimate

__all__ = [
    "Condition",
    "at_least",
    "change",
    "decided_by",
    "found",
    "jointly",
    "seeds_needed",
    "what_would_change",
]

_REFUTED = {Verdict.FAILS, Verdict.NONE}
_STANDS = {Verdict.HOLDS, Verdict.IN_PART}


@dataclass(frozen=True, kw_only=True)
class Condition:
    """One effect that a claim is about, and how large it has to be.

    Attributes:
        name: What it is measured between, or where.
        effect: Its estimate, positive in the claimed direction.
        margin: The smallest effect that would matter, >= 0, in the effect's unit; 0 where a level
            is claimed and any distance from it counts.
        size: What the paper claims; None where it gives no size.
        same: Whether the claim is that there is no effect.
    """

    name: str
    effect: Estimate
    margin: float
    size: float | None = None
    same: bool = False

    def __post_init__(self) -> None:
        """Refuse what no rule could decide."""
        if not self.margin >= 0 or (self.same and not self.margin > 0):
            raise ValueError(f"margin must be >= 0, and > 0 for sameness, got {self.margin!r}")
        if self.size is not None and not self.size > 0:
            msg = f"size must be > 0 in the claimed direction, got {self.size!r}"
            raise ValueError(msg)
        if not self.effect.low <= self.effect.value <= self.effect.high:
            raise ValueError(f"effect must lie in its interval, got {self.effect!r}")

    @property
    def needed(self) -> float:
        """What the effect has to reach: the margin, or half of what is claimed."""
        return max(self.margin, (self.size or 0.0) / 2)

    @property
    def verdict(self) -> Verdict:
        """What is to be said of this condition alone.

        Examples:
            The paper claims 12.8 s, and 2 s would matter; we find 7 s, between 5 and 9:

            >>> found = Estimate(value=7.0, low=5.0, high=9.0, n=10)
            >>> str(Condition(name="20-40", effect=found, margin=2.0, size=12.8).verdict)
            'holds'
            >>> tiny = Estimate(value=0.3, low=0.1, high=0.5, n=10)
            >>> str(Condition(name="20-40", effect=tiny, margin=2.0).verdict)
            'no difference'
        """
        low, high = self.effect.low, self.effect.high
        inside = -self.margin < low and high < self.margin
        if self.same:
            outside = high <= -self.margin or low >= self.margin
            return Verdict.HOLDS if inside else Verdict.FAILS if outside else Verdict.UNDECIDED
        if inside:
            return Verdict.NONE
        if low > 0 and self.effect.value >= self.needed:
            return Verdict.HOLDS
        if high < self.needed or high <= 0:
            return Verdict.FAILS
        return Verdict.IN_PART if low > 0 else Verdict.UNDECIDED


def at_least(name: str, estimate: Estimate, level: float, *, below: bool = False) -> Condition:
    """Return the condition that a number lies above a level, or below it.

    Examples:
        >>> share = Estimate(value=0.05, low=0.02, high=0.08, n=10)
        >>> str(at_least("crashes", share, 0.1, below=True).verdict)
        'holds'
    """
    value, low, high = estimate.value - level, estimate.low - level, estimate.high - level
    if below:
        value, low, high = -value, -high, -low
    effect = Estimate(value=value, low=low, high=high, n=estimate.n)
    return Condition(name=name, effect=effect, margin=0.0)


def jointly(conditions: Iterable[Condition]) -> Verdict:
    """Decide a claim that is made of all its conditions.

    Raises:
        ValueError: If there is none.
    """
    each = [condition.verdict for condition in conditions]
    if not each:
        raise ValueError("conditions must not be empty")
    if len(set(each)) == 1:
        return each[0]
    if _STANDS.intersection(each):
        return Verdict.IN_PART
    return Verdict.FAILS if _REFUTED.intersection(each) else Verdict.UNDECIDED


def found(
    conditions: Sequence[Condition],
    *,
    n: int,
    shown: Estimate | None = None,
    beside: Sequence[Condition] = (),
    flags: tuple[str, ...] = (),
) -> Finding:
    """Decide a claim by its conditions.

    Args:
        conditions: What decides.
        n: Units looked at.
        shown: The number beside the verdict; the least effect unless another is given.
        beside: What is told beside it and decides nothing.
        flags: What a reader must know.
    """
    least = min((one.effect for one in conditions), key=lambda effect: effect.value)
    made = Finding.of(jointly(conditions), shown or least, n=n)
    return replace(made, conditions=tuple(conditions), beside=tuple(beside), flags=flags)


def seeds_needed(condition: Condition) -> int | None:
    """Return how many seeds would decide an undecided condition, if its estimate stays.

    The interval of n seeds shrinks like one over their root; None if the condition is decided, or
    if the estimate sits on a boundary, where no number of seeds would do.

    Examples:
        An interval of 0 +- 4 is twice as wide as the margin of 2 allows:

        >>> open_ = Condition(name="", effect=Estimate(value=0, low=-4, high=4, n=10), margin=2.0)
        >>> seeds_needed(open_)
        41
    """
    effect = condition.effect
    if condition.verdict is not Verdict.UNDECIDED or effect.n < 1:
        return None
    factors = sorted(
        1.0001 * (end - effect.value) / (boundary - effect.value)
        for end in (effect.low, effect.high)
        for boundary in _boundaries(condition)
        if (end - effect.value) * (boundary - effect.value) > 0
    )
    for factor in (factor for factor in factors if factor > 1):
        if _shrunk(condition, factor).verdict is not Verdict.UNDECIDED:
            return ceil(effect.n * factor**2)
    return None


def change(condition: Condition) -> tuple[float, Verdict] | None:
    """Return the least shift of the estimate that changes its verdict, and the verdict then.

    None if no shift does.

    Examples:
        >>> sure = Condition(name="", effect=Estimate(value=5, low=4, high=6, n=10), margin=2.0)
        >>> shift, then = change(sure)
        >>> round(shift, 1), str(then)
        (-3.0, 'holds in part')
    """
    effect = condition.effect
    nudge = 1e-9 * max(1.0, abs(effect.value), effect.high - effect.low)
    shifts = sorted(
        (
            boundary - end + side
            for end in (effect.low, effect.value, effect.high)
            for boundary in _boundaries(condition)
            for side in (-nudge, nudge)
        ),
        key=abs,
    )
    for shift in shifts:
        then = replace(condition, effect=_moved(effect, shift)).verdict
        if then is not condition.verdict:
            return shift, then
    return None


def decided_by(finding: Finding) -> int | None:
    """Return how many seeds would decide an undecided claim, if its estimates stay.

    One refuted condition decides a claim of several, and so does the last one that comes to hold.
    """
    if finding.verdict is not Verdict.UNDECIDED:
        return None
    needed = [n for one in finding.conditions if (n := seeds_needed(one)) is not None]
    return min(needed, default=None)


def what_would_change(finding: Finding) -> str:
    """Say in words which change of one condition would change the verdict, and how large."""
    conditions = finding.conditions
    if not conditions:
        return ""
    if finding.verdict is Verdict.UNDECIDED:
        needed = decided_by(finding)
        return f"about {needed} seeds, if the estimate stays" if needed else ""
    found: list[tuple[float, str]] = []
    for k, one in enumerate(conditions):
        moved = change(one)
        if moved is None:
            continue
        shift, _ = moved
        other = replace(one, effect=_moved(one.effect, shift))
        joint = jointly([*conditions[:k], other, *conditions[k + 1 :]])
        if joint is not finding.verdict:
            size = abs(shift) / max(one.needed, one.effect.high - one.effect.low, 1e-12)
            found.append((size, f"{one.name}: an effect {shift:+.3g} away ({joint})"))
    return min(found)[1] if found else "no single condition"


def _boundaries(condition: Condition) -> tuple[float, ...]:
    """Return where a verdict can change."""
    return (0.0, condition.margin, -condition.margin, condition.needed)


def _moved(effect: Estimate, shift: float) -> Estimate:
    low, value, high = (end + shift for end in (effect.low, effect.value, effect.high))
    return replace(effect, low=low, value=value, high=high)


def _shrunk(condition: Condition, factor: float) -> Condition:
    effect = condition.effect
    low, high = (effect.value + (end - effect.value) / factor for end in (effect.low, effect.high))
    return replace(condition, effect=replace(effect, low=low, high=high))
