"""What recordings of other machines show of the paper's words: rows 47 and 48, never a verdict.

Cars, a flying camera, a camera in a hand, wheels and legs are not the paper's robot, and its SLAM
errors are not their drift. Where they lean the same way, the words hold more widely than they were
said; where they do not, nothing follows for that robot.
"""

import numpy as np

from cpl.claims.claim import Reader, Source
from cpl.claims.rows._twin import AS, NOT, OPEN
from cpl.stats import Estimate

__all__ = ["NAMES", "leaning", "met", "recordings", "told"]

NAMES = {
    "kitti-orb": "car (ORB-SLAM)",
    "kitti-sptam": "car (S-PTAM)",
    "euroc-v102": "flying",
    "fr2-desk": "hand-held",
    "turtlebot": "wheels",
    "staircase": "legs",
}


def recordings(read: Reader) -> Source:
    """Return the published table of the recordings."""
    return read("recorded")


def met(table: Source, number: str, machine: str, trained: str | None = None) -> Estimate:
    """Return a number of a machine's second half, with the forecaster of its own first half.

    Args:
        table: As `recordings` returns it.
        number: As `cpl.forecast.drift.answers` has it.
        machine: Which was met.
        trained: Which was trained on, if another.
    """
    chosen = (table["number"] == number) & (table["met"] == machine)
    found = table.where(chosen & (table["trained"] == (trained or machine)))
    if len(found) != 1:
        msg = f"recorded must have one row for {number} of {machine}, got {len(found)}"
        raise ValueError(msg)
    value, low, high = (float(found[name][0]) for name in ("value", "low", "high"))
    return Estimate(value=value, low=low, high=high, n=int(found["n"][0]))


def leaning(estimate: Estimate, *, level: float = 0.0) -> str:
    """Say on which side of a level an interval lies, or that it lies across it."""
    if not np.isfinite([estimate.low, estimate.high]).all():
        return OPEN
    return AS if estimate.low > level else NOT if estimate.high < level else OPEN


def told(name: str, estimate: Estimate, form: str) -> str:
    """Write a number with its interval, or that its recording is too short for one."""
    value = form.format(estimate.value)
    if not np.isfinite([estimate.low, estimate.high]).all():
        return f"{name} {value} (too short for an interval)"
    return f"{name} {value} ({form.format(estimate.low)} to {form.format(estimate.high)})"
