"""What a cell of a table or of a run's description holds, or that it holds nothing."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

__all__ = ["points", "said", "unknown"]


def points(rows: pd.DataFrame, *names: str) -> NDArray[np.float64] | None:
    """Return columns as points, or None where one is missing or nobody knows it."""
    if not set(names) <= set(rows):
        return None
    points = rows[list(names)].to_numpy(dtype=np.float64)
    return None if np.isnan(points).any() else points


def said(row: dict[str, Any], name: str, otherwise: Any) -> Any:  # noqa: ANN401
    """Return an entry of a run's description, or something else where it has none."""
    value = row.get(name)
    return otherwise if unknown(value) else value


def unknown(value: object) -> bool:
    """Tell whether a cell of a summary holds nothing."""
    return value is None or (isinstance(value, float) and np.isnan(value))
