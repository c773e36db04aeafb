"""One module an experiment: what is asked, with which settings, and how a shard of it is computed.

A folder is a question, and an experiment a module of it that binds `EXPERIMENT`: its settings, how
it is cut into shards, what these are computed from, and the function that computes one
(`cpl.experiments.run.spec.Experiment`). `run` is the machinery, and `trained` holds what learns.

Nothing here imports an experiment until it is named: a chapter that shows one does not depend on
the code of the others.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from cpl.experiments.run.result import Report, Result

__all__ = ["compute", "names", "published", "verify"]


def compute(name: str, profile: str = "book", **changes: object) -> Result:
    """Compute an experiment, or find what was computed before with the same code and settings.

    Args:
        name: Name of the experiment.
        profile: `smoke`, `book` or `paper`.
        changes: Settings that differ from the profile's.

    Returns:
        The table with its configuration and provenance.

    Raises:
        ValueError: If there is no such experiment, profile or setting, or a value does not fit.

    Examples:
        >>> table = compute("proximity", profile="smoke").table
        >>> table.columns.tolist()
        ['l_m', 'l_tilde']
    """
    from cpl.experiments.run.publication import compute as _compute

    return _compute(name, profile, changes)


def published(name: str, profile: str = "paper") -> Result:
    """Return a published result; it is read, never computed.

    Args:
        name: Name of the experiment.
        profile: The profile it was published with.

    Returns:
        The table with its configuration and provenance; `provenance.stale` says why it is
        unverified, if it is.

    Raises:
        FileNotFoundError: If it is not published.
        cpl.store.DamagedResultError: If its files do not agree with each other.
    """
    from cpl.experiments.run.publication import published as _published

    return _published(name, profile)


def verify(name: str, profile: str = "paper", *, sample: int = 2, seed: int = 0) -> Report:
    """Re-execute a seeded sample of the shards of a published result and compare.

    What is discrete must be equal, floats agree to the experiment's tolerance.

    Args:
        name: Name of the experiment.
        profile: The profile it was published with.
        sample: How many shards.
        seed: Which ones.

    Returns:
        What was compared and what differed; `report.agrees`.

    Raises:
        FileNotFoundError: If it is not published.
        ValueError: If there is no such experiment, or ``sample`` is not positive.
    """
    from cpl.experiments.run.publication import verify as _verify

    return _verify(name, profile, sample=sample, seed=seed)


def names() -> tuple[str, ...]:
    """Return the names of all experiments, sorted, without importing any.

    Examples:
        >>> "proximity" in names()
        True
    """
    from cpl.experiments.run.found import names as _names

    return _names()
