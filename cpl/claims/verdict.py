"""What can be said of a claim, and what a rule hands back."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from cpl.claims.judging import Condition
    from cpl.stats import Estimate

__all__ = ["SIGNS", "Finding", "Leaning", "Verdict"]


class Verdict(StrEnum):
    """What can be said of a claim."""

    HOLDS = "holds"
    IN_PART = "holds in part"
    NONE = "no difference"
    FAILS = "does not hold"
    UNDECIDED = "undecided"
    CORRECTED = "false as printed, true as corrected"
    HARDWARE = "needs hardware"
    PENDING = "pending"


SIGNS = {
    Verdict.HOLDS: "✓",
    Verdict.IN_PART: "◐",
    Verdict.CORRECTED: "✎",
    Verdict.FAILS: "✕",
    Verdict.NONE: "≈",
    Verdict.UNDECIDED: "?",
    Verdict.HARDWARE: "⚙",
    Verdict.PENDING: "…",
}
"""A sign for the eye beside each verdict, in the order in which a page shows them."""


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
        flags: What a reader must know beside it.
        conditions: The effects that decided, where the claim is about effects.
        beside: What stands beside the verdict and does not decide: controls and other readings.
    """

    verdict: Verdict
    value: float
    low: float | None = None
    high: float | None = None
    n: int
    n_seeds: int
    flags: tuple[str, ...] = ()
    conditions: tuple[Condition, ...] = ()
    beside: tuple[Condition, ...] = ()

    @classmethod
    def of(cls, verdict: Verdict, estimate: Estimate, *, n: int) -> Finding:
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
