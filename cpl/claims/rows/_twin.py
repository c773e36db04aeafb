"""What the simulated quadruped shows of the claims that need the robot: rows 42 to 49.

Their verdict is *needs hardware* and no simulation changes it. What is computed here stands beside
it, in a column of its own and in words that no verdict uses: whether the twin leans the way the
paper's robot did, and by how much. Intervals are 95 %, over pairs of runs or over resampled runs.
"""

from collections.abc import Sequence

import numpy as np

from cpl.claims.claim import Source
from cpl.stats import Estimate

__all__ = [
    "AS",
    "FOLDER",
    "LEGGED",
    "NOT",
    "OPEN",
    "PART",
    "WHERE",
    "both",
    "combined",
    "entry",
    "number",
    "ratio",
    "side",
]

FOLDER = "quadruped"  # the kinematic twin's logs: the ones with enough runs to say something
LEGGED = "quadruped-legged"
WHERE = {"in": "in distribution", "out": "out of it"}
AS = "as claimed"
PART = "as claimed in part"
NOT = "not as claimed"
OPEN = "undecided"


def combined(parts: Sequence[str]) -> str:
    """Put the parts of a claim together: all, some, none of them, or nobody knows.

    Examples:
        >>> combined(["as claimed", "undecided"]), combined(["undecided", "not as claimed"])
        ('as claimed in part', 'not as claimed')
    """
    if not parts:
        msg = f"parts must not be empty, got {parts!r}"
        raise ValueError(msg)
    if set(parts) == {AS}:
        return AS
    if AS in parts:
        return PART
    return NOT if NOT in parts else OPEN


def entry(
    logs: Source, row: int, number: str, shape: str, part: str, *, folder: str = FOLDER
) -> Estimate:
    """Return one number of the table, which must hold it exactly once."""
    wanted = {"folder": folder, "row": row, "number": number, "shape": shape, "part": part}
    chosen = np.ones(len(logs), dtype=bool)
    for name, value in wanted.items():
        chosen &= logs[name] == value
    found = logs.where(chosen)
    if len(found) != 1:
        msg = f"quadruped_logs must have one row for {wanted}, got {len(found)}"
        raise ValueError(msg)
    value, low, high = (float(found[name][0]) for name in ("value", "low", "high"))
    return Estimate(value=value, low=low, high=high, n=int(found["n"][0]))


def side(estimate: Estimate, *, below: float | None = None, above: float | None = None) -> str:
    """Say whether an interval lies on the claimed side of a level, on the other, or across it."""
    level = below if above is None else above
    if level is None:
        msg = f"one of below and above must be given, got {below!r} and {above!r}"
        raise ValueError(msg)
    under, over = estimate.high < level, estimate.low > level
    if under or over:
        return AS if under == (above is None) else NOT
    return OPEN


def both(parts: dict[str, Estimate], unit: str) -> str:
    """Write a difference in and out of distribution."""
    return ", ".join(f"{number(each, unit)} {WHERE[part]}" for part, each in parts.items())


def number(estimate: Estimate, unit: str) -> str:
    """Write a difference with its interval, signs shown."""
    low, high = (f"{end:+.2f}" for end in (estimate.low, estimate.high))
    return f"{estimate.value:+.2f}{' ' * bool(unit)}{unit} ({low} to {high})"


def ratio(estimate: Estimate) -> str:
    """Write a ratio with its interval."""
    return f"{estimate.value:.2f} ({estimate.low:.2f} to {estimate.high:.2f})"
