"""What comes back from an experiment: a table, where it comes from, and how a check went."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import pandas as pd

from cpl.store import PublishedShard

__all__ = ["Provenance", "Report", "Result"]


@dataclass(frozen=True, kw_only=True)
class Provenance:
    """Where a table comes from.

    Attributes:
        experiment: Name of the experiment.
        profile: Name of the profile; ``+`` behind it: with settings changed.
        published: Whether it was read from the published layer.
        parameters: The full configuration, as JSON.
        seeds: Every seed that went in.
        label: What kind of evidence it is.
        commit: Commit of the source that made it.
        modules: Digest of each module below the experiment, as it was computed.
        versions: Numerical packages.
        machine: Processor, cores, system, Python.
        made: Date (UTC).
        seconds: Processor time.
        content: Digest of what the table says.
        verified: Date of the last re-execution that agreed; None if the code changed since.
        stale: Why it is unverified, one line a reason.
        shards: Stretches of rows that were computed in one go.
        rules: The rules of the ledger that were fixed before, see `cpl.store.rules`.
    """

    experiment: str
    profile: str
    published: bool
    parameters: dict[str, Any]
    seeds: dict[str, int]
    label: str
    commit: str
    modules: dict[str, str]
    versions: dict[str, str]
    machine: dict[str, Any]
    made: str
    seconds: float
    content: str
    verified: str | None
    stale: tuple[str, ...] = ()
    shards: tuple[PublishedShard, ...] = ()
    rules: Mapping[str, str] = field(default_factory=dict[str, str])

    def __str__(self) -> str:
        checked = f"verified {self.verified}" if self.verified else "unverified"
        return (
            f"{self.experiment} ({self.profile}, {self.label}), made {self.made} "
            f"at {self.commit[:8]}, {checked}"
        )


@dataclass(frozen=True, kw_only=True)
class Result:
    """A table with the configuration that it answers and where it comes from."""

    table: pd.DataFrame
    config: Any
    provenance: Provenance


@dataclass(frozen=True, kw_only=True)
class Report:
    """What a re-execution compared.

    Attributes:
        experiment: Name of the experiment.
        profile: Profile that was published.
        checked: Names of the shards that were run again.
        of: Number of shards in all.
        differences: One line a shard that did not agree.
        seconds: Processor time it took.
        lacks: Why it could not be run further on this machine; empty if it could.
    """

    experiment: str
    profile: str
    checked: tuple[str, ...]
    of: int
    differences: tuple[str, ...]
    seconds: float
    lacks: str = ""

    @property
    def agrees(self) -> bool:
        """Whether everything that was run again agreed."""
        return not self.differences
