"""A batch's complete state, to look at, to store and to continue from."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from cpl.highway.config import Config
from cpl.highway.layout import Codes, Fields, Memory

__all__ = ["State", "read_state", "write_state"]


@dataclass(frozen=True, kw_only=True)
class State:
    """Everything an engine needs to continue; car 0 is the ego car, N environments, V + 1 cars.

    Attributes:
        x: Position along the road [m], float64 (N, V + 1).
        y: Position across the road, lane k at 4 k [m], float64 (N, V + 1).
        heading: Angle to the road, positive towards larger y [rad], float64 (N, V + 1).
        speed: Signed speed [m/s], float64 (N, V + 1).
        target_speed: Desired speed [m/s], float64 (N, V + 1).
        timer: Time since the last decision about a lane change [s], float64 (N, V + 1); the ego
            car's is not used.
        delta: Exponent of the car-following model [-], float64 (N, V + 1); ego car's not used.
        impact_x: Push along the road, applied in the next frame [m], float64 (N, V + 1).
        impact_y: Push across the road, applied in the next frame [m], float64 (N, V + 1).
        has_impact: Whether a push is due, bool (N, V + 1).
        crashed: Whether the car has crashed, bool (N, V + 1).
        lane: Closest lane [-], int64 (N, V + 1).
        target_lane: Lane steered to [-], int64 (N, V + 1).
        speed_index: Level of the ego car's target speed [-], int64 (N,).
        time: Time in the episode [s], float64 (N,).
        steps: Simulation frames in the episode [-], int64 (N,).
        generator: Random state, uint64 (N, 6): PCG64 state and increment (high, low), whether half
            of a draw is kept, and that half.
        noise_generator: The same for the observation's noise.
        ready: Whether the environment has been reset, bool (N,).
    """

    x: np.ndarray
    y: np.ndarray
    heading: np.ndarray
    speed: np.ndarray
    target_speed: np.ndarray
    timer: np.ndarray
    delta: np.ndarray
    impact_x: np.ndarray
    impact_y: np.ndarray
    has_impact: np.ndarray
    crashed: np.ndarray
    lane: np.ndarray
    target_lane: np.ndarray
    speed_index: np.ndarray
    time: np.ndarray
    steps: np.ndarray
    generator: np.ndarray
    noise_generator: np.ndarray
    ready: np.ndarray


_REALS = {
    "x": Fields.X,
    "y": Fields.Y,
    "heading": Fields.HEADING,
    "speed": Fields.SPEED,
    "target_speed": Fields.TARGET_SPEED,
    "timer": Fields.TIMER,
    "delta": Fields.DELTA,
    "impact_x": Fields.IMPACT_X,
    "impact_y": Fields.IMPACT_Y,
}
_FLAGS = {"has_impact": Codes.HAS_IMPACT, "crashed": Codes.CRASHED}
_LANES = {"lane": Codes.LANE, "target_lane": Codes.TARGET_LANE}


def read_state(memory: Memory, config: Config) -> State:
    """Copy a batch's state out of its memory.

    Args:
        memory: The batch.
        config: The road.

    Returns:
        The state, sharing nothing with the batch.
    """
    n = config.vehicles_count + 1
    found: dict[str, np.ndarray] = {}
    for name, row in _REALS.items():
        found[name] = memory.cars[:, row, :n].copy()
    for name, row in _FLAGS.items():
        found[name] = memory.codes[:, row, :n] != 0
    for name, row in _LANES.items():
        found[name] = memory.codes[:, row, :n].copy()
    for name in ("speed_index", "time", "steps", "generator", "noise_generator", "ready"):
        found[name] = getattr(memory, name).copy()
    return State(**found)


def write_state(memory: Memory, config: Config, state: State) -> None:
    """Copy a state into a batch's memory; nothing is written if anything is wrong.

    Args:
        memory: The batch.
        config: The road.
        state: The state.

    Raises:
        ValueError: Naming the array that has a wrong shape, kind or value.
    """
    n_envs, n = memory.cars.shape[0], config.vehicles_count + 1
    checked: dict[str, np.ndarray] = {}
    for field in fields(State):
        target = _shape_and_kind(field.name, memory, n_envs, n)
        checked[field.name] = _validated(field.name, getattr(state, field.name), *target, config)
    for name, row in _REALS.items():
        memory.cars[:, row, :n] = checked[name]
    for name, row in (_FLAGS | _LANES).items():
        memory.codes[:, row, :n] = checked[name]
    for name in ("speed_index", "time", "steps", "generator", "noise_generator", "ready"):
        getattr(memory, name)[:] = checked[name]


def _shape_and_kind(name: str, memory: Memory, n_envs: int, n: int) -> tuple[tuple, str]:
    if name in _REALS:
        return (n_envs, n), "f"
    if name in _FLAGS:
        return (n_envs, n), "b"
    if name in _LANES:
        return (n_envs, n), "i"
    stored = getattr(memory, name)
    return stored.shape, stored.dtype.kind


def _validated(name: str, value: np.ndarray, shape: tuple, kind: str, config: Config) -> np.ndarray:
    array = np.asarray(value)
    if array.shape != shape:
        raise ValueError(f"state.{name} must have shape {shape}, got {array.shape}")
    accepted = {"f": "fiu", "i": "iu", "u": "iu", "b": "b"}[kind]
    if array.dtype.kind not in accepted:
        raise ValueError(f"state.{name} must be of kind {kind!r}, got dtype {array.dtype}")
    if kind == "f" and not np.isfinite(array).all():
        raise ValueError(f"state.{name} must be finite, got {array[~np.isfinite(array)][0]}")
    limits = {
        "lane": config.lanes_count,
        "target_lane": config.lanes_count,
        "speed_index": len(config.target_speeds),
    }
    if name in limits and ((array < 0) | (array >= limits[name])).any():
        wrong = array[(array < 0) | (array >= limits[name])][0]
        raise ValueError(f"state.{name} must be in [0, {limits[name]}), got {wrong}")
    return array
