"""What the table of the family says of a member."""

from collections.abc import Callable
from dataclasses import dataclass

from cpl.conformal.rules import Rule

__all__ = ["Member"]


@dataclass(frozen=True, kw_only=True)
class Member:
    """One way to track a quantile.

    Attributes:
        name: What `cpl track --method` calls it; the name of its module but for underscores.
        title: What tables call it.
        year: Of the paper.
        paper: Who, and where; the key of the bibliography.
        make: The rule with plain settings, for scores of a given scale [score].
        guarantee: What is promised, in a few words.
        tuning: What somebody has to choose.
        memory: How many numbers it keeps.
        vectors: The public code that its numbers are compared with; empty where there is none.
    """

    name: str
    title: str
    year: int
    paper: str
    make: Callable[[float], Rule]
    guarantee: str
    tuning: str
    memory: str
    vectors: str = ""
