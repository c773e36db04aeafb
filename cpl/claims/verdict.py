"""What can be said of a claim, and the rule that decides on an effect of a stated size."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import StrEnum

from cpl.stats import Estimate

__all__ = ["Finding", "Leaning", "Verdict", "rule_r"]


class Verdict(StrEnum):
    """What can be said of a claim."""

    HOLDS = "holds"
    IN_PART = "holds in part"
    FAILS = "does not hold"
    UNDECIDED = "undecided"
    CORRECTED = "false as printed, true as corrected"
    HARDWARE = "needs hardware"
    PENDING = "pending"


@dataclass(frozen=True, kw_only=True)
class Finding:
    """What a rule found in the tables.

    Attributes:
        verdict: Its verdict.
        value: Our number; what it is, the rule says in words.
        low: Lower end of its 95 % interval; None where the number is an extreme, not an estimate.
        high: Upper end.
        n: Units looked at (draws, sequences, windows, episodes, ...).
        n_seeds: Seeds they come from; 0 for exact enumeration.
        flags: What a reader must know beside it (``underpowered``).
    """

    verdict: Verdict
    value: float
    low: float | None = None
    high: float | None = None
    n: int
    n_seeds: int
    flags: tuple[str, ...] = ()

    @classmethod
    def of(cls, verdict: Verdict, estimate: Estimate, *, n: int) -> "Finding":
        """Return what a rule found that rests on one estimate over seeds."""
        value, low, high = estimate.value, estimate.low, estimate.high
        return cls(verdict=verdict, value=value, low=low, high=high, n=n, n_seeds=estimate.n)


@dataclass(frozen=True, kw_only=True)
class Leaning:
    """What a twin shows of a claim about the robot.

    Attributes:
        leans: ``as claimed``, ``as claimed in part``, ``not as claimed`` or ``undecided``.
        text: The numbers.
    """

    leans: str
    text: str

    def __str__(self) -> str:
        return f"{self.leans}: {self.text}"


def rule_r(effects: Iterable[Estimate], claimed: Sequence[float | None]) -> Verdict:
    """Decide whether an effect is there, in all conditions in which it was claimed.

    For one condition, with c the claimed size (positive = in the claimed direction):

    - *holds*: the interval excludes 0 in the claimed direction and the effect is at least c / 2
      (where the paper gives no size, the direction alone decides);
    - *undecided*: the interval contains both 0 and c / 2 (0 alone, without a size);
    - *does not hold*: the interval lies at or below 0, or wholly below c / 2;
    - *holds in part*: what remains, an effect that is there but smaller.

    Over the conditions: all alike, that verdict; else *holds in part* if it holds in any, wholly or
    in part; else *undecided* if any is.

    Args:
        effects: One estimate a condition, positive in the claimed direction.
        claimed: Claimed size in each, > 0; None where the paper gives none.

    Raises:
        ValueError: If there is no condition, their numbers differ, or a claimed size is not > 0.

    Examples:
        The paper claims 12.8 s; we find 7 s, between 5 and 9:

        >>> str(rule_r([Estimate(value=7.0, low=5.0, high=9.0, n=500)], [12.8]))
        'holds'
        >>> str(rule_r([Estimate(value=4.0, low=1.0, high=7.0, n=500)], [12.8]))
        'holds in part'
    """
    estimates = list(effects)
    if not estimates or len(estimates) != len(claimed):
        msg = f"claimed must have one size a condition, got {len(estimates)} and {len(claimed)}"
        raise ValueError(msg)
    each = {_one(effect, size) for effect, size in zip(estimates, claimed, strict=True)}
    if len(each) == 1:
        return each.pop()
    return Verdict.IN_PART if each & {Verdict.HOLDS, Verdict.IN_PART} else Verdict.UNDECIDED


def _one(effect: Estimate, size: float | None) -> Verdict:
    if size is not None and not size > 0:
        msg = f"claimed sizes must be > 0 in the claimed direction, got {size!r}"
        raise ValueError(msg)
    half = 0.0 if size is None else size / 2
    if effect.low > 0 and effect.value >= half:
        return Verdict.HOLDS
    if effect.high <= 0 or effect.high < half:
        return Verdict.FAILS
    return Verdict.UNDECIDED if effect.low <= 0 else Verdict.IN_PART
