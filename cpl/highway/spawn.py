"""How an episode begins: the ego car, then the others one behind the last along the road."""

from __future__ import annotations

import math

import numpy as np

from cpl.highway._compile import inlined, inner
from cpl.highway.behaviour import speed_divisor, speed_level
from cpl.highway.draws import bounded, uniform
from cpl.highway.layout import Car, Settings

__all__ = ["spawn"]


@inner
def spawn(car: Car, s: Settings, levels: np.ndarray, generator: np.ndarray) -> np.int64:
    """Place the cars in highway-env's order of draws.

    Args:
        car: The environment, written.
        s: The settings.
        levels: Speed levels of the ego car [m/s].
        generator: The episode's generator.

    Returns:
        The ego car's speed level.
    """
    lane = s.initial_lane if s.initial_lane >= 0 else bounded(generator, s.lanes)
    speed = s.initial_speed
    offset = s.ego_gap * (12 + 1.0 * speed) * s.gap_factor
    x = 3 * offset + offset * uniform(generator, 0.9, 1.1 - 0.9)
    index = speed_level(levels, speed)
    _place(car, s, 0, x, lane, speed, levels[index])
    for i in range(1, s.n):
        lane = bounded(generator, s.lanes)
        speed = uniform(generator, s.speed_low, s.speed_span)
        offset = s.other_gap * (12 + 1.0 * speed) * s.gap_factor
        x += offset * uniform(generator, 0.9, 1.1 - 0.9)
        _place(car, s, i, x, lane, speed, speed)
        car.delta[i] = uniform(generator, s.delta_low, s.delta_span)
    return index


@inlined
def _place(
    car: Car, s: Settings, i: int, x: float, lane: int, speed: float, target_speed: float
) -> None:
    car.x[i] = x
    car.y[i] = 4.0 * lane
    car.heading[i] = 0.0
    car.speed[i] = speed
    car.target_speed[i] = target_speed
    car.divisor[i] = speed_divisor(s, target_speed)
    car.timer[i] = (x + car.y[i]) * math.pi % 1.0
    car.delta[i] = 4.0
    car.impact_x[i] = car.impact_y[i] = 0.0
    car.cos[i], car.sin[i] = 1.0, 0.0
    car.lane[i] = car.target_lane[i] = lane
    car.crashed[i] = car.has_impact[i] = 0
    car.order[i] = i
