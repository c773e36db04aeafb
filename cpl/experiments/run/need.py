"""What an experiment is computed from: shards of other experiments, found or computed first.

An experiment that stands on others says so shard by shard,

    upstream(config, shard) -> list[Need]

and its `run_shard(config, shard, inputs)` gets the tables. So a shard stays a pure function: it
computes the same wherever it runs, and nothing is looked up behind its back.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import pandas as pd

__all__ = ["Inputs", "Need"]

Inputs = Mapping[str, Mapping[str, pd.DataFrame]]
"""By name of the need, then by name of the shard: the table."""


@dataclass(frozen=True, kw_only=True)
class Need:
    """Some shards of another experiment.

    Attributes:
        experiment: Its name.
        config: Its configuration.
        shards: Which of its shards.
        name: Under which name `run_shard` finds them; the experiment's unless given.
    """

    experiment: str
    config: Any
    shards: tuple[str, ...]
    name: str = ""

    @property
    def label(self) -> str:
        """The name that `run_shard` finds the tables under."""
        return self.name or self.experiment
