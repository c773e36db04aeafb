"""What the drivers decide: IDM along the lane, MOBIL across, and the ego car's two controllers.

Cars act in list order, the ego car first, and a later car sees the target lanes that earlier cars
have just chosen; positions and speeds do not change while they act.

Models: M. Treiber, A. Hennecke, D. Helbing, "Congested traffic states", 2000 (IDM); A. Kesting,
M. Treiber, D. Helbing, "General lane-changing model MOBIL", 2007.
"""

from __future__ import annotations

import math

import numpy as np

from cpl.highway._compile import fma, inlined, kernel
from cpl.highway.geometry import not_zero, reachable, wrap_to_pi
from cpl.highway.layout import Car, Scratch, Settings
from cpl.highway.neighbours import find_front, find_rear, own_fronts

__all__ = ["act", "ego_action", "speed_level"]

_KP_SPEED = 1 / 0.6
_KP_LATERAL = 1 / 0.6
_KP_HEADING = 1 / 0.2
_HALF_LENGTH = 5.0 / 2
_MAX_STEERING = math.pi / 3
_MAX_HEADING = math.pi / 4


@inlined
def speed_level(levels: np.ndarray, speed: float) -> np.int64:
    """Index of the level nearest to a speed, were the levels evenly spaced (half to even)."""
    top = levels.size - 1
    x = (speed - levels[0]) / (levels[top] - levels[0])
    return np.int64(min(max(np.rint(x * top), 0.0), float(top)))


@inlined
def ego_action(
    car: Car, s: Settings, levels: np.ndarray, speed_index: np.ndarray, e: int, action: int
) -> None:
    """Apply a decision to the ego car's target lane or target speed.

    Args:
        car: The environment.
        s: The settings.
        levels: Speed levels [m/s].
        speed_index: Level in force, (n_envs,).
        e: The environment's number.
        action: 0 lane left, 1 idle, 2 lane right, 3 faster, 4 slower.
    """
    if action == 3 or action == 4:
        index = speed_level(levels, car.speed[0]) + (1 if action == 3 else -1)
        index = min(max(index, 0), levels.size - 1)
        speed_index[e] = index
        car.target_speed[0] = levels[index]
    elif action == 0 or action == 2:
        lane = car.target_lane[0] + (1 if action == 2 else -1)
        lane = min(max(lane, 0), s.lanes - 1)
        if reachable(car.x[0], car.y[0], lane):
            car.target_lane[0] = lane


@inlined
def act(car: Car, s: Settings, w: Scratch) -> None:
    """Let every car choose its lane, steering and acceleration for one frame."""
    n = s.n
    tied = own_fronts(car, w, n, s.lanes)
    w.acceleration[0] = _KP_SPEED * (car.target_speed[0] - car.speed[0])
    w.steering[0] = _steering(car, 0)
    for i in range(1, n):
        if car.crashed[i]:
            continue
        if s.lane_change:
            _choose_lane(car, s, w, i, tied)
        w.steering[i] = _steering(car, i)
        free = _free(car, s, i, car.delta[i])
        acceleration = free - _gap_term(car, s, i, w.front[i])
        if car.lane[i] != car.target_lane[i]:
            front = find_front(car, w, i, car.target_lane[i], n, tied)
            acceleration = min(acceleration, free - _gap_term(car, s, i, front))
        w.acceleration[i] = min(max(acceleration, -s.acc_max), s.acc_max)


@inlined
def _steering(car: Car, i: int) -> float:
    divisor = not_zero(car.speed[i])
    lateral_speed = -_KP_LATERAL * (car.y[i] - 4.0 * car.target_lane[i])
    command = math.asin(min(max(lateral_speed / divisor, -1.0), 1.0))
    reference = min(max(command, -_MAX_HEADING), _MAX_HEADING)
    rate = _KP_HEADING * wrap_to_pi(reference - car.heading[i])
    slip = math.asin(min(max(_HALF_LENGTH / divisor * rate, -1.0), 1.0))
    angle = math.atan(2 * math.tan(slip))
    return min(max(angle, -_MAX_STEERING), _MAX_STEERING)


@inlined
def _free(car: Car, s: Settings, i: int, delta: float) -> float:
    """Acceleration of car i on an empty road, with the deciding driver's exponent."""
    target = min(max(car.target_speed[i], 0.0), s.speed_limit)
    return s.comfort * (1 - math.pow(max(car.speed[i], 0.0) / abs(not_zero(target)), delta))


@inlined
def _desired_gap(car: Car, s: Settings, i: int, j: int) -> float:
    v = car.speed[i]
    dvx = v * car.cos[i] - car.speed[j] * car.cos[j]
    dvy = v * car.sin[i] - car.speed[j] * car.sin[j]
    closing = fma(dvy, car.sin[i], dvx * car.cos[i])  # as numpy's dot rounds it
    return s.distance_wanted + v * s.time_wanted + v * closing / s.twice_root_ab


@inlined
def _gap_term(car: Car, s: Settings, i: int, j: int) -> float:
    """What car j in front takes from car i's acceleration; exactly 0 for the sentinel."""
    ratio = _desired_gap(car, s, i, j) / not_zero(car.x[j] - car.x[i])
    return s.comfort * (ratio * ratio)


@inlined
def _choose_lane(car: Car, s: Settings, w: Scratch, i: int, tied: bool) -> None:
    lane = car.lane[i]
    target = car.target_lane[i]
    if lane != target:
        for j in range(s.n):
            if j != i and car.lane[j] != target and car.target_lane[j] == target:
                gap = car.x[j] - car.x[i]
                if 0.0 < gap < _desired_gap(car, s, i, j):
                    car.target_lane[i] = lane
                    break
    elif s.delay < car.timer[i]:
        car.timer[i] = 0.0
        if abs(car.speed[i]) < 1.0:
            return
        # Left, then right: a right lane that also passes overrides the left one.
        for side in (lane - 1, lane + 1):
            if (
                0 <= side < s.lanes
                and reachable(car.x[i], car.y[i], side)
                and _mobil(car, s, w, i, side, tied)
            ):
                car.target_lane[i] = side


@kernel
def _mobil(car: Car, s: Settings, w: Scratch, i: int, side: int, tied: bool) -> bool:
    """Whether driver i gains by changing to a lane without forcing its follower to brake."""
    n = s.n
    delta = car.delta[i]
    front = find_front(car, w, i, side, n, tied)
    rear = find_rear(car, w, i, side, n, tied)
    rear_free = rear_after = 0.0
    if rear < n:
        rear_free = _free(car, s, rear, delta)
        rear_after = rear_free - _gap_term(car, s, rear, i)
        if rear_after < -s.max_imposed:
            return False
    free = _free(car, s, i, delta)
    gain = (free - _gap_term(car, s, i, front)) - (free - _gap_term(car, s, i, w.front[i]))
    if s.politeness != 0.0:
        rear_before = rear_free - _gap_term(car, s, rear, front) if rear < n else 0.0
        old = find_rear(car, w, i, car.lane[i], n, tied)
        old_before = old_after = 0.0
        if old < n:
            old_free = _free(car, s, old, delta)
            old_before = old_free - _gap_term(car, s, old, i)
            old_after = old_free - _gap_term(car, s, old, w.front[i])
        gain += s.politeness * (rear_after - rear_before + old_after - old_before)
    return gain >= s.min_gain
