"""How a rule gets its tables: by asking a reader, so that a test can hand it others."""

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import pandas as pd
from numpy.typing import NDArray

__all__ = ["Reader", "Source"]


@dataclass(frozen=True, kw_only=True)
class Source:
    """A published table with the parameters that it answers."""

    table: pd.DataFrame
    parameters: dict[str, Any]

    def __len__(self) -> int:
        return len(self.table)

    def __getitem__(self, column: str) -> NDArray[Any]:
        """Return a column as an array."""
        return np.asarray(self.table[column])

    def total(self, *columns: str) -> int:
        """Return the sum over all rows of some columns."""
        return int(sum(self[column].sum() for column in columns))

    def where(self, chosen: NDArray[Any]) -> "Source":
        """Return the rows that a mask chooses."""
        rows = self.table.iloc[np.flatnonzero(chosen)].reset_index(drop=True)
        return Source(table=rows, parameters=self.parameters)


class Reader(Protocol):
    """Gives the published result of an experiment."""

    def __call__(self, experiment: str) -> Source:
        """Return the result; FileNotFoundError if there is none."""
        ...
