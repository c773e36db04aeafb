"""Where a number lives: the batch's packed arrays and the settings as the kernels see them.

A batch is two arrays. `cars[e, field, i]` holds a float64 field of car i of environment e and
`codes[e, field, i]` an int64 one; the ego car is car 0. Rows are padded by at least one slot: the
first is a sentinel far ahead, the car in front of whoever has none, and whole vectors can be read
past the end.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from cpl.highway._compile import inlined, tuple_of
from cpl.highway.config import FEATURES, Config

__all__ = [
    "Car",
    "Codes",
    "Fields",
    "Memory",
    "Scratch",
    "Settings",
    "Workspace",
    "allocate",
    "car_views",
    "feature_table",
    "scratch_from",
    "settings_from",
    "settings_of",
    "workspace",
]


class Fields:
    """Rows of `cars`."""

    X, Y, HEADING, SPEED, TARGET_SPEED, TIMER, DELTA = range(7)
    IMPACT_X, IMPACT_Y, COS, SIN, DIVISOR = range(7, 12)
    COUNT = 12


class Codes:
    """Rows of `codes`."""

    LANE, TARGET_LANE, CRASHED, HAS_IMPACT, ORDER = range(5)
    COUNT = 5


class Car(NamedTuple):
    """One environment's rows, each indexed by the car."""

    x: np.ndarray
    y: np.ndarray
    heading: np.ndarray
    speed: np.ndarray
    target_speed: np.ndarray
    timer: np.ndarray
    delta: np.ndarray
    impact_x: np.ndarray
    impact_y: np.ndarray
    cos: np.ndarray
    sin: np.ndarray
    divisor: np.ndarray
    lane: np.ndarray
    target_lane: np.ndarray
    crashed: np.ndarray
    has_impact: np.ndarray
    order: np.ndarray


@inlined
def car_views(cars: np.ndarray, codes: np.ndarray, e: int) -> Car:
    """View environment e of a batch as a `Car`."""
    f, c = cars[e], codes[e]
    return Car(
        f[0], f[1], f[2], f[3], f[4], f[5], f[6], f[7], f[8], f[9], f[10], f[11],
        c[0], c[1], c[2], c[3], c[4],
    )  # fmt: skip


class Settings(NamedTuple):
    """A `Config` as scalars: counts and flags first, then real numbers."""

    n: int
    lanes: int
    initial_lane: int
    frames: int
    rows: int
    columns: int
    collisions: int
    normalize_reward: int
    offroad_terminal: int
    see_behind: int
    absolute: int
    normalize: int
    clip: int
    shuffled: int
    lane_change: int
    dt: float
    policy_dt: float
    duration: float
    ego_gap: float
    other_gap: float
    gap_factor: float
    initial_speed: float
    speed_low: float
    speed_span: float
    delta_low: float
    delta_span: float
    collision_reward: float
    right_lane_reward: float
    high_speed_reward: float
    reward_low: float
    reward_high: float
    noise: float
    dropout: float
    speed_limit: float
    acc_max: float
    comfort: float
    twice_root_ab: float
    distance_wanted: float
    time_wanted: float
    politeness: float
    min_gain: float
    max_imposed: float
    delay: float


_COUNTS = 15
_NUMBERS = 28


@inlined
def settings_from(counts: np.ndarray, numbers: np.ndarray) -> Settings:
    """Read `Settings` back from the arrays of `settings_of`."""
    return Settings(*(tuple_of(counts, _COUNTS) + tuple_of(numbers, _NUMBERS)))


class Memory(NamedTuple):
    """Arrays of a batch; the first axis is the environment."""

    cars: np.ndarray
    codes: np.ndarray
    time: np.ndarray
    steps: np.ndarray
    speed_index: np.ndarray
    generator: np.ndarray
    noise_generator: np.ndarray
    ready: np.ndarray


class Scratch(NamedTuple):
    """Working memory of one thread: rows for every car, rows for the steering cars, and lists."""

    forward: np.ndarray
    sideways: np.ndarray
    ratio: np.ndarray
    free: np.ndarray
    gap: np.ndarray
    acceleration: np.ndarray
    x: np.ndarray
    y: np.ndarray
    heading: np.ndarray
    speed: np.ndarray
    divisor: np.ndarray
    a: np.ndarray
    b: np.ndarray
    c: np.ndarray
    gentle_y: np.ndarray
    gentle_heading: np.ndarray
    doubt: np.ndarray
    front: np.ndarray
    rank: np.ndarray
    steering: np.ndarray
    gentle: np.ndarray
    hit: np.ndarray
    changing: np.ndarray
    last: np.ndarray
    pairs: np.ndarray
    nearest: np.ndarray
    corners: np.ndarray


class Workspace(NamedTuple):
    """The arrays behind a `Scratch`."""

    reals: np.ndarray
    codes: np.ndarray
    last: np.ndarray
    pairs: np.ndarray
    nearest: np.ndarray
    corners: np.ndarray


