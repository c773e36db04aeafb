"""The gate's compiled loops: arrays in, arrays filled, no checks.

A road's cars are rows (presence, dx, dy, dvx, dvy) in metres and metres a second relative to the
ego car. The ego car is (y, heading, speed, target lane, target speed). Both controllers and the
bicycle model of the ego car are highway-env's, frame by frame (`cpl.highway.motion`,
`cpl.highway.behaviour`): what is rolled out here is what the engine will do.
"""

import math

import numpy as np
from numba import njit

__all__ = ["associate", "look", "score"]

_KP_SPEED = 1 / 0.6
_KP_LATERAL = 1 / 0.6
_KP_HEADING = 1 / 0.2
_LANE = 4.0  # [m]
_LENGTH, _WIDTH = 5.0, 2.0  # [m] of every car
_MAX_SPEED = 40.0  # [m/s]
_SETTLING = 0.7  # [s] how fast a car that changes lanes reaches its new lane
_GLANCE = 0.5  # [s] how far its sideways motion is continued to tell which lane it aims at
_STRAIGHT = 1e-4  # [m], and a tenth of it [rad]: below, an ego car is taken to drive straight

SLOWER, FASTER, IDLE, LEFT, RIGHT = 4, 3, 1, 0, 2


@njit(cache=True, error_model="numpy")
def look(  # noqa: C901 - one loop, compiled as one
    cars: np.ndarray,
    ego: np.ndarray,
    levels: np.ndarray,
    lanes: int,
    dt: float,
    frames: int,
    stride: int,
    horizon: int,
    kind: int,
    after: int,
    weight: float,
    growth: np.ndarray,
    ahead: np.ndarray,
    tolerated: np.ndarray,
    shift: np.ndarray,
    aims: np.ndarray,
    forecast: np.ndarray,
) -> None:
    """Fill each action's tolerated position error, and where the cars are forecast to be.

    Args:
        cars: (n, m, 5).
        ego: (n, 5).
        levels: Speed levels of the ego car [m/s], (n, levels).
        lanes: Lanes of the road.
        dt: A frame [s].
        frames: Frames a decision.
        stride: Frames between two looks at the distances; divides `frames`.
        horizon: Decisions that are rolled out.
        kind: Forecast of the cars: 0 constant velocity, 1 settling in a lane, 2 that and IDM.
        after: Action of the plan after the first.
        weight: Metres along the road that one metre across it is worth.
        growth: Share of the margin that is wanted at each look, (looks,).
        ahead: Working memory, (m, looks, 2).
        tolerated: (n, 5), filled.
        shift: How far each action moves the ego car along the road in one decision, (n, 5), filled.
        aims: Target lane and target speed after each action, (n, 5, 2), filled.
        forecast: Position relative to the ego car's present x, and y, after each decision,
            (n, m, horizon, 2), filled.
    """
    n, m = cars.shape[0], cars.shape[1]
    looks, each = horizon * frames // stride, frames // stride
    for e in range(n):
        _foresee(cars[e], ego[e], dt * stride, looks, kind, ahead)
        for k in range(m):
            for h in range(horizon):
                forecast[e, k, h, 0] = ahead[k, (h + 1) * each - 1, 0]
                forecast[e, k, h, 1] = ahead[k, (h + 1) * each - 1, 1]
        for action in range(5):
            y, heading, v = ego[e, 0], ego[e, 1], ego[e, 2]
            lane, speed = _decide(y, v, ego[e, 3], ego[e, 4], action, levels[e], lanes)
            aims[e, action, 0], aims[e, action, 1] = lane, speed
            twin = -1
            for other in range(action):
                if aims[e, other, 0] == lane and aims[e, other, 1] == speed:
                    twin = other
                    break
            if twin >= 0:
                tolerated[e, action] = tolerated[e, twin]
                shift[e, action] = shift[e, twin]
                continue
            x, least, at = 0.0, np.inf, 0
            for h in range(horizon):
                if h > 0:
                    lane, speed = _decide(y, v, lane, speed, after, levels[e], lanes)
                for f in range(frames):
                    x, y, heading, v = _frame(x, y, heading, v, lane, speed, dt)
                    if (f + 1) % stride == 0:
                        for k in range(m):
                            if cars[e, k, 0] > 0.5:
                                gap = _gap(ahead[k, at, 0] - x, ahead[k, at, 1] - y, weight)
                                gap = gap / growth[at]
                                least = gap if gap < least else least
                        at += 1
                if h == 0:
                    shift[e, action] = x
            tolerated[e, action] = least


