"""The compiled loops that drive a state rule: whole sequences, and many streams that advance."""

from typing import Any

import numpy as np
from numba import njit, types

from cpl.conformal.state import _SIGNATURE  # pyright: ignore[reportPrivateUsage]

__all__ = ["follow_state", "take_rows"]

_F, _I = types.float64, types.int64
_UPDATE = types.FunctionType(_SIGNATURE)


@njit([types.void(_UPDATE, _F[::1], _F[::1], _F[::1], _I[::1], _I, _F[::1])], cache=True)
def follow_state(
    update: Any,  # noqa: ANN401 - a compiled function
    state: np.ndarray,
    numbers: np.ndarray,
    scores: np.ndarray,
    ends: np.ndarray,
    delay: int,
    q: np.ndarray,
) -> None:
    """Fill ``q`` with the thresholds of one stream; ``state`` is carried through its episodes.

    What is still under way when an episode ends is never fed back, as in `_kernels.follow`.
    """
    here, settings = state.ctypes, numbers.ctypes
    start = 0
    for end in ends:
        for t in range(start, end):
            q[t] = state[0]
            i = t - delay + 1
            if i >= start:
                update(here, settings, scores[i], q[i])
        start = end


@njit([types.void(_UPDATE, _F[:, ::1], _F[::1], _F[::1], _F[::1])], cache=True)
def take_rows(
    update: Any,  # noqa: ANN401 - a compiled function
    states: np.ndarray,
    numbers: np.ndarray,
    scores: np.ndarray,
    met: np.ndarray,
) -> None:
    """Give every row's state its score, and the threshold that it met."""
    settings = numbers.ctypes
    for n in range(states.shape[0]):
        update(states[n].ctypes, settings, scores[n], met[n])
