"""What the drivers decide: IDM along the lane, MOBIL across, and the ego car's two controllers.

Cars act in list order, the ego car first, and a later car sees the target lanes that earlier cars
have just chosen; positions and speeds do not change while they act.

Models: M. Treiber, A. Hennecke, D. Helbing, "Congested traffic states", 2000 (IDM); A. Kesting,
M. Treiber, D. Helbing, "General lane-changing model MOBIL", 2007.
"""

from __future__ import annotations

import numpy as np

from cpl.highway._compile import fma, inlined, merged
from cpl.highway.exact import padded, pow_all, pow_one
from cpl.highway.geometry import LANE_WIDTH, not_zero, reachable
from cpl.highway.layout import Car, Scratch, Settings
from cpl.highway.neighbours import find_front, find_rear, own_fronts

__all__ = ["act", "ego_action", "speed_divisor", "speed_level"]

_KP_SPEED = 1 / 0.6
_KP_LATERAL = 1 / 0.6


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
        car.divisor[0] = speed_divisor(s, levels[index])
    elif action == 0 or action == 2:
        lane = car.target_lane[0] + (1 if action == 2 else -1)
        lane = min(max(lane, 0), s.lanes - 1)
        if reachable(car.x[0], car.y[0], lane):
            car.target_lane[0] = lane


@inlined
def speed_divisor(s: Settings, target_speed: float) -> float:
    """What a speed is divided by in the car-following model, for a desired speed."""
    return abs(not_zero(min(max(target_speed, 0.0), s.speed_limit)))


@merged
def act(car: Car, s: Settings, w: Scratch, path: int) -> tuple:
    """Let every car choose its lane and acceleration for one frame.

    Args:
        car: The environment; target lanes and timers change.
        s: The settings.
        w: Working memory; `acceleration`, `steering` and `hit` are written.
        path: Which arithmetic.

    Returns:
        How many cars have to steer (listed in `w.steering`), how many have to but so little that
        every angle is its own sine (in `w.gentle`), and how many have crashed or are about to
        (in `w.hit`).
    """
    changing, tied = own_fronts(car, w, s.n, s.lanes)
    _follow(car, s, w, path)
    steering = gentle = hit = 0
    for i in range(s.n):
        if car.crashed[i] | car.has_impact[i]:
            w.hit[hit] = i
            hit += 1
        if car.crashed[i]:
            w.acceleration[i] = -1.0 * car.speed[i]
            continue
        if i > 0:
            if s.lane_change:
                changing = _choose_lane(car, s, w, i, changing, tied, path)
            if car.lane[i] != car.target_lane[i]:
                _follow_both(car, s, w, i, tied)
        need = _steering_need(car, i)
        if need == 2:
            w.steering[steering] = i
            steering += 1
        elif need == 1:
            w.gentle[gentle] = i
            gentle += 1
    w.acceleration[0] = _KP_SPEED * (car.target_speed[0] - car.speed[0])
    if car.crashed[0]:
        w.acceleration[0] = -1.0 * car.speed[0]
    return steering, gentle, hit


@inlined
def _follow(car: Car, s: Settings, w: Scratch, path: int) -> None:
    """Every car's acceleration behind its own lane's front car, as one vector computation."""
    size = padded(s.n)
    for i in range(size):
        v = car.speed[i]
        w.forward[i] = v * car.cos[i]
        w.sideways[i] = v * car.sin[i]
        w.ratio[i] = (v if v > 0.0 else 0.0) / car.divisor[i]
    w.forward[s.n] = w.sideways[s.n] = 0.0
    pow_all(w.ratio, car.delta, w.a, w.doubt, s.n, path)
    for i in range(size):
        v = car.speed[i]
        j = np.uint64(w.front[i])
        closing = fma(
            w.sideways[i] - w.sideways[j], car.sin[i], (w.forward[i] - w.forward[j]) * car.cos[i]
        )
        wanted = s.distance_wanted + v * s.time_wanted + v * closing / s.twice_root_ab
        distance = car.x[j] - car.x[i]
        ratio = wanted / (distance if distance > 1e-2 else 1e-2)
        free = s.comfort * (1 - w.a[i])
        gap = s.comfort * (ratio * ratio)
        acceleration = free - gap
        acceleration = acceleration if acceleration > -s.acc_max else -s.acc_max
        w.acceleration[i] = acceleration if acceleration < s.acc_max else s.acc_max
        w.free[i] = free
        w.gap[i] = gap
    for i in range(s.n, size):
        w.acceleration[i] = 0.0


@inlined
def _follow_both(car: Car, s: Settings, w: Scratch, i: int, tied: bool) -> None:
    """While changing lanes, mind the front car of the target lane as well."""
    front = find_front(car, w, i, car.target_lane[i], s.n, tied)
    other = w.free[i] - _gap_term(car, s, w, i, front)
    acceleration = min(w.free[i] - w.gap[i], other)
    w.acceleration[i] = min(max(acceleration, -s.acc_max), s.acc_max)


