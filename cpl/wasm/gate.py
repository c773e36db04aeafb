"""The gate on one road, compiled: what `cpl.policies.gate.Gate` does with a tracked margin.

Its kernels are the same functions; what is repeated is the order of its calls and the margin's
update. Angle and size of the ego car's velocity are not numpy's to the last bit.
"""

from typing import Any

import numpy as np
from numba import njit

from cpl import portable
from cpl.policies.gate import GateConfig, _kernels
from cpl.policies.gate.config import ERRORS, FORECASTS

__all__ = ["ALPHA", "ETA", "GATE", "MEMORY", "Q0", "arrays", "begin", "choose"]

ALPHA, ETA, MEMORY, Q0 = 0.05, 0.3, 20.0, 2.0
"""Miscoverage, step in scales, decisions that the scale remembers, and the first threshold: those
of the chapter on the gate."""

GATE = (
    "scale", "growth", "gains", "tracked", "ego", "place", "age", "past", "past_id", "velocity",
    "unseen", "fresh", "issued", "cars", "ahead", "tolerated", "shift", "aims", "forecast",
    "identity", "errors", "known", "clearance", "taken", "missing",
)  # fmt: skip
"""A gate's arrays, in the order of `arrays`."""

_CONFIG = GateConfig()
_H, _SEEN, _FRAMES, _LANES, _DT = _CONFIG.horizon, 4, 15, 4, 1 / 15
_M = 2 * _SEEN  # rows of cars: as many again are remembered
_LOOKS = _H * _FRAMES // _CONFIG.stride
_FORECAST, _ERROR = FORECASTS.index(_CONFIG.forecast), ERRORS.index(_CONFIG.error)
_STRIDE, _AFTER, _WEIGHT = _CONFIG.stride, _CONFIG.after, _CONFIG.weight
_KEEP, _RADIUS, _FAR = _CONFIG.memory, _CONFIG.radius, _CONFIG.far
_LEAST, _RATE = 0.3, 1.0 / MEMORY
_OPTIONS: dict[str, Any] = {"_nrt": False, "error_model": "numpy", "forceinline": True}


def arrays() -> dict[str, np.ndarray]:
    """Return a gate's memory before its first episode, for the paper's road."""
    share = np.arange(1, _LOOKS + 1) / _LOOKS
    return {
        "scale": np.array([1.0, 200.0, 16.0, 80.0, 80.0]),
        "growth": np.maximum(share, _CONFIG.floor) ** _CONFIG.growth,
        "gains": np.tile(np.eye(2), (2, 1, 1)),
        "tracked": np.array([Q0, 1.0]),
        "ego": np.zeros((1, 5)),
        "place": np.zeros((1, 2)),
        "age": np.zeros(1, np.int64),
        "past": np.zeros((1, _H, _M, _H, 2)),
        "past_id": np.full((1, _H, _M), -1, np.int64),
        "velocity": np.zeros((1, _M, 2)),
        "unseen": np.zeros((1, _M), np.int64),
        "fresh": np.zeros(1, np.int64),
        "issued": np.zeros((1, _H, 3)),
        "cars": np.zeros((1, _M, 5)),
        "ahead": np.zeros((_M, _LOOKS, 2)),
        "tolerated": np.zeros((1, 5)),
        "shift": np.zeros((1, 5)),
        "aims": np.zeros((1, 5, 2)),
        "forecast": np.zeros((1, _M, _H, 2)),
        "identity": np.zeros((1, _M), np.int64),
        "errors": np.zeros((1, _H)),
        "known": np.zeros((1, _H), np.bool_),
        "clearance": np.zeros(1),
        "taken": np.zeros(_M, np.bool_),
        "missing": np.zeros(_M, np.int64),
    }


@njit(**_OPTIONS)
def begin(g: Any, forget: bool) -> None:  # noqa: ANN401
    """Begin an episode; the margin keeps what it has learned unless it is to forget."""
    age, place, past_id, tracked = g[6], g[5], g[8], g[3]
    age[0] = 0
    place[0, 0] = place[0, 1] = 0.0
    for h in range(_H):
        for k in range(_M):
            past_id[0, h, k] = -1
    if forget:
        tracked[0], tracked[1] = Q0, 1.0


