"""Two policies and who decides between them: the paper's switch.

A *chooser* looks at a `Moment` of a batch of roads and says where the safe policy drives. The
switch is one; `cpl.policies.controls` has others, which know less, or more.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cpl.highway import Engine

__all__ = ["Chooser", "Moment", "Switch", "switch", "thresholds"]

Bools = NDArray[np.bool_]
Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True, kw_only=True, eq=False)
class Moment:
    """What is known of n roads before a decision.

    Attributes:
        setting: Which of its settings the chooser is to use on each road, (n,).
        episode: Number of the episode that each road is in, (n,).
        step: Decisions taken in it before, (n,).
        obs: Observations, float32 (n, rows, features).
        l_hat: Forecast of l_tilde [-], (n,); meaningless where not `ready`.
        u: What is added to it: the quantile q or another uncertainty [-], (n,).
        ready: Whether there is a forecast yet, bool (n,).
        engine: The roads themselves, for oracles only.
    """

    setting: Ints
    episode: Ints
    step: Ints
    obs: NDArray[np.float32]
    l_hat: Floats
    u: Floats
    ready: Bools
    engine: Engine


Chooser = Callable[[Moment], Bools]
"""Says where the safe policy drives, (n,)."""


def switch(l_hat: ArrayLike, u: ArrayLike, q_safe: ArrayLike) -> Bools:
    r"""Say where the switching policy drives safely.

    $$ \pi_{switch} = \begin{cases} \pi_{safe} & \text{if } \hat l_t + u_t \ge q_{safe} \\
                                    \pi_{speed} & \text{otherwise} \end{cases} $$

    Paper: eq. (switch), where u is the quantile q. Other uncertainties take its place in the
    baselines, and 0 does in "No Quantile".

    Args:
        l_hat: Forecast of l_tilde [-].
        u: Uncertainty of the forecast [-], may be infinite.
        q_safe: Threshold [-].

    Returns:
        Whether the safe policy drives.

    Examples:
        Equality is safe:

        >>> switch([0.25, 0.25, 0.25], [0.0, 0.25, 0.5], 0.5).tolist()
        [False, True, True]
    """
    total = np.asarray(l_hat, np.float64) + np.asarray(u, np.float64)
    return total >= np.asarray(q_safe, np.float64)


def thresholds(q_safe: ArrayLike) -> Floats:
    """Check thresholds of the switch and return them as a vector.

    Forecast and score lie in [0, 1], so a threshold beyond 2 is never met and one below 0 always.

    Args:
        q_safe: One threshold or several [-].

    Raises:
        ValueError: If there is none, or one is not in [0, 2].

    Examples:
        >>> thresholds(0.3)
        array([0.3])
        >>> thresholds([0.3, 2.5])
        Traceback (most recent call last):
        ...
        ValueError: q_safe must lie in [0, 2], got 2.5
    """
    values = np.atleast_1d(np.asarray(q_safe, np.float64))
    if values.ndim != 1 or values.size == 0:
        raise ValueError(f"q_safe must be one threshold or a list of them, got {q_safe!r}")
    wrong = values[~((values >= 0.0) & (values <= 2.0))]
    if wrong.size:
        raise ValueError(f"q_safe must lie in [0, 2], got {float(wrong[0])!r}")
    return values


class Switch:
    """The paper's switching policy, one threshold a setting.

    Before the first forecast, that is before the fifth observation, the safe policy drives.

    Args:
        q_safe: Thresholds [-], each in [0, 2].

    Raises:
        ValueError: If a threshold is refused.
    """

    def __init__(self, q_safe: ArrayLike) -> None:
        self.q_safe = thresholds(q_safe)

    def __call__(self, moment: Moment) -> Bools:
        """Say where the safe policy drives."""
        danger = switch(moment.l_hat, moment.u, self.q_safe[moment.setting])
        return danger | ~moment.ready