@njit(cache=True, error_model="numpy")
def _decide(
    y: float, v: float, lane: float, speed: float, action: int, levels: np.ndarray, lanes: int
) -> tuple:
    """Return the target lane and target speed after a decision, as highway-env's ego car."""
    if action in (FASTER, SLOWER):
        top = levels.size - 1
        index = np.rint((v - levels[0]) / (levels[top] - levels[0]) * top)
        index = min(max(index, 0.0), float(top)) + (1 if action == FASTER else -1)
        speed = levels[int(min(max(index, 0.0), float(top)))]
    elif action in (LEFT, RIGHT):
        wanted = min(max(lane + (1 if action == RIGHT else -1), 0.0), lanes - 1.0)
        if abs(y - _LANE * wanted) <= 2 * _LANE:
            lane = wanted
    return lane, speed


@njit(cache=True, error_model="numpy")
def _frame(
    x: float, y: float, heading: float, v: float, lane: float, target: float, dt: float
) -> tuple:
    """Move the ego car by one frame."""
    acceleration = _KP_SPEED * (target - v)
    if v > _MAX_SPEED:
        acceleration = min(acceleration, _MAX_SPEED - v)
    lateral = y - _LANE * lane
    if abs(lateral) < _STRAIGHT and abs(heading) < 0.1 * _STRAIGHT:
        return x + v * dt, y, heading, v + acceleration * dt
    divisor = v if abs(v) > 1e-2 else (1e-2 if v >= 0 else -1e-2)
    command = math.asin(min(max(-_KP_LATERAL * lateral / divisor, -1.0), 1.0))
    command = min(max(command, -0.25 * math.pi), 0.25 * math.pi)
    turn = (command - heading + math.pi) % (2 * math.pi) - math.pi
    slip = math.asin(min(max(2.5 / divisor * (_KP_HEADING * turn), -1.0), 1.0))
    wheel = math.atan(2 * math.tan(slip))
    wheel = min(max(wheel, -math.pi / 3), math.pi / 3)
    beta = math.atan(0.5 * math.tan(wheel))
    x += v * math.cos(heading + beta) * dt
    y += v * math.sin(heading + beta) * dt
    heading += v * math.sin(beta) / 2.5 * dt
    return x, y, heading, v + acceleration * dt


@njit(cache=True, error_model="numpy")
def _gap(dx: float, dy: float, weight: float) -> float:
    """Clearance of two cars: the larger of the gap along and the weighted gap across."""
    along, across = abs(dx) - _LENGTH, weight * (abs(dy) - _WIDTH)
    return along if along > across else across


@njit(cache=True, error_model="numpy")
def _foresee(
    cars: np.ndarray, ego: np.ndarray, dt: float, looks: int, kind: int, ahead: np.ndarray
) -> None:
    """Forecast every observed car at every look."""
    m = cars.shape[0]
    vx, vy = ego[2] * math.cos(ego[1]), ego[2] * math.sin(ego[1])
    for k in range(m):
        x, y = cars[k, 1], ego[0] + cars[k, 2]
        u, w = vx + cars[k, 3], vy + cars[k, 4]
        lane = _LANE * np.rint((y + _GLANCE * w) / _LANE)
        for j in range(looks):
            t = (j + 1) * dt
            ahead[k, j, 0] = x + u * t
            if kind == 0:
                ahead[k, j, 1] = y + w * t
            else:
                ahead[k, j, 1] = lane + (y - lane) * math.exp(-t / _SETTLING)
    if kind == 2:
        for j in range(looks):
            for k in range(m):
                if cars[k, 0] > 0.5:
                    ahead[k, j, 0] = _followed(cars, vx, dt, j, k, ahead)


