"""One episode on one road, compiled: what `cpl.policies.evaluate.drive` does for many at once.

The parts are the same functions (engine, networks, distances); what is repeated here is the order
in which `drive` calls them and what it writes down. A test holds both to the same bits.
"""

from typing import Any

import numpy as np
from numba import njit

from cpl.network import forward
from cpl.wasm import gate

__all__ = ["COUNTS", "DRIVERS", "NUMBERS", "begin", "decide", "learn"]

DRIVERS = ("safe", "speed", "switch", "no quantile", "reader", "gate")
"""Who chooses, by number; the reader's action is written into the counts from outside."""

COUNTS = (
    "driver", "running", "length", "horizon", "delay", "steps", "safe", "safe_steps", "changes",
    "u_steps", "scored", "missed", "crashed", "ended", "overtaken", "ready", "action", "known",
    "err", "truncated",
)  # fmt: skip
"""Integers of a ride: its settings, its place, its sums, and what the last decision brought."""
NUMBERS = (
    "alpha", "share", "q_safe", "q", "greatest", "l_tilde", "l_hat", "u", "speed_sum", "u_sum",
    "start_x", "last_speed", "distance_m",
)  # fmt: skip
"""Floats of a ride: three settings, the tracker, what is known now, and sums."""

_OPTIONS: dict[str, Any] = {"_nrt": False, "error_model": "numpy", "forceinline": True}
_SAFE, _SPEED, _SWITCH, _NO_QUANTILE, _READER, _GATE = range(6)


@njit(**_OPTIONS)
def begin(
    i: np.ndarray, f: np.ndarray, history: np.ndarray, l_tilde: float, x: float, forget: bool
) -> None:
    """Begin an episode after the road's reset; `forget` resets the tracker too."""
    for k in range(5, i.size):
        i[k] = 0
    for k in range(5, f.size):
        f[k] = 0.0
    if forget:
        f[3] = f[4] = 0.0
    for k in range(history.size):
        history[k] = np.float32(0.0)
    f[5], f[10], f[11] = l_tilde, x, np.nan


@njit(**_OPTIONS)
def decide(
    i: np.ndarray,
    f: np.ndarray,
    rings: np.ndarray,
    history: np.ndarray,
    obs: np.ndarray,
    forecaster: tuple,
    safe: tuple,
    speed: tuple,
    work: np.ndarray,
    looking: Any,  # noqa: ANN401
    levels: np.ndarray,
) -> None:
    """Remember the observation, forecast, and let the driver choose."""
    width, length = obs.size, i[2]
    for k in range((length - 1) * width):
        history[k] = history[k + width]
    for k in range(width):
        history[(length - 1) * width + k] = obs[k]
    ready = i[5] >= length - 1
    for k in range(history.size):
        work[0, k] = history[k]
    forward(forecaster[0], forecaster[1], forecaster[2], work)
    l_hat = np.float64(work[0, 0])
    u = 0.0 if i[0] == _NO_QUANTILE else f[3]
    at = i[5] % (i[4] + 1)
    rings[0, at], rings[1, at] = l_hat, u
    careful = i[0] == _SAFE
    if i[0] == _SWITCH or i[0] == _NO_QUANTILE:
        careful = l_hat + u >= f[2] or not ready
    if i[0] != _READER:
        i[16] = _liked(safe if careful else speed, obs, work)
    if i[0] == _GATE:
        i[16] = gate.choose(looking, obs, levels, work[0])
    i[7] += careful
    if i[5] > 0 and careful != (i[6] != 0):
        i[8] += 1
    i[6], i[15] = careful, ready
    f[6], f[7] = l_hat, u
    if ready:
        f[9] += u
        i[9] += 1


@njit(**_OPTIONS)
def _liked(network: tuple, obs: np.ndarray, work: np.ndarray) -> int:
    """The action of the largest value, the first of equals."""
    for k in range(obs.size):
        work[0, k] = obs[k]
    forward(network[0], network[1], network[2], work)
    best = 0
    for k in range(1, 5):
        if work[0, k] > work[0, best]:
            best = k
    return best


@njit(**_OPTIONS)
def learn(
    i: np.ndarray,
    f: np.ndarray,
    rings: np.ndarray,
    x: np.ndarray,
    n: int,
    l_tilde: float,
    speed: float,
    crashed: bool,
    truncated: bool,
) -> None:
    """Take a step's outcome in: feed back the score that is known now, and add up."""
    i[5] += 1
    step, size = i[5], i[4] + 1
    rings[2, step % size] = l_tilde
    made = step - i[4]
    i[17] = i[18] = 0
    if made >= i[2] - 1:
        score = abs(rings[2, (made + i[3]) % size] - rings[0, made % size])
        err = score > rings[1, made % size]
        i[17], i[18] = 1, err
        i[10] += 1
        i[11] += err
        if i[0] != _NO_QUANTILE:
            f[4] = max(f[4], score)
            eta = f[1] * f[4] if i[1] else f[1]
            f[3] = f[3] + eta * (1.0 - f[0]) if err else f[3] - eta * f[0]
    f[5] = l_tilde
    f[8] += speed
    f[11] = speed
    f[12] = x[0] - f[10]
    behind = 0
    for k in range(1, n):
        behind += 1 if x[k] <= x[0] else 0
    i[14] = behind
    i[12], i[19] = crashed, truncated
    i[13] = crashed or truncated