def workspace(config: Config) -> Workspace:
    """Allocate one thread's working memory.

    Args:
        config: The road.

    Returns:
        Arrays of zeros; the front cars are everywhere the sentinel.
    """
    n = config.vehicles_count + 1
    stride = 8 * (n // 8 + 1)
    codes = np.zeros((7, stride), np.int64)
    codes[1] = n
    return Workspace(
        reals=np.zeros((16, stride)),
        codes=codes,
        last=_alone(config.lanes_count),
        pairs=_alone(4 * stride),
        nearest=_alone(config.observation_vehicles_count),
        corners=_alone(16).view(np.float64).reshape(2, 8),
    )


def _alone(size: int) -> np.ndarray:
    """Integers that share no cache line with another thread's."""
    line = 16
    return np.zeros(size + 2 * line, np.int64)[line : line + size]


@inlined
def scratch_from(s: Workspace) -> Scratch:
    """View a workspace's rows by name."""
    r, c = s.reals, s.codes
    return Scratch(
        r[0], r[1], r[2], r[3], r[4], r[5], r[6], r[7], r[8], r[9], r[10], r[11], r[12], r[13],
        r[14], r[15], c[0], c[1], c[2], c[3], c[4], c[5], c[6],
        s.last, s.pairs, s.nearest, s.corners,
    )  # fmt: skip


def allocate(config: Config, n_envs: int) -> Memory:
    """Allocate a batch's memory.

    Args:
        config: The road.
        n_envs: Number of environments.

    Returns:
        Arrays of zeros with the sentinels in place.
    """
    n = config.vehicles_count + 1
    stride = 8 * (n // 8 + 1)
    cars = np.zeros((n_envs, Fields.COUNT, stride))
    cars[:, Fields.X, n:] = math.inf
    cars[:, Fields.COS, n:] = 1.0
    cars[:, Fields.DIVISOR, n:] = 1.0
    cars[:, Fields.DELTA, n:] = 1.0
    codes = np.zeros((n_envs, Codes.COUNT, stride), np.int64)
    return Memory(
        cars=cars,
        codes=codes,
        time=np.zeros(n_envs),
        steps=np.zeros(n_envs, np.int64),
        speed_index=np.zeros(n_envs, np.int64),
        generator=np.zeros((n_envs, 6), np.uint64),
        noise_generator=np.zeros((n_envs, 6), np.uint64),
        ready=np.zeros(n_envs, np.bool_),
    )


def settings_of(config: Config) -> tuple[np.ndarray, np.ndarray]:
    """Flatten a config for the kernels, with highway-env's order of operations.

    Two arrays rather than a tuple of numbers: handing a kernel 43 scalars takes longer than a step.

    Args:
        config: The road.

    Returns:
        Counts, int64, and numbers, float64, to be read with `settings_from`.
    """
    speed_low, speed_high = config.other_speed_range
    delta_low, delta_high = config.delta_range
    settings = Settings(
        n=config.vehicles_count + 1,
        lanes=config.lanes_count,
        initial_lane=-1 if config.initial_lane_id is None else config.initial_lane_id,
        frames=config.frames,
        rows=config.observation_vehicles_count,
        columns=len(config.features),
        collisions={"all": 2, "ego": 1, "none": 0}[config.collisions],
        normalize_reward=config.normalize_reward,
        offroad_terminal=config.offroad_terminal,
        see_behind=config.see_behind,
        absolute=config.absolute,
        normalize=config.normalize,
        clip=config.clip,
        shuffled=config.order == "shuffled",
        lane_change=config.enable_lane_change,
        dt=1 / config.simulation_frequency,
        policy_dt=1 / config.policy_frequency,
        duration=config.duration,
        ego_gap=config.ego_spacing,
        other_gap=1 / config.vehicles_density,
        gap_factor=math.exp(-5 / 40 * config.lanes_count),
        initial_speed=25.0,
        speed_low=speed_low,
        speed_span=speed_high - speed_low,
        delta_low=delta_low,
        delta_span=delta_high - delta_low,
        collision_reward=config.collision_reward,
        right_lane_reward=config.right_lane_reward,
        high_speed_reward=config.high_speed_reward,
        reward_low=config.reward_speed_range[0],
        reward_high=config.reward_speed_range[1],
        noise=config.observation_noise,
        dropout=config.observation_dropout,
        speed_limit=config.speed_limit,
        acc_max=config.acc_max,
        comfort=config.comfort_acc_max,
        twice_root_ab=2 * math.sqrt(-config.comfort_acc_max * config.comfort_acc_min),
        distance_wanted=config.distance_wanted,
        time_wanted=config.time_wanted,
        politeness=config.politeness,
        min_gain=config.lane_change_min_acc_gain,
        max_imposed=config.lane_change_max_braking_imposed,
        delay=config.lane_change_delay,
    )
    return np.array(settings[:_COUNTS], np.int64), np.array(settings[_COUNTS:])


def feature_table(config: Config) -> tuple[np.ndarray, np.ndarray]:
    """Codes and ranges of the observation's columns.

    Args:
        config: The road.

    Returns:
        Feature codes, int64 (columns,), and (low, high, has a range), float64 (columns, 3).
    """
    ranges = config.ranges()
    codes = np.array([FEATURES.index(name) for name in config.features], np.int64)
    table = np.zeros((len(codes), 3))
    for column, name in enumerate(config.features):
        if name in ranges:
            table[column] = (*ranges[name], 1.0)
    return codes, table
