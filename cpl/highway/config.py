"""The road's settings: highway-env 1.12.1's option names and defaults, with their units."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

from cpl.highway.geometry import LANE_WIDTH, MAX_SPEED

__all__ = ["FEATURES", "PAPER", "Config"]

FEATURES = (
    "presence",
    "x",
    "y",
    "vx",
    "vy",
    "heading",
    "cos_h",
    "sin_h",
    "cos_d",
    "sin_d",
    "long_off",
    "lat_off",
    "ang_off",
)
"""What a row of the observation can hold; the order is the kernels' feature code."""

_ORDERS = ("sorted", "shuffled")
_COLLISIONS = ("all", "ego", "none")


@dataclass(frozen=True, kw_only=True)
class Config:
    """Everything that defines the road; what is left out has highway-env 1.12.1's value.

    Attributes:
        lanes_count: Number of lanes [-], 1 to 64.
        vehicles_count: Number of cars besides the ego car [-].
        initial_lane_id: Lane the ego car starts in [-]; None draws one.
        duration: Episode length after which a step truncates [s].
        ego_spacing: Gap before the ego car at the start, in units of the default gap [-].
        vehicles_density: Density of the other cars at the start; 1 / spacing [-].
        collision_reward: Weight of having crashed [-].
        right_lane_reward: Weight of the (target) lane, 0 leftmost to 1 rightmost [-].
        high_speed_reward: Weight of the forward speed mapped by `reward_speed_range` [-].
        lane_change_reward: Kept for its name; highway-env 1.12.1 never uses it either [-].
        reward_speed_range: Forward speeds that earn 0 and 1 [m/s].
        normalize_reward: Whether [collision, high speed + right lane] is mapped to [0, 1].
        offroad_terminal: Whether leaving the road terminates.
        simulation_frequency: Frames per second [Hz], at least `policy_frequency`.
        policy_frequency: Decisions per second [Hz]. Where it does not divide the frames, each
            decision has their whole quotient and still counts 1 / policy_frequency, as in
            highway-env: with 15 and 2 Hz, 7 frames and half a second.
        target_speeds: Strictly increasing speed levels of the ego car, at least two [m/s].
        observation_vehicles_count: Rows of the observation, the ego car's included [-]. With one
            row only the ego car is shown (highway-env then shows every car in sight).
        features: Columns of the observation, from `FEATURES`.
        features_range: Feature -> (low, high) mapped to [-1, 1]; None is highway-env's
            x 200 m, y 4 m a lane, vx and vy 80 m/s, each to both sides.
        see_behind: Whether cars more than 10 m behind are observed.
        absolute: Whether other cars' rows are absolute rather than relative to the ego car.
        normalize: Whether features are mapped by their range.
        clip: Whether mapped features are clipped to [-1, 1].
        order: "sorted" by distance along the road, or "shuffled" (drawn from the episode's
            generator, as highway-env does).
        observation_noise: Standard deviation of the Gaussian noise on every feature but presence
            of the other cars' rows, in the units of the returned feature; 0 draws nothing.
        observation_dropout: Probability that another car's row is blanked [-]; 0 draws nothing.
        collisions: "all" pairs collide, only pairs with the "ego" (highway-fast-v0), or "none".
        other_speed_range: Range the other cars' initial (and desired) speeds are drawn from [m/s].
        speed_limit: Limit that clips every car's desired speed in the car-following model [m/s].
        enable_lane_change: Whether the other cars change lanes.
        acc_max: Largest acceleration and braking of the other cars [m/s2].
        comfort_acc_max: Desired acceleration of the other cars [m/s2].
        comfort_acc_min: Desired braking of the other cars, negative [m/s2].
        distance_wanted: Desired distance at standstill, centre to centre [m].
        time_wanted: Desired time gap [s].
        delta_range: Range each car's speed exponent is drawn from [-].
        politeness: Weight of the others' gain in a lane change [-].
        lane_change_min_acc_gain: Gain that a lane change must bring [m/s2].
        lane_change_max_braking_imposed: Braking that it may impose on the new follower [m/s2].
        lane_change_delay: Time between two decisions about a lane change [s].

    Raises:
        ValueError: Naming the field and its value where the road would be impossible.

    Example:
        >>> Config(lanes_count=3).target_speeds
        (20.0, 25.0, 30.0)
        >>> Config(lanes_count=0)
        Traceback (most recent call last):
            ...
        ValueError: lanes_count must be an integer in [1, 64], got 0
    """

    lanes_count: int = 4
    vehicles_count: int = 50
    initial_lane_id: int | None = None
    duration: float = 40.0
    ego_spacing: float = 2.0
    vehicles_density: float = 1.0
    collision_reward: float = -1.0
    right_lane_reward: float = 0.1
    high_speed_reward: float = 0.4
    lane_change_reward: float = 0.0
    reward_speed_range: tuple[float, float] = (20.0, 30.0)
    normalize_reward: bool = True
    offroad_terminal: bool = False
    simulation_frequency: int = 15
    policy_frequency: int = 1
    target_speeds: tuple[float, ...] = (20.0, 25.0, 30.0)
    observation_vehicles_count: int = 5
    features: tuple[str, ...] = ("presence", "x", "y", "vx", "vy")
    features_range: Mapping[str, tuple[float, float]] | tuple | None = None
    see_behind: bool = False
    absolute: bool = False
    normalize: bool = True
    clip: bool = True
    order: str = "sorted"
    observation_noise: float = 0.0
    observation_dropout: float = 0.0
    collisions: str = "all"
    other_speed_range: tuple[float, float] = (21.0, 24.0)
    speed_limit: float = 30.0
    enable_lane_change: bool = True
    acc_max: float = 6.0
    comfort_acc_max: float = 3.0
    comfort_acc_min: float = -5.0
    distance_wanted: float = 10.0
    time_wanted: float = 1.5
    delta_range: tuple[float, float] = (3.5, 4.5)
    politeness: float = 0.0
    lane_change_min_acc_gain: float = 0.2
    lane_change_max_braking_imposed: float = 2.0
    lane_change_delay: float = 1.0

    def __post_init__(self) -> None:
        for name, (low, high) in _INTEGERS.items():
            self._set(name, _integer(name, getattr(self, name), low, high))
        for name, (low, high, strict) in _FLOATS.items():
            self._set(name, _real(name, getattr(self, name), low, high, strict))
        for name in _RANGES:
            self._set(name, _interval(name, getattr(self, name), strict=False))
        for name in _FLAGS:
            if not isinstance(getattr(self, name), bool):
                raise ValueError(f"{name} must be True or False, got {getattr(self, name)!r}")
        self._set("reward_speed_range", _interval("reward_speed_range", self.reward_speed_range))
        self._set("target_speeds", _speed_levels(self.target_speeds))
        self._set("features", _feature_names(self.features))
        self._set("features_range", _feature_ranges(self.features_range))
        if self.initial_lane_id is not None:
            top = self.lanes_count - 1
            self._set("initial_lane_id", _integer("initial_lane_id", self.initial_lane_id, 0, top))
        _choice("order", self.order, _ORDERS)
        _choice("collisions", self.collisions, _COLLISIONS)
        if self.simulation_frequency < self.policy_frequency:
            raise ValueError(
                "simulation_frequency must be at least policy_frequency"
                f" ({self.policy_frequency}), got {self.simulation_frequency}: no frame would be"
                " simulated between two decisions"
            )
        if self.normalize_reward and (
            self.high_speed_reward + self.right_lane_reward == self.collision_reward
        ):
            raise ValueError(
                "collision_reward must differ from high_speed_reward + right_lane_reward when"
                f" normalize_reward is set, got {self.collision_reward}"
            )

    @property
    def frames(self) -> int:
        """Simulation frames per decision [-]."""
        return self.simulation_frequency // self.policy_frequency

    def ranges(self) -> dict[str, tuple[float, float]]:
        """Feature ranges in force, highway-env's where none were given.

        Returns:
            Feature name -> (low, high) in the feature's unit.
        """
        if self.features_range is not None:
            return dict(self.features_range)
        side = LANE_WIDTH * self.lanes_count
        far, fast = 5.0 * MAX_SPEED, 2.0 * MAX_SPEED
        return {"x": (-far, far), "y": (-side, side), "vx": (-fast, fast), "vy": (-fast, fast)}

    def _set(self, name: str, value: object) -> None:
        object.__setattr__(self, name, value)


