"""The batch kernels: reset, rebuild and step a range of environments.

Kernels take plain arrays and put the named views together inside: numba takes longer to look at a
tuple of arrays than a step takes.
"""

from __future__ import annotations

import math

import numpy as np

from cpl import portable
from cpl.highway._compile import kernel, merged
from cpl.highway.behaviour import act, ego_action, speed_divisor
from cpl.highway.collisions import collide
from cpl.highway.exact import OWN
from cpl.highway.layout import (
    Car,
    Memory,
    Scratch,
    Settings,
    Workspace,
    car_views,
    scratch_from,
    settings_from,
)
from cpl.highway.motion import move
from cpl.highway.neighbours import sort_cars
from cpl.highway.observe import observe, reward_terms
from cpl.highway.spawn import spawn

__all__ = ["refresh_range", "reset_range", "step_range"]


@kernel
def reset_range(
    first: int,
    stop: int,
    nearest: np.ndarray,
    counts: np.ndarray,
    numbers: np.ndarray,
    levels: np.ndarray,
    features: np.ndarray,
    ranges: np.ndarray,
    chosen: np.ndarray,
    obs: np.ndarray,
    *memory: np.ndarray,
) -> None:
    """Begin an episode in the chosen environments of [first, stop) and observe them."""
    m = Memory(*memory)
    s = settings_from(counts, numbers)
    for e in range(first, stop):
        if chosen[e]:
            car = car_views(m.cars, m.codes, e)
            m.speed_index[e] = spawn(car, s, levels, m.generator[e])
            m.time[e] = 0.0
            m.steps[e] = 0
            m.ready[e] = True
            observe(car, s, features, ranges, m.generator[e], m.noise_generator[e], nearest, obs[e])


@kernel
def step_range(
    first: int,
    stop: int,
    reals: np.ndarray,
    integers: np.ndarray,
    last: np.ndarray,
    pairs: np.ndarray,
    nearest: np.ndarray,
    corners: np.ndarray,
    counts: np.ndarray,
    numbers: np.ndarray,
    levels: np.ndarray,
    features: np.ndarray,
    ranges: np.ndarray,
    actions: np.ndarray,
    obs: np.ndarray,
    reward: np.ndarray,
    terms: np.ndarray,
    ended: np.ndarray,
    path: int,
    *memory: np.ndarray,
) -> None:
    """Advance the environments of [first, stop) by one decision."""
    m = Memory(*memory)
    s = settings_from(counts, numbers)
    w = scratch_from(Workspace(reals, integers, last, pairs, nearest, corners))
    for e in range(first, stop):
        car = car_views(m.cars, m.codes, e)
        m.time[e] += s.policy_dt
        ego_action(car, s, levels, m.speed_index, e, actions[e])
        for _ in range(s.frames):
            frame(car, s, w, path)
        m.steps[e] += s.frames
        observe(car, s, features, ranges, m.generator[e], m.noise_generator[e], nearest, obs[e])
        reward[e] = reward_terms(car, s, terms[e])
        crashed = terms[e, 0] > 0.0
        ended[0, e] = crashed or (s.offroad_terminal and terms[e, 3] == 0.0)
        ended[1, e] = m.time[e] >= s.duration
        terms[e, 4] = car.speed[0]


@kernel
def refresh_range(
    first: int, stop: int, path: int, counts: np.ndarray, numbers: np.ndarray, *memory: np.ndarray
) -> None:
    """Rebuild what is derived from a state: directions and the order along the road."""
    m = Memory(*memory)
    s = settings_from(counts, numbers)
    for e in range(first, stop):
        car = car_views(m.cars, m.codes, e)
        for i in range(s.n):
            h = car.heading[i]
            car.cos[i] = portable.cos(h) if path == OWN else math.cos(h)
            car.sin[i] = portable.sin(h) if path == OWN else math.sin(h)
            car.divisor[i] = speed_divisor(s, car.target_speed[i])
            car.order[i] = i
        sort_cars(car.order, car.x, s.n)


@merged
def frame(car: Car, s: Settings, w: Scratch, path: int) -> None:
    """Advance one environment by one simulation frame."""
    steering, gentle, hit = act(car, s, w, path)
    move(car, s, w, steering, gentle, hit, path)
    sort_cars(car.order, car.x, s.n)
    collide(car, s, w)
