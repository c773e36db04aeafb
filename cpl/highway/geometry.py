"""The straight road: lanes 4 m wide along x, from 0 to 10,000 m, lane 0 at y = 0.

Each function repeats highway-env's rounding: what looks like a detour (the wrapped heading, the
order of a sum) decides the last bit.
"""

from __future__ import annotations

import math

import numpy as np

from cpl.highway._compile import inlined

__all__ = [
    "CAR_LENGTH",
    "LANE_WIDTH",
    "MAX_SPEED",
    "ROAD_LENGTH",
    "closest_lane",
    "not_zero",
    "on_lane",
    "reachable",
    "wrap_to_pi",
]

LANE_WIDTH = 4.0
"""Width of a lane [m]."""
ROAD_LENGTH = 10_000.0
"""Length of the road [m]; cars drive on past its end, where nothing is on any lane."""
CAR_LENGTH = 5.0
"""Length of every car [m]."""
MAX_SPEED = 40.0
"""Soft cap of every car's speed [m/s]: what makes the paper's "20-50" really "20-40"."""
_TAU = 2 * math.pi


@inlined
def not_zero(x: float) -> float:
    """Keep a divisor at least 0.01 away from zero."""
    if abs(x) > 1e-2:
        return x
    return 1e-2 if x >= 0 else -1e-2


@inlined
def wrap_to_pi(angle: float) -> float:
    """Wrap an angle to [-pi, pi), rounding like Python's `%`."""
    shifted = angle + math.pi
    if shifted < 0.0 or shifted >= _TAU:
        shifted %= _TAU
    return shifted - math.pi


@inlined
def on_lane(x: float, y: float, lane: int, margin: float) -> bool:
    """Whether a position lies on a lane widened by a margin [m]."""
    return (
        abs(y - LANE_WIDTH * lane) <= LANE_WIDTH / 2 + margin
        and -CAR_LENGTH <= x < ROAD_LENGTH + CAR_LENGTH
    )


@inlined
def reachable(x: float, y: float, lane: int) -> bool:
    """Whether a lane is close enough to change to."""
    return abs(y - LANE_WIDTH * lane) <= 2 * LANE_WIDTH and 0.0 <= x < ROAD_LENGTH + CAR_LENGTH


@inlined
def closest_lane(x: float, y: float, heading: float, lanes: int) -> int:
    """Lane of least |lateral offset| + distance past the road's ends + |heading|."""
    angle = abs(wrap_to_pi(heading))
    past, before = max(x - ROAD_LENGTH, 0.0), max(0.0 - x, 0.0)
    best, least = 0, np.inf
    for lane in range(lanes):
        distance = abs(y - LANE_WIDTH * lane) + past + before + angle
        if distance < least:
            best, least = lane, distance
    return best