_INTEGERS = {
    "lanes_count": (1, 64),
    "vehicles_count": (0, 10_000),
    "simulation_frequency": (1, 1_000),
    "policy_frequency": (1, 1_000),
    "observation_vehicles_count": (1, 10_001),
}
_INF = math.inf
# name: (low, high, whether low itself is excluded)
_FLOATS = {
    "duration": (0.0, _INF, True),
    "ego_spacing": (0.0, _INF, True),
    "vehicles_density": (0.0, _INF, True),
    "collision_reward": (-_INF, _INF, False),
    "right_lane_reward": (-_INF, _INF, False),
    "high_speed_reward": (-_INF, _INF, False),
    "lane_change_reward": (-_INF, _INF, False),
    "observation_noise": (0.0, _INF, False),
    "observation_dropout": (0.0, 1.0, False),
    "speed_limit": (0.0, _INF, True),
    "acc_max": (0.0, _INF, True),
    "comfort_acc_max": (0.0, _INF, True),
    "comfort_acc_min": (-_INF, -1e-9, False),
    "distance_wanted": (0.0, _INF, False),
    "time_wanted": (0.0, _INF, False),
    "politeness": (0.0, _INF, False),
    "lane_change_min_acc_gain": (-_INF, _INF, False),
    "lane_change_max_braking_imposed": (0.0, _INF, False),
    "lane_change_delay": (0.0, _INF, True),
}
_RANGES = ("other_speed_range", "delta_range")
_FLAGS = (
    "normalize_reward",
    "offroad_terminal",
    "see_behind",
    "absolute",
    "normalize",
    "clip",
    "enable_lane_change",
)


