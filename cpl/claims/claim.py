"""What a claim is: a statement with its place and its rule, and how the rule gets its tables."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from cpl.claims.verdict import Finding, Leaning
from cpl.store import canonical_json, table_digest

__all__ = ["HARDWARE", "INCONSISTENT", "Claim", "Reader", "Source"]

INCONSISTENT = "paper inconsistent"
HARDWARE = "needs hardware"


@dataclass(frozen=True, kw_only=True, eq=False)
class Source:
    """A published table with the parameters that it answers.

    Two sources are equal if they say the same, so that what was computed from one can be kept.

    Attributes:
        table: The table.
        parameters: The configuration that it was computed with.
        content: Digest of the table, where it is known already.
    """

    table: pd.DataFrame
    parameters: dict[str, Any]
    content: str = ""

    def __len__(self) -> int:
        return len(self.table)

    def __getitem__(self, column: str) -> NDArray[Any]:
        """Return a column as an array."""
        return np.asarray(self.table[column])

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Source) and self._said == other._said

    def __hash__(self) -> int:
        return hash(self._said)

    @cached_property
    def _said(self) -> tuple[str, str]:
        return self.content or table_digest(self.table), canonical_json(self.parameters)

    def total(self, *columns: str) -> int:
        """Return the sum over all rows of some columns."""
        return int(sum(self[column].sum() for column in columns))

    def where(self, chosen: NDArray[Any]) -> "Source":
        """Return the rows that a mask chooses."""
        rows = self.table.iloc[np.flatnonzero(chosen)].reset_index(drop=True)
        return Source(table=rows, parameters=self.parameters)


class Reader(Protocol):
    """Gives the published result of an experiment; a test hands a rule other ones."""

    def __call__(self, experiment: str) -> Source:
        """Return the result; FileNotFoundError if there is none."""
        ...


@dataclass(frozen=True, kw_only=True)
class Claim:
    """One claim.

    Attributes:
        row: Its number in the ledger; the paper's come first.
        claim: What is claimed, in our words.
        where: Place in the paper.
        paper_value: The number that the paper gives, if any.
        formula: The claim typeset, in LaTeX.
        rule: What our number is, and what decides.
        unit: Unit of our number; ``1`` where it has none.
        margin: The smallest effect that matters or the level that is claimed, and why.
        revised: What the second edition changed in the rule, and why; empty if nothing.
        chapter: Slug of the chapter that shows it.
        decide: The rule; it only counts and compares, and starts no experiment.
        in_the_twin: What the simulated quadruped shows of a claim about the robot; never a verdict.
        on_other_machines: What recordings of other machines show of it; never a verdict.
        flags: ``paper inconsistent``, ``needs hardware``.
        ours: Whether this book makes the claim, and not the paper.
    """

    row: int
    claim: str
    where: str
    paper_value: str | None = None
    formula: str
    rule: str
    unit: str
    margin: str
    revised: str = ""
    chapter: str
    decide: Callable[[Reader], Finding] | None = None
    in_the_twin: Callable[[Reader], Leaning] | None = None
    on_other_machines: Callable[[Reader], Leaning] | None = None
    flags: tuple[str, ...] = ()
    ours: bool = False
