"""What the ego car sees (highway-env's Kinematics observation) and what it earns."""

from __future__ import annotations

import math

import numpy as np

from cpl.highway._compile import fma, inlined, inner
from cpl.highway.draws import normal, shuffled_place, uniform
from cpl.highway.geometry import CAR_LENGTH, LANE_WIDTH, on_lane, wrap_to_pi
from cpl.highway.layout import Car, Settings

__all__ = ["observe", "reward_terms"]

_SIGHT = 200.0
"""How far the ego car sees [m]."""


@inner
def observe(
    car: Car,
    s: Settings,
    features: np.ndarray,
    ranges: np.ndarray,
    generator: np.ndarray,
    noise_generator: np.ndarray,
    nearest: np.ndarray,
    out: np.ndarray,
) -> None:
    """Write one observation.

    Args:
        car: The environment.
        s: The settings.
        features: Feature code of each column.
        ranges: Low, high and whether it applies, of each column.
        generator: The episode's generator, used by the shuffled order.
        noise_generator: The stream of noise and dropout.
        nearest: Working memory for car numbers.
        out: float32 (rows, columns).
    """
    count = _nearest(car, s, nearest)
    for row in range(s.rows):
        for column in range(s.columns):
            if row == 0 or row <= count:
                i = 0 if row == 0 else nearest[row - 1]
                out[row, column] = _value(car, s, features[column], ranges, column, i, row > 0)
            else:
                out[row, column] = 0.0
    if s.noise > 0.0 or s.dropout > 0.0:
        _corrupt(s, features, ranges, noise_generator, count, out)
    if s.shuffled:
        for row in range(s.rows - 1, 1, -1):
            other = shuffled_place(generator, row - 1) + 1
            if other != row:
                for column in range(s.columns):
                    out[row, column], out[other, column] = out[other, column], out[row, column]


@inlined
def _nearest(car: Car, s: Settings, nearest: np.ndarray) -> int:
    """Pick the first rows - 1 cars in sight, by distance along the road unless shuffled."""
    count = 0
    room = s.rows - 1
    for j in range(1, s.n):
        dx, dy = car.x[j] - car.x[0], car.y[j] - car.y[0]
        if not (s.see_behind or dx > -2 * CAR_LENGTH) or math.sqrt(fma(dy, dy, dx * dx)) >= _SIGHT:
            continue
        if s.shuffled:
            if count < room:
                nearest[count] = j
                count += 1
            continue
        m = count
        while m > 0 and abs(car.x[nearest[m - 1]] - car.x[0]) > abs(dx):
            m -= 1
        if m < room:
            count = min(count + 1, room)
            for k in range(count - 1, m, -1):
                nearest[k] = nearest[k - 1]
            nearest[m] = j
    return count


@inlined
def _value(
    car: Car, s: Settings, feature: int, ranges: np.ndarray, column: int, i: int, other: bool
) -> float:
    value = _raw(car, feature, i)
    if other and not s.absolute and 1 <= feature <= 4:
        value -= _raw(car, feature, 0)
    if s.normalize and ranges[column, 2] > 0.0:
        low, high = ranges[column, 0], ranges[column, 1]
        value = -1 + (value - low) * 2 / (high - low)
        if s.clip:
            value = min(max(value, -1.0), 1.0)
    return value


@inlined
def _raw(car: Car, feature: int, i: int) -> float:
    if feature <= 4:
        return _position_or_velocity(car, feature, i)
    if feature == 5:
        return car.heading[i]
    if feature == 6:
        return car.cos[i]
    if feature == 7:
        return car.sin[i]
    if feature == 10:
        return car.x[i]
    if feature == 11:
        return car.y[i] - LANE_WIDTH * car.lane[i]
    if feature == 12:
        return wrap_to_pi(car.heading[i])
    return 0.0  # 8 and 9: a car without a route has no destination's direction


@inlined
def _position_or_velocity(car: Car, feature: int, i: int) -> float:
    if feature == 1:
        return car.x[i]
    if feature == 2:
        return car.y[i]
    if feature == 3:
        return car.speed[i] * car.cos[i]
    if feature == 4:
        return car.speed[i] * car.sin[i]
    return 1.0


@inlined
def _corrupt(
    s: Settings,
    features: np.ndarray,
    ranges: np.ndarray,
    generator: np.ndarray,
    count: int,
    out: np.ndarray,
) -> None:
    for row in range(1, min(count + 1, s.rows)):
        if s.dropout > 0.0 and uniform(generator, 0.0, 1.0) < s.dropout:
            for column in range(s.columns):
                out[row, column] = 0.0
        elif s.noise > 0.0:
            for column in range(s.columns):
                if features[column] != 0:
                    value = out[row, column] + s.noise * normal(generator)
                    if s.normalize and s.clip and ranges[column, 2] > 0.0:
                        value = min(max(value, -1.0), 1.0)
                    out[row, column] = value


@inlined
def reward_terms(car: Car, s: Settings, out: np.ndarray) -> float:
    """Write crashed, right lane, high speed and on road; return their weighted sum."""
    forward = car.speed[0] * car.cos[0]
    scaled = 0 + (forward - s.reward_low) * 1 / (s.reward_high - s.reward_low)
    crashed = float(car.crashed[0])
    right = car.target_lane[0] / max(s.lanes - 1, 1)
    fast = min(max(scaled, 0.0), 1.0)
    on_road = 1.0 if on_lane(car.x[0], car.y[0], car.lane[0], 0.0) else 0.0
    out[0], out[1], out[2], out[3] = crashed, right, fast, on_road
    total = s.collision_reward * crashed + s.right_lane_reward * right + s.high_speed_reward * fast
    if s.normalize_reward:
        best = s.high_speed_reward + s.right_lane_reward
        total = 0 + (total - s.collision_reward) * 1 / (best - s.collision_reward)
    return total * on_road
