"""highway-env itself, opened up: its full state read into arrays and written back.

highway-env is the oracle of the compiled engine and the renderer of its episodes. Both uses need
the same two functions: take everything that its next frame depends on out of a road of highway-env,
and put a state that the engine has reached (or that nature would never reach) into one. Everything
here imports highway-env when it is called, never when it is imported.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from collections.abc import Mapping

    from highway_env.envs.highway_env import HighwayEnv
    from highway_env.vehicle.behavior import IDMVehicle
    from highway_env.vehicle.controller import MDPVehicle

__all__ = ["CAR_FIELDS", "EGO_FIELDS", "read_state", "reference_env", "write_state"]

CAR_FIELDS: dict[str, type] = {
    "x": np.float64,  # [m] along the road
    "y": np.float64,  # [m] across it, 0 in the middle of the leftmost lane, growing to the right
    "heading": np.float64,  # [rad]
    "speed": np.float64,  # [m/s]
    "target_speed": np.float64,  # [m/s]
    "lane": np.int64,
    "target_lane": np.int64,
    "timer": np.float64,  # [s] since the last lane-change decision; 0 for the ego, which has none
    "delta": np.float64,  # IDM exponent; 0 for the ego, which has none
    "crashed": np.bool_,
    "has_impact": np.bool_,  # a push is pending that the next frame applies
    "impact_x": np.float64,  # [m]
    "impact_y": np.float64,  # [m]
}
"""What the next frame needs to know of each car; the ego is row 0."""

EGO_FIELDS: dict[str, type] = {
    "speed_index": np.int64,  # into the speed levels
    "time": np.float64,  # [s] since the reset
    "steps": np.int64,  # frames since the reset
}
"""What it needs to know once."""


def reference_env(options: Mapping[str, Any], *, fast: bool = False) -> HighwayEnv:
    """Make highway-env's own environment, without a wrapper.

    Args:
        options: highway-env's nested configuration dictionary.
        fast: `highway-fast-v0` (only collisions with the ego are checked) instead of `highway-v0`.

    Returns:
        A `highway_env.envs.HighwayEnv`, already reset once, as highway-env does when it is made.
    """
    from highway_env.envs import highway_env as environments

    kind = environments.HighwayEnvFast if fast else environments.HighwayEnv
    return kind(config=dict(options))


def read_state(env: HighwayEnv) -> dict[str, NDArray[Any]]:
    """Take the full state out of a highway-env environment.

    Args:
        env: the unwrapped environment of highway-env.

    Returns:
        An array of shape `(cars,)` for each of `CAR_FIELDS` and one of shape `()` for each of
        `EGO_FIELDS`; a pending impact that is absent is 0.
    """
    columns: dict[str, list[Any]] = {name: [] for name in CAR_FIELDS}
    for car in _cars(env):
        for name, value in zip(CAR_FIELDS, _read_car(car), strict=True):
            columns[name].append(value)
    state = {name: np.array(columns[name], dtype=kind) for name, kind in CAR_FIELDS.items()}
    single = (_cars(env)[0].speed_index, env.time, env.steps)
    for name, value in zip(EGO_FIELDS, single, strict=True):
        state[name] = np.array(value, dtype=EGO_FIELDS[name])
    return state


def write_state(env: HighwayEnv, state: Mapping[str, NDArray[Any]]) -> None:
    """Put a full state into a highway-env environment with as many cars.

    Each car's present lane is the one that highway-env finds for its position and heading.

    Args:
        env: the unwrapped environment of highway-env, reset before.
        state: what `read_state` returns.

    Raises:
        ValueError: if the state and the road differ in their number of cars.
    """
    cars = _cars(env)
    if len(state["x"]) != len(cars):
        raise ValueError(f"state has {len(state['x'])} cars; the road has {len(cars)}")
    for row, car in enumerate(cars):
        _write_car(car, {name: state[name][row] for name in CAR_FIELDS})
    cars[0].speed_index = int(state["speed_index"])
    env.time = float(state["time"])
    env.steps = int(state["steps"])


def _cars(env: HighwayEnv) -> list[MDPVehicle]:
    return cast("list[MDPVehicle]", env.road.vehicles)


def _read_car(car: MDPVehicle | IDMVehicle) -> tuple[object, ...]:
    impact = (0.0, 0.0) if car.impact is None else car.impact
    return (
        car.position[0],
        car.position[1],
        car.heading,
        car.speed,
        car.target_speed,
        car.lane_index[2],
        car.target_lane_index[2],
        getattr(car, "timer", 0.0),
        getattr(car, "DELTA", 0.0),
        car.crashed,
        car.impact is not None,
        impact[0],
        impact[1],
    )


def _write_car(car: MDPVehicle | IDMVehicle, values: Mapping[str, Any]) -> None:
    car.position = np.array([values["x"], values["y"]], dtype=np.float64)
    car.heading = float(values["heading"])
    car.speed = float(values["speed"])
    car.target_speed = float(values["target_speed"])
    car.on_state_update()
    origin, destination, _ = car.lane_index
    car.target_lane_index = (origin, destination, int(values["target_lane"]))
    car.crashed = bool(values["crashed"])
    pending = np.array([values["impact_x"], values["impact_y"]], dtype=np.float64)
    vars(car)["impact"] = pending if values["has_impact"] else None
    if hasattr(car, "timer"):
        vars(car).update(timer=float(values["timer"]), DELTA=float(values["delta"]))
