"""Who drives in front and who behind, on a given lane.

A car counts as on every lane whose centre is within 3 m of it. The front car is the nearest at or
ahead of one's position (of equals the last in the list), the rear car the nearest strictly behind
(of equals the first). Cars are kept sorted along the road, so that both are found in a few steps;
positions that tie exactly fall back to the scan that defines them.
"""

from __future__ import annotations

import numpy as np

from cpl.highway._compile import inlined, inner
from cpl.highway.geometry import LANE_WIDTH, ROAD_LENGTH, on_lane
from cpl.highway.layout import Car, Scratch

__all__ = ["find_front", "find_rear", "own_fronts", "sort_cars"]


@inlined
def sort_cars(order: np.ndarray, x: np.ndarray, n: int) -> None:
    """Sort car numbers by position; nearly sorted already, so by insertion."""
    for k in range(1, n):
        car = order[k]
        position = x[np.uint64(car)]
        if x[np.uint64(order[np.uint64(k - 1)])] <= position:
            continue
        m = k
        while m > 0 and x[order[m - 1]] > position:
            order[m] = order[m - 1]
            m -= 1
        order[m] = car


@inlined
def own_fronts(car: Car, w: Scratch, n: int, lanes: int) -> tuple:
    """Find every car's front car on its own lane, in one sweep from the head of the road.

    Args:
        car: The environment.
        w: Working memory; `front` (car number or n for none), `rank` (place along the road) and
            `changing` (the cars that are between two lanes) are written.
        n: Number of cars.
        lanes: Number of lanes.

    Returns:
        Number of changing cars, and whether two cars tie, so that the sorted order must not be
        searched.
    """
    tied = False
    changing = 0
    ahead = np.inf
    for lane in range(lanes):
        w.last[lane] = n
    for k in range(n - 1, -1, -1):
        i = np.uint64(car.order[k])  # unsigned: an index that cannot count from the end
        x, y, lane = car.x[i], car.y[i], car.lane[i]
        w.rank[i] = k
        w.front[i] = w.last[np.uint64(lane)]
        tied |= x == ahead
        ahead = x
        if lane != car.target_lane[i]:
            w.changing[changing] = i
            changing += 1
        # Within 1 m of its lane's centre a car is more than 3 m from any other lane's.
        if abs(y - LANE_WIDTH * lane) < 0.999 and 0.0 <= x <= ROAD_LENGTH:
            w.last[np.uint64(lane)] = i
        else:
            for other in range(lanes):
                if on_lane(x, y, other, 1.0):
                    w.last[other] = i
    if tied:
        for i in range(n):
            w.front[i] = _scan_front(car.x, car.y, i, car.lane[i], n)
    return changing, tied


@inlined
def find_front(car: Car, w: Scratch, i: int, lane: int, n: int, tied: bool) -> int:
    """Find car i's front car on a lane, n if there is none."""
    if tied:
        return _scan_front(car.x, car.y, i, lane, n)
    for k in range(w.rank[i] + 1, n):
        j = np.uint64(car.order[k])
        if on_lane(car.x[j], car.y[j], lane, 1.0):
            return np.int64(j)  # pyright: ignore[reportReturnType]
    return n


@inlined
def find_rear(car: Car, w: Scratch, i: int, lane: int, n: int, tied: bool) -> int:
    """Find car i's rear car on a lane, n if there is none."""
    if tied:
        return _scan_rear(car.x, car.y, i, lane, n)
    for k in range(w.rank[i] - 1, -1, -1):
        j = np.uint64(car.order[k])
        if on_lane(car.x[j], car.y[j], lane, 1.0):
            return np.int64(j)  # pyright: ignore[reportReturnType]
    return n


@inner
def _scan_front(xs: np.ndarray, ys: np.ndarray, i: int, lane: int, n: int) -> int:
    best, nearest = n, np.inf
    for j in range(n):
        x = xs[j]
        if j != i and xs[i] <= x <= nearest and on_lane(x, ys[j], lane, 1.0):
            best, nearest = j, x
    return best


@inner
def _scan_rear(xs: np.ndarray, ys: np.ndarray, i: int, lane: int, n: int) -> int:
    best, nearest = n, -np.inf
    for j in range(n):
        x = xs[j]
        if j != i and nearest < x < xs[i] and on_lane(x, ys[j], lane, 1.0):
            best, nearest = j, x
    return best