@inlined
def _steering_need(car: Car, i: int) -> int:
    """How much of the steering chain a car needs: 0 none, 1 its linear part, 2 all of it.

    Where heading and heading command are together below half an ulp of pi, wrapping their
    difference gives exactly zero, and so does everything that follows from it. Where both are
    below 1e-9 (and the car is not slow), sines, tangents and their inverses return their argument
    and cosines return 1.
    """
    speed = abs(car.speed[i])
    lateral = _KP_LATERAL * abs(car.y[i] - LANE_WIDTH * car.target_lane[i])
    turned = abs(car.heading[i]) * speed
    if speed < 20.0 or lateral > 1e-9 * speed or turned > 1e-9 * speed:
        return 2
    if car.lane[i] != car.target_lane[i]:
        return 2
    return 0 if lateral + turned <= 2e-16 * speed else 1


@inlined
def _free(car: Car, s: Settings, i: int, delta: float, path: int) -> float:
    """Acceleration of car i on an empty road, with the deciding driver's exponent."""
    return s.comfort * (1 - pow_one(max(car.speed[i], 0.0) / car.divisor[i], delta, path))


@inlined
def _desired_gap(car: Car, s: Settings, w: Scratch, i: int, j: int) -> float:
    v = car.speed[i]
    dvx = w.forward[i] - w.forward[j]
    dvy = w.sideways[i] - w.sideways[j]
    closing = fma(dvy, car.sin[i], dvx * car.cos[i])  # as numpy's dot rounds it
    return s.distance_wanted + v * s.time_wanted + v * closing / s.twice_root_ab


@inlined
def _gap_term(car: Car, s: Settings, w: Scratch, i: int, j: int) -> float:
    """What car j in front takes from car i's acceleration; exactly 0 for the sentinel."""
    ratio = _desired_gap(car, s, w, i, j) / not_zero(car.x[j] - car.x[i])
    return s.comfort * (ratio * ratio)


@inlined
def _choose_lane(
    car: Car, s: Settings, w: Scratch, i: int, changing: int, tied: bool, path: int
) -> int:
    """Let car i change lanes, or give up a change; returns the number of changing cars."""
    lane = car.lane[i]
    target = car.target_lane[i]
    if lane != target:
        for k in range(changing):
            j = w.changing[k]
            if j != i and car.lane[j] != target and car.target_lane[j] == target:
                gap = car.x[j] - car.x[i]
                if 0.0 < gap < _desired_gap(car, s, w, i, j):
                    car.target_lane[i] = lane
                    break
        return changing
    if not s.delay < car.timer[i]:
        return changing
    car.timer[i] = 0.0
    # No lane can bring more than what the front car takes now (less a margin for rounding).
    most = w.gap[i] + 1e-9 * (1.0 + abs(w.free[i]) + w.gap[i])
    if abs(car.speed[i]) < 1.0 or (s.politeness == 0.0 and most < s.min_gain):
        return changing
    # Left, then right: a right lane that also passes overrides the left one.
    for step in range(-1, 2, 2):
        side = lane + step
        if (
            0 <= side < s.lanes
            and reachable(car.x[i], car.y[i], side)
            and _mobil(car, s, w, i, side, tied, path)
        ):
            car.target_lane[i] = side
    if car.target_lane[i] != lane:
        w.changing[changing] = i
        changing += 1
    return changing


@inlined
def _mobil(car: Car, s: Settings, w: Scratch, i: int, side: int, tied: bool, path: int) -> bool:
    """Whether driver i gains by changing to a lane without forcing its follower to brake."""
    n = s.n
    delta = car.delta[i]
    front = find_front(car, w, i, side, n, tied)
    gain = (w.free[i] - _gap_term(car, s, w, i, front)) - (w.free[i] - w.gap[i])
    if s.politeness == 0.0 and gain < s.min_gain:
        return False
    rear = find_rear(car, w, i, side, n, tied)
    rear_free = rear_after = 0.0
    if rear < n:
        rear_free = _free(car, s, rear, delta, path)
        rear_after = rear_free - _gap_term(car, s, w, rear, i)
        if rear_after < -s.max_imposed:
            return False
    if s.politeness != 0.0:
        rear_before = rear_free - _gap_term(car, s, w, rear, front) if rear < n else 0.0
        old = find_rear(car, w, i, car.lane[i], n, tied)
        old_before = old_after = 0.0
        if old < n:
            old_free = _free(car, s, old, delta, path)
            old_before = old_free - _gap_term(car, s, w, old, i)
            old_after = old_free - _gap_term(car, s, w, old, w.front[i])
        gain += s.politeness * (rear_after - rear_before + old_after - old_before)
    return gain >= s.min_gain