@njit(**_OPTIONS)
def choose(g: Any, obs: np.ndarray, levels: np.ndarray, values: np.ndarray) -> int:  # noqa: ANN401
    """Choose an action, given how much the base policy likes each."""
    (
        scale, growth, gains, tracked, ego, place, age, past, past_id, velocity, unseen, fresh,
        issued, cars, ahead, tolerated, shift, aims, forecast, identity, errors, known, clearance,
        taken, missing,
    ) = g  # fmt: skip
    _read(scale, ego, place, age, cars, obs, levels)
    _kernels.associate(
        cars, _SEEN, ego, place, age, past, past_id, velocity, unseen, _KEEP, _RADIUS, _WEIGHT,
        gains, fresh, identity, taken, missing,
    )  # fmt: skip
    _kernels.score(
        cars, _SEEN, place, age, past, past_id, identity, _WEIGHT, _ERROR, _FAR, errors, known,
        clearance,
    )  # fmt: skip
    _learn(tracked, issued, errors[0, _H - 1], known[0, _H - 1])
    margin = tracked[0] * tracked[1]
    _kernels.look(
        cars, ego, levels, _LANES, _DT, _FRAMES, _STRIDE, _H, _FORECAST, _AFTER, _WEIGHT, growth,
        ahead, tolerated, shift, aims, forecast,
    )  # fmt: skip
    chosen = _first(tolerated[0], margin, values)
    _age_by_one(past, past_id, issued)
    for k in range(_M):
        past_id[0, 0, k] = identity[0, k]
        for h in range(_H):
            past[0, 0, k, h, 0] = forecast[0, k, h, 0] + place[0, 0]
            past[0, 0, k, h, 1] = forecast[0, k, h, 1]
    issued[0, 0, 0], issued[0, 0, 1], issued[0, 0, 2] = margin, tracked[0], tracked[1]
    place[0, 0] += shift[0, chosen]
    ego[0, 3], ego[0, 4] = aims[0, chosen, 0], aims[0, chosen, 1]
    age[0] += 1
    return chosen


@njit(**_OPTIONS)
def _age_by_one(past: np.ndarray, past_id: np.ndarray, issued: np.ndarray) -> None:
    """Move what was forecast and issued one decision back."""
    for h in range(_H - 1, 0, -1):
        for part in range(3):
            issued[0, h, part] = issued[0, h - 1, part]
        for k in range(_M):
            past_id[0, h, k] = past_id[0, h - 1, k]
            for j in range(_H):
                past[0, h, k, j, 0] = past[0, h - 1, k, j, 0]
                past[0, h, k, j, 1] = past[0, h - 1, k, j, 1]


@njit(**_OPTIONS)
def _read(
    scale: np.ndarray,
    ego: np.ndarray,
    place: np.ndarray,
    age: np.ndarray,
    cars: np.ndarray,
    obs: np.ndarray,
    levels: np.ndarray,
) -> None:
    for k in range(_SEEN):
        for c in range(5):
            cars[0, k, c] = obs[5 * (k + 1) + c] * scale[c]
    y, vx, vy = obs[2] * scale[2], obs[3] * scale[3], obs[4] * scale[4]
    ego[0, 0], ego[0, 1], ego[0, 2] = y, portable.atan(vy / vx), np.sqrt(vx * vx + vy * vy)
    if age[0] == 0:
        top = levels.shape[1] - 1
        ego[0, 3] = min(max(np.rint(y / 4.0), 0.0), _LANES - 1.0)
        index = np.rint((ego[0, 2] - levels[0, 0]) / (levels[0, top] - levels[0, 0]) * top)
        ego[0, 4] = levels[0, int(min(max(index, 0.0), float(top)))]
    place[0, 1] = y


@njit(**_OPTIONS)
def _learn(tracked: np.ndarray, issued: np.ndarray, error: float, known: bool) -> None:
    if known:
        q, scale = issued[0, _H - 1, 1], issued[0, _H - 1, 2]
        missed = error / (scale if scale > 0 else 1.0) > q
        tracked[0] = tracked[0] + ETA * (1.0 - ALPHA) if missed else tracked[0] - ETA * ALPHA
        tracked[1] = max(tracked[1] + _RATE * (abs(error) - tracked[1]), _LEAST)


@njit(**_OPTIONS)
def _first(tolerated: np.ndarray, margin: float, values: np.ndarray) -> int:
    """The most liked action that tolerates the margin, else the one that tolerates most."""
    chosen, safest = -1, -np.inf
    for k in range(5):
        safest = max(safest, tolerated[k])
        if tolerated[k] >= margin and (chosen < 0 or values[k] > values[chosen]):
            chosen = k
    if chosen >= 0:
        return chosen
    for k in range(5):
        if tolerated[k] >= safest and (chosen < 0 or values[k] > values[chosen]):
            chosen = k
    return chosen