def _integer(name: str, value: object, low: int, high: int) -> int:
    if isinstance(value, bool) or not hasattr(value, "__index__"):
        raise ValueError(f"{name} must be an integer in [{low}, {high}], got {value!r}")
    number = value.__index__()  # pyright: ignore[reportAttributeAccessIssue]
    if not low <= number <= high:
        raise ValueError(f"{name} must be an integer in [{low}, {high}], got {value!r}")
    return number


def _real(name: str, value: object, low: float, high: float, strict: bool) -> float:
    bracket = "(" if strict else "["
    message = f"{name} must be a finite number in {bracket}{low:g}, {high:g}], got {value!r}"
    if isinstance(value, bool | str) or not hasattr(value, "__float__"):
        raise ValueError(message)
    number = float(value)  # pyright: ignore[reportArgumentType]
    if not math.isfinite(number) or number > high or number < low or (strict and number == low):
        raise ValueError(message)
    return number


def _interval(name: str, value: Sequence[float], strict: bool = True) -> tuple[float, float]:
    relation = "<" if strict else "<="
    message = f"{name} must be two finite numbers, low {relation} high, got {value!r}"
    if isinstance(value, str) or not hasattr(value, "__len__") or len(value) != 2:
        raise ValueError(message)
    low, high = (_real(name, item, -_INF, _INF, strict=False) for item in value)
    if low > high or (strict and low == high):
        raise ValueError(message)
    return low, high


def _speed_levels(value: Sequence[float]) -> tuple[float, ...]:
    message = f"target_speeds must be at least two strictly increasing speeds, got {value!r}"
    if isinstance(value, str) or not hasattr(value, "__len__") or len(value) < 2:
        raise ValueError(message)
    levels = tuple(_real("target_speeds", item, -_INF, _INF, strict=False) for item in value)
    if any(b <= a for a, b in pairwise(levels)):
        raise ValueError(message)
    return levels


def _feature_names(value: Sequence[str]) -> tuple[str, ...]:
    names = (value,) if isinstance(value, str) else tuple(value)
    if not names or len(set(names)) < len(names) or not set(names) <= set(FEATURES):
        raise ValueError(f"features must be distinct names out of {FEATURES}, got {value!r}")
    return names


def _feature_ranges(value: Mapping | Sequence | None) -> tuple | None:
    if value is None or not len(value):
        return None  # highway-env, too, takes an empty mapping for "its own ranges"
    pairs = value.items() if isinstance(value, Mapping) else value
    for name, _ in pairs:
        _choice("features_range", name, FEATURES)
    return tuple((name, _interval(f"features_range[{name!r}]", limits)) for name, limits in pairs)


def _choice(name: str, value: str, allowed: Sequence[str]) -> None:
    if value not in allowed:
        raise ValueError(f"{name} must be one of {tuple(allowed)}, got {value!r}")


PAPER = Config(
    target_speeds=(20.0, 25.0, 30.0),
    high_speed_reward=0.5,
    right_lane_reward=0.0,
    normalize_reward=False,
)
"""The paper's road: 4 lanes, 50 cars, 40 s, rewards as its learner's (unnormalised)."""
