"""Which statements of the theory does a machine prove for all real numbers?

The statements, and what they leave to be seen by hand, are in `cpl.conformal.certificates`.
"""

import re
from dataclasses import dataclass

import pandas as pd

from cpl.conformal.certificates import CERTIFICATES, as_table
from cpl.experiments.run.spec import Experiment, Shard
from cpl.settings.ranges import Settings

__all__ = ["EXPERIMENT", "PROFILES", "Config"]


@dataclass(frozen=True, kw_only=True)
class Config(Settings):
    """Which certificates.

    Attributes:
        about: Only those whose name contains this text; empty for all.
    """

    about: str

    def __post_init__(self) -> None:
        super().__post_init__()
        if not any(self.about in name for name in CERTIFICATES):
            raise ValueError(f"about must be part of a certificate's name, got {self.about!r}")


PROFILES = {
    "smoke": Config(about="range"),
    "book": Config(about=""),
    "paper": Config(about=""),
}


def _shards(config: Config) -> list[Shard]:
    """Return one piece a certificate."""
    return [
        Shard(re.sub(r"[^a-z0-9]+", "-", name.lower()).strip("-"), {"name": name})
        for name in CERTIFICATES
        if config.about in name
    ]


def run_shard(config: Config, shard: Shard) -> pd.DataFrame:
    """Ask z3.

    Returns:
        One row: ``name, kind`` (proof or counterexample), ``statement, by_machine, by_hand``,
        ``verdict`` (``proved``, ``found``, or what went wrong), ``queries``. The numbers of a
        counterexample are left out: which of many z3 finds depends on what it was asked before.
    """
    del config
    return as_table([CERTIFICATES[shard.text("name")].check()]).drop(columns="numbers")


EXPERIMENT = Experiment(
    run=run_shard,
    profiles=PROFILES,
    shards=_shards,
    label="proved",
)
