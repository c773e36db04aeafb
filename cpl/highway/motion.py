"""How the cars move in one frame: highway-env's controllers, bicycle model, crash and speed cap.

Most cars drive exactly straight: their steering is zero, their direction stays, and all of them
move in one vector computation. Those that steer are gathered, taken through the chain of
controllers and inverse functions as vectors, and put back.
"""

from __future__ import annotations

import math

import numpy as np

from cpl.highway._compile import inlined, merged
from cpl.highway.exact import asin_all, atan_all, cos_all, padded, sin_all, tan_all
from cpl.highway.geometry import LANE_WIDTH, MAX_SPEED, closest_lane, wrap_to_pi
from cpl.highway.layout import Car, Scratch, Settings

__all__ = ["move"]

_KP_LATERAL = 1 / 0.6
_KP_HEADING = 1 / 0.2
_HALF_LENGTH = 5.0 / 2
_MAX_STEERING = math.pi / 3
_MAX_HEADING = math.pi / 4


@merged
def move(
    car: Car, s: Settings, w: Scratch, steering: int, gentle: int, hit: int, path: int
) -> None:
    """Integrate every car over one frame, with the heading and speed before the frame.

    Args:
        car: The environment.
        s: The settings.
        w: Working memory, with `acceleration` and the lists `steering`, `gentle` and `hit`.
        steering: Number of cars that steer.
        gentle: Number of cars that steer by less than a nanoradian.
        hit: Number of cars that have crashed or are pushed.
        path: Which arithmetic.
    """
    if steering:
        _gather(car, w, steering)
        _steer(w, steering, path)
    _steer_gently(car, s, w, gentle)
    _drive_straight(car, s, w)
    for k in range(gentle):
        i = np.uint64(w.gentle[k])
        car.y[i], car.heading[i] = w.gentle_y[k], w.gentle_heading[k]
        car.sin[i] = car.heading[i]
    if steering:
        _drive_curved(car, s, w, steering, path)
    for k in range(hit):
        _push(car, w.hit[k], s.lanes)


@inlined
def _gather(car: Car, w: Scratch, count: int) -> None:
    for k in range(count):
        i = np.uint64(w.steering[k])
        v = car.speed[i]
        w.x[k], w.y[k], w.heading[k], w.speed[k] = car.x[i], car.y[i], car.heading[i], v
        w.a[k] = car.y[i] - LANE_WIDTH * car.target_lane[i]
    for k in range(count, padded(count)):
        w.heading[k] = w.speed[k] = w.a[k] = 0.0


@inlined
def _steer(w: Scratch, count: int, path: int) -> None:
    """From lateral offsets in `w.a` to slip angles beta in `w.c`.

    Lateral offset -> lateral speed -> heading -> heading rate -> steering angle -> slip angle,
    each clipped as highway-env clips it.
    """
    size = padded(count)
    for k in range(size):
        v = w.speed[k]
        near_zero = 1e-2 if v >= 0.0 else -1e-2
        w.divisor[k] = v if abs(v) > 1e-2 else near_zero
        w.a[k] = _clip(-_KP_LATERAL * w.a[k] / w.divisor[k], 1.0)
    asin_all(w.a, w.b, w.doubt, count, path)
    wrapped = 0
    for k in range(size):
        shifted = _clip(w.b[k], _MAX_HEADING) - w.heading[k] + math.pi
        wrapped += 1 if (shifted < 0.0) | (shifted >= 2 * math.pi) else 0
        w.c[k] = shifted - math.pi
    if wrapped:
        for k in range(count):
            w.c[k] = wrap_to_pi(_clip(w.b[k], _MAX_HEADING) - w.heading[k])
    for k in range(size):
        w.a[k] = _clip(_HALF_LENGTH / w.divisor[k] * (_KP_HEADING * w.c[k]), 1.0)
    asin_all(w.a, w.b, w.doubt, count, path)
    tan_all(w.b, w.a, w.doubt, count, path)
    for k in range(size):
        w.a[k] = 2 * w.a[k]
    atan_all(w.a, w.b, w.doubt, count, path)
    for k in range(size):
        w.b[k] = _clip(w.b[k], _MAX_STEERING)
    tan_all(w.b, w.a, w.doubt, count, path)
    for k in range(size):
        w.a[k] = 0.5 * w.a[k]
    atan_all(w.a, w.c, w.doubt, count, path)


@inlined
def _steer_gently(car: Car, s: Settings, w: Scratch, count: int) -> None:
    """The chain of controllers where every function in it is the identity."""
    for k in range(count):
        i = np.uint64(w.gentle[k])
        v = car.speed[i]
        command = -_KP_LATERAL * (car.y[i] - LANE_WIDTH * car.target_lane[i]) / v
        turn = command - car.heading[i] + math.pi - math.pi
        slip = _HALF_LENGTH / v * (_KP_HEADING * turn)
        w.gentle_y[k] = car.y[i] + v * (car.heading[i] + slip) * s.dt
        w.gentle_heading[k] = car.heading[i] + v * slip / 2.5 * s.dt


@inlined
def _drive_straight(car: Car, s: Settings, w: Scratch) -> None:
    """Move all cars along their heading; those that steer are moved again afterwards."""
    for i in range(padded(s.n)):
        v = car.speed[i]
        acceleration = w.acceleration[i]
        brake = MAX_SPEED - v
        push = -MAX_SPEED - v
        acceleration = brake if (v > MAX_SPEED) & (brake < acceleration) else acceleration
        acceleration = push if (v < -MAX_SPEED) & (push > acceleration) else acceleration
        car.x[i] += v * car.cos[i] * s.dt
        car.y[i] += v * car.sin[i] * s.dt
        car.speed[i] = v + acceleration * s.dt
        car.timer[i] += s.dt


@inlined
def _drive_curved(car: Car, s: Settings, w: Scratch, count: int, path: int) -> None:
    """Move the cars that steer, by the slip angles in `w.c`."""
    size = padded(count)
    for k in range(size):
        w.divisor[k] = w.heading[k] + w.c[k]
    cos_all(w.divisor, w.a, w.doubt, count, path)
    sin_all(w.divisor, w.b, w.doubt, count, path)
    for k in range(size):
        w.x[k] += w.speed[k] * w.a[k] * s.dt
        w.y[k] += w.speed[k] * w.b[k] * s.dt
    sin_all(w.c, w.a, w.doubt, count, path)
    for k in range(size):
        w.heading[k] += w.speed[k] * w.a[k] / 2.5 * s.dt
    cos_all(w.heading, w.a, w.doubt, count, path)
    sin_all(w.heading, w.b, w.doubt, count, path)
    for k in range(count):
        i = np.uint64(w.steering[k])
        car.x[i], car.y[i], car.heading[i] = w.x[k], w.y[k], w.heading[k]
        car.cos[i], car.sin[i] = w.a[k], w.b[k]
        # Well inside its lane a car is on it; only near an edge does the exact sum decide.
        if not abs(w.y[k] - LANE_WIDTH * car.lane[i]) < 1.99:
            car.lane[i] = closest_lane(w.x[k], w.y[k], w.heading[k], s.lanes)


@inlined
def _push(car: Car, i: int, lanes: int) -> None:
    if car.has_impact[i]:
        car.x[i] += car.impact_x[i]
        car.y[i] += car.impact_y[i]
        car.crashed[i] = 1
        car.has_impact[i] = 0
    car.lane[i] = closest_lane(car.x[i], car.y[i], car.heading[i], lanes)


@inlined
def _clip(x: float, top: float) -> float:
    x = x if x > -top else -top
    return x if x < top else top
