"""Interventions on the quantile: what an agent is shown in place of the one that is tracked.

Whether an agent *uses* an input cannot be read off a correlation: q and the agent's actions both
follow the traffic. Here q is set by somebody else, the road and the tracker go on as before, and
what the agent then does differently is the effect of q alone.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from cpl.policies.switch import Floats, Moment

__all__ = ["Do", "Doing", "freeze", "natural", "replay", "traces"]

Doing = Callable[[Floats, Moment], Floats]
"""From the tracked quantiles (n,) and the moment to what is shown, (n,)."""


class Do:
    """An intervention for each setting, for `cpl.policies.listen.ride`.

    Args:
        doings: By setting.

    Raises:
        ValueError: If there is none.
    """

    def __init__(self, doings: Sequence[Doing]) -> None:
        if not doings:
            raise ValueError(f"doings must name at least one intervention, got {doings!r}")
        self.doings = tuple(doings)

    def __call__(self, q: Floats, moment: Moment) -> Floats:
        """Return what each road's agent is shown."""
        shown = np.array(q, np.float64)
        for setting, doing in enumerate(self.doings):
            rows = moment.setting == setting
            if rows.any():
                shown[rows] = doing(q, moment)[rows]
        return shown


def natural(q: Floats, moment: Moment) -> Floats:
    """Leave the quantile as it is tracked."""
    del moment
    return q


def freeze(value: float) -> Doing:
    """Show the same value always.

    Args:
        value: What is shown [-].

    Raises:
        ValueError: If it is not finite.
    """
    if not np.isfinite(value):
        raise ValueError(f"value must be finite, got {value!r}")
    return lambda q, moment: np.full(len(q), value)


def replay(donors: ArrayLike) -> Doing:
    """Show the quantiles of other episodes, step by step.

    Args:
        donors: Quantiles [-], (episodes, steps), as from `traces`; episode e is shown those of
            donor e modulo their number.

    Raises:
        ValueError: If there is no donor, or a quantile is missing.
    """
    table = np.asarray(donors, np.float64)
    if table.ndim != 2 or table.size == 0 or not np.isfinite(table).all():
        raise ValueError(f"donors must be finite, (episodes, steps), got shape {table.shape}")
    last = table.shape[1] - 1
    return lambda q, moment: table[moment.episode % len(table), np.minimum(moment.step, last)]


def traces(steps: pd.DataFrame, length: int) -> Floats:
    """Arrange the quantiles of recorded episodes; after its end an episode keeps its last one.

    Args:
        steps: `seed`, `step` and `q`, one row a decision.
        length: Decisions of the longest episode.

    Returns:
        Shape (episodes, length), in the order of the seeds.

    Examples:
        >>> rows = pd.DataFrame({"seed": [7, 7, 9], "step": [0, 1, 0], "q": [0.0, 0.25, 0.5]})
        >>> traces(rows, 3).tolist()
        [[0.0, 0.25, 0.25], [0.5, 0.5, 0.5]]
    """
    seeds, episode = np.unique(steps["seed"], return_inverse=True)
    table = np.full((len(seeds), length), np.nan)
    table[episode, steps["step"].to_numpy()] = steps["q"]
    for t in range(1, length):
        ended = np.isnan(table[:, t])
        table[ended, t] = table[ended, t - 1]
    return table
