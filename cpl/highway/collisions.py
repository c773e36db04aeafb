"""Which cars touch, which will, and how they are pushed apart (separating axes).

Pairs are taken in list order because a later pair overwrites an earlier one's push.
"""

from __future__ import annotations

import math

import numpy as np

from cpl.highway._compile import fma, inlined, inner, merged
from cpl.highway.exact import padded
from cpl.highway.layout import Car, Scratch, Settings

__all__ = ["collide"]

_DIAGONAL = math.sqrt(5.0**2 + 2.0**2)
_HALF_LENGTH = 2.5
_HALF_WIDTH = 1.0
_ORDINARY_SPEED = 42.0  # [m/s]; the reach of a pair is bounded by it unless someone is faster


@merged
def collide(car: Car, s: Settings, w: Scratch) -> None:
    """Find this frame's collisions; cars must be sorted along the road."""
    if s.collisions == 0:
        return
    count = _close_pairs(car, s, w)
    if count > w.pairs.size:  # a pile-up: take every pair
        for i in range(s.n):
            for j in range(i + 1, s.n):
                _check(car, s, w, i, j)
        return
    _sort(w.pairs, count)
    for k in range(count):
        _check(car, s, w, w.pairs[k] // s.n, w.pairs[k] % s.n)


@inlined
def _close_pairs(car: Car, s: Settings, w: Scratch) -> int:
    """List the pairs i n + j that could touch within the frame; returns how many there are."""
    reach = _reach(car, s)
    count = 0
    a = car.order[0]
    x = car.x[a]
    for k in range(1, s.n):
        b = car.order[k]
        ahead = car.x[np.uint64(b)]
        if ahead - x <= reach:
            m = k
            while True:
                if not _apart(car, s, a, b, reach):
                    if count < w.pairs.size:
                        w.pairs[count] = min(a, b) * s.n + max(a, b)
                    count += 1
                m += 1
                if m == s.n:
                    break
                b = car.order[m]
                if car.x[b] - x > reach:
                    break
            b = car.order[k]
        a = b
        x = ahead
    return count


@inlined
def _reach(car: Car, s: Settings) -> float:
    """Distance along the road beyond which no pair can touch within the frame [m]."""
    hasty = 0
    for i in range(padded(s.n)):
        hasty += 1 if abs(car.speed[i]) > _ORDINARY_SPEED else 0
    fastest = _ORDINARY_SPEED
    if hasty:
        for i in range(s.n):
            fastest = max(fastest, abs(car.speed[i]))
    return _DIAGONAL + fastest * s.dt + 1e-6


@inlined
def _apart(car: Car, s: Settings, a: int, b: int, reach: float) -> bool:
    """Whether two nearly straight cars are certain to stay apart sideways for a frame.

    The normal of a's side is one of the axes that the exact check projects on: where even a lower
    bound of the gap along it stays positive, that check finds neither contact.
    """
    turn = abs(car.sin[a]) + abs(car.sin[b])
    side = abs(car.y[b] - car.y[a])
    gap = side * (1.0 - turn * turn) - turn * (2.0 * reach) - 2.0
    return (gap > 1e-6) & (car.cos[a] > 0.5) & (car.cos[b] > 0.5) & (side < 100.0)


@inlined
def _sort(values: np.ndarray, count: int) -> None:
    for k in range(1, count):
        value = values[k]
        m = k
        while m > 0 and values[m - 1] > value:
            values[m] = values[m - 1]
            m -= 1
        values[m] = value


@inlined
def _check(car: Car, s: Settings, w: Scratch, i: int, j: int) -> None:
    if s.collisions == 1 and i > 0:
        return
    dx, dy = car.x[j] - car.x[i], car.y[j] - car.y[i]
    if math.sqrt(fma(dy, dy, dx * dx)) > _DIAGONAL + car.speed[i] * s.dt:
        return
    _separate(car, s, w, i, j)


@inner
def _separate(car: Car, s: Settings, w: Scratch, i: int, j: int) -> None:
    _corners(car, w.corners[0], i)
    _corners(car, w.corners[1], j)
    a, b = w.corners[0], w.corners[1]
    move_x = car.speed[i] * car.cos[i] * s.dt - car.speed[j] * car.cos[j] * s.dt
    move_y = car.speed[i] * car.sin[i] * s.dt - car.speed[j] * car.sin[j] * s.dt
    centre_x = (a[0] + a[2] + a[4] + a[6]) / 4 - (b[0] + b[2] + b[4] + b[6]) / 4
    centre_y = (a[1] + a[3] + a[5] + a[7]) / 4 - (b[1] + b[3] + b[5] + b[7]) / 4
    touching = touching_soon = True
    least = np.inf
    push_x = push_y = 0.0
    for edge in range(8):
        p = a if edge < 4 else b
        k = 2 * (edge % 4)
        m = (k + 2) % 8
        nx, ny = -p[m + 1] + p[k + 1], p[m] - p[k]
        norm = math.sqrt(fma(ny, ny, nx * nx))
        nx, ny = nx / norm, ny / norm
        low_a, high_a = _project(a, nx, ny)
        low_b, high_b = _project(b, nx, ny)
        if _interval_distance(low_a, high_a, low_b, high_b) > 0:
            touching = False
        velocity = fma(ny, move_y, nx * move_x)
        if velocity < 0:
            low_a += velocity
        else:
            high_a += velocity
        distance = _interval_distance(low_a, high_a, low_b, high_b)
        if distance > 0:
            touching_soon = False
        if not touching and not touching_soon:
            return
        if abs(distance) < least:
            least = abs(distance)
            ahead = fma(centre_y, ny, centre_x * nx) > 0
            push_x, push_y = (nx, ny) if ahead else (-nx, -ny)
    if touching_soon:
        car.impact_x[i], car.impact_y[i] = least * push_x / 2, least * push_y / 2
        car.impact_x[j], car.impact_y[j] = -(least * push_x) / 2, -(least * push_y) / 2
        car.has_impact[i] = car.has_impact[j] = 1
    if touching:
        car.crashed[i] = car.crashed[j] = 1


@inlined
def _corners(car: Car, out: np.ndarray, i: int) -> None:
    c, s = car.cos[i], car.sin[i]
    for k in range(4):
        px = -_HALF_LENGTH if k < 2 else _HALF_LENGTH
        py = _HALF_WIDTH if k == 1 or k == 2 else -_HALF_WIDTH
        out[2 * k] = (c * px + -s * py) + car.x[i]
        out[2 * k + 1] = (s * px + c * py) + car.y[i]


@inlined
def _project(p: np.ndarray, nx: float, ny: float) -> tuple:
    low = high = fma(p[1], ny, p[0] * nx)
    for k in range(1, 4):
        along = fma(p[2 * k + 1], ny, p[2 * k] * nx)
        low = min(low, along)
        high = max(high, along)
    return low, high


@inlined
def _interval_distance(low_a: float, high_a: float, low_b: float, high_b: float) -> float:
    return low_b - high_a if low_a < low_b else low_a - high_b
