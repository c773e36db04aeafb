"""How a car moves in one frame: highway-env's bicycle model, its crash and its speed cap."""

from __future__ import annotations

import math

from cpl.highway._compile import inlined
from cpl.highway.geometry import MAX_SPEED, closest_lane
from cpl.highway.layout import Car, Scratch, Settings

__all__ = ["move"]


@inlined
def move(car: Car, s: Settings, w: Scratch) -> None:
    """Integrate every car over one frame, with the heading and speed before the frame."""
    for i in range(s.n):
        v = car.speed[i]
        acceleration = w.acceleration[i]
        steering = w.steering[i]
        if car.crashed[i]:
            steering = 0.0
            acceleration = -1.0 * v
        if v > MAX_SPEED:
            acceleration = min(acceleration, MAX_SPEED - v)
        elif v < -MAX_SPEED:
            acceleration = max(acceleration, -MAX_SPEED - v)
        beta = math.atan(0.5 * math.tan(steering))
        course = car.heading[i] + beta
        car.x[i] += v * math.cos(course) * s.dt
        car.y[i] += v * math.sin(course) * s.dt
        if car.has_impact[i]:
            car.x[i] += car.impact_x[i]
            car.y[i] += car.impact_y[i]
            car.crashed[i] = 1
            car.has_impact[i] = 0
        car.heading[i] += v * math.sin(beta) / 2.5 * s.dt
        car.speed[i] = v + acceleration * s.dt
        car.timer[i] += s.dt
        car.cos[i] = math.cos(car.heading[i])
        car.sin[i] = math.sin(car.heading[i])
        car.lane[i] = closest_lane(car.x[i], car.y[i], car.heading[i], s.lanes)