@njit(cache=True, error_model="numpy")
def _followed(cars: np.ndarray, vx: float, dt: float, j: int, k: int, ahead: np.ndarray) -> float:
    """Where car k is at look j if it holds its speed but follows the observed car before it."""
    x = ahead[k, j - 1, 0] if j > 0 else cars[k, 1]
    before = cars[k, 1] if j == 1 else ahead[k, j - 2, 0] if j > 1 else x - (vx + cars[k, 3]) * dt
    v = (x - before) / dt
    wanted = max(vx + cars[k, 3], 1.0)
    gap, closing = np.inf, 0.0
    for i in range(cars.shape[0]):
        if i == k or cars[i, 0] < 0.5 or abs(ahead[i, j, 1] - ahead[k, j, 1]) > 0.5 * _LANE:
            continue
        place = ahead[i, j - 1, 0] if j > 0 else cars[i, 1]
        if 0.0 < place - x < gap:
            gap, closing = place - x, v - (vx + cars[i, 3])
    ratio = max(v, 0.0) / wanted
    acceleration = 3.0 * (1.0 - ratio * ratio * ratio * ratio)
    if gap < np.inf:
        desired = 10.0 + 1.5 * v + v * closing / 7.745966692414834
        acceleration -= 3.0 * (desired / max(gap, 1e-2)) ** 2
    acceleration = min(max(acceleration, -6.0), 6.0)
    return x + max(v + acceleration * dt, 0.0) * dt


@njit(cache=True, error_model="numpy")
def associate(  # noqa: C901 - one loop, compiled as one
    cars: np.ndarray,
    seen: int,
    ego: np.ndarray,
    place: np.ndarray,
    age: np.ndarray,
    past: np.ndarray,
    past_id: np.ndarray,
    velocity: np.ndarray,
    unseen: np.ndarray,
    memory: int,
    radius: float,
    weight: float,
    gains: np.ndarray,
    fresh: np.ndarray,
    identity: np.ndarray,
    taken: np.ndarray,
    missing: np.ndarray,
) -> None:
    """Say which car each row shows, and keep cars that are not seen for a while.

    A row shows the car whose forecast of one decision ago is nearest. A car that no row shows is
    put into a free row, where it was forecast to be, up to `memory` decisions in a row.

    Args:
        cars: (n, m, 5), of which the first `seen` rows come from the observation; the others
            are filled.
        seen: Rows of the observation.
        ego: As in `look`.
        place: The ego car's (x, y) since the episode's beginning, (n, 2).
        age: Decisions since then, (n,).
        past: Forecasts by how long ago they were made, (n, horizon, m, horizon, 2).
        past_id: Whom they were of, (n, horizon, m); negative for nobody.
        velocity: Each row's velocity at the last decision, (n, m, 2), changed.
        unseen: For how many decisions it has not been seen, (n, m), changed.
        memory: For how many decisions a car is kept.
        radius: Weighted distance from which on two are different cars [m].
        weight: As in `look`.
        gains: How far the filter follows what is seen: along and across, of place and speed, by
            what place and speed are off, (2, 2, 2); ones on the diagonal for no filter.
        fresh: The next unused identity, (n,), changed.
        identity: (n, m), filled.
        taken: Working memory, bool (m,).
        missing: Working memory, int64 (m,).
    """
    n, m = cars.shape[0], cars.shape[1]
    for e in range(n):
        vx, vy = ego[e, 2] * math.cos(ego[e, 1]), ego[e, 2] * math.sin(ego[e, 1])
        taken[:] = False
        for k in range(m):
            identity[e, k] = -1
            missing[k] = 0
            if k >= seen:
                cars[e, k, 0] = 0.0
        for _ in range(seen if age[e] > 0 else 0):
            best, row, other = radius, -1, -1
            for k in range(seen):
                if cars[e, k, 0] < 0.5 or identity[e, k] >= 0:
                    continue
                for i in range(m):
                    if taken[i] or past_id[e, 0, i] < 0:
                        continue
                    dx = cars[e, k, 1] + place[e, 0] - past[e, 0, i, 0, 0]
                    dy = cars[e, k, 2] + place[e, 1] - past[e, 0, i, 0, 1]
                    cost = max(abs(dx), weight * abs(dy))
                    if cost < best:
                        best, row, other = cost, k, i
            if row < 0:
                break
            identity[e, row] = past_id[e, 0, other]
            taken[other] = True
            for axis in range(2):
                before = past[e, 0, other, 0, axis] - place[e, axis]
                own = vx if axis == 0 else vy
                off = cars[e, row, 1 + axis] - before
                faster = cars[e, row, 3 + axis] + own - velocity[e, other, axis]
                g = gains[axis]
                cars[e, row, 1 + axis] = before + g[0, 0] * off + g[0, 1] * faster
                speed = velocity[e, other, axis] + g[1, 0] * off + g[1, 1] * faster
                cars[e, row, 3 + axis] = speed - own
        for k in range(seen):
            if cars[e, k, 0] > 0.5 and identity[e, k] < 0:
                identity[e, k] = fresh[e]
                fresh[e] += 1
        row = seen
        for i in range(m if age[e] > 0 else 0):
            if taken[i] or past_id[e, 0, i] < 0 or unseen[e, i] >= memory or row >= m:
                continue
            cars[e, row, 0] = 1.0
            cars[e, row, 1] = past[e, 0, i, 0, 0] - place[e, 0]
            cars[e, row, 2] = past[e, 0, i, 0, 1] - place[e, 1]
            cars[e, row, 3] = velocity[e, i, 0] - vx
            cars[e, row, 4] = velocity[e, i, 1] - vy
            identity[e, row] = past_id[e, 0, i]
            missing[row] = unseen[e, i] + 1
            row += 1
        for k in range(m):
            velocity[e, k, 0], velocity[e, k, 1] = cars[e, k, 3] + vx, cars[e, k, 4] + vy
            unseen[e, k] = missing[k]


@njit(cache=True, error_model="numpy")
def score(  # noqa: C901 - one loop, compiled as one
    cars: np.ndarray,
    seen: int,
    place: np.ndarray,
    age: np.ndarray,
    past: np.ndarray,
    past_id: np.ndarray,
    identity: np.ndarray,
    weight: float,
    kind: int,
    far: float,
    errors: np.ndarray,
    known: np.ndarray,
    clearance: np.ndarray,
) -> None:
    """Compare what was forecast h decisions ago for now with what is seen now, h = 1 ... horizon.

    Args:
        cars: As in `associate`.
        seen: As in `associate`.
        place: As in `associate`.
        age: As in `associate`.
        past: As in `associate`.
        past_id: As in `associate`.
        identity: Whom the rows show, (n, m).
        weight: As in `look`.
        kind: Error of a forecast: 0 the largest over the cars of forecast less seen clearance, 1
            the same of the position error, 2 forecast less seen clearance of the nearest car.
        far: Clearance that counts where nobody is seen, and the largest [m].
        errors: (n, horizon), filled.
        known: Whether there is one, (n, horizon), filled.
        clearance: The clearance now, (n,), filled.
    """
    n, m, horizon = cars.shape[0], cars.shape[1], past.shape[1]
    for e in range(n):
        near = far
        for k in range(seen):
            if cars[e, k, 0] > 0.5:
                near = min(near, _gap(cars[e, k, 1], cars[e, k, 2], weight))
        clearance[e] = near
        for h in range(horizon):
            known[e, h] = False
            errors[e, h] = 0.0
            if age[e] <= h:
                continue
            most, foreseen = -np.inf, far
            for i in range(m):
                if past_id[e, h, i] < 0:
                    continue
                x, y = past[e, h, i, h, 0] - place[e, 0], past[e, h, i, h, 1] - place[e, 1]
                foreseen = min(foreseen, _gap(x, y, weight))
                for k in range(seen):
                    if identity[e, k] == past_id[e, h, i]:
                        if kind == 1:
                            off = max(abs(cars[e, k, 1] - x), weight * abs(cars[e, k, 2] - y))
                        else:
                            off = _gap(x, y, weight) - _gap(cars[e, k, 1], cars[e, k, 2], weight)
                        most = max(most, off)
            if kind == 2:
                most = foreseen - near
            if most > -np.inf:
                known[e, h] = True
                errors[e, h] = most
