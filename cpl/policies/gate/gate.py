"""The gate: of the actions that a policy likes, the first whose plan tolerates the margin."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cpl.highway import Config
from cpl.policies.gate import _kernels
from cpl.policies.gate.config import ERRORS, FORECASTS, GateConfig
from cpl.policies.gate.filter import filter_gains
from cpl.policies.gate.margins import Bools, Floats, Margin, Outcome

__all__ = ["Gate", "Sight", "gated"]

Ints = NDArray[np.int64]
_FEATURES = ("presence", "x", "y", "vx", "vy")


@dataclass(frozen=True, kw_only=True, eq=False)
class Sight:
    """What the gate knew and did at its last decision, n roads.

    Attributes:
        tolerated: D(a), the position error that each action's plan tolerates [m], (n, 5).
        margin: What was asked for [m], (n,).
        chosen: The actions, (n,).
        changed: Whether they are not what the base policy likes best, (n,).
        outcome: The errors that became known before it.
        scored: Where one for the whole horizon is among them, (n,).
        missed: Where that exceeds the margin of the time of its forecast, (n,).
    """

    tolerated: Floats
    margin: Floats
    chosen: Ints
    changed: Bools
    outcome: Outcome
    scored: Bools
    missed: Bools


class Gate:
    r"""Look ahead on n roads, and let pass what tolerates the margin.

    $$ a_t = \begin{cases} \text{the first } a \text{ in the base policy's order with }
       D_t(a) \ge m_t \\ \arg\max_a D_t(a) \text{ if there is none} \end{cases} $$

    where $D_t(a)$ is how far the other cars may be from where they are forecast before the plan
    "a, then slow down" meets one of them. The ego car is rolled out with its own exact model. The
    error of a forecast is known `horizon` decisions later and fed to the margin. Nothing but
    observations is used, so that the gate drives the engine and highway-env alike.

    Args:
        road: Its geometry, frequencies, speed levels and the scale of its observations.
        n: Roads.
        margin: What is asked for.
        config: How to look ahead.

    Raises:
        ValueError: If the observation is not of the kind that can be looked ahead from.
    """

    def __init__(
        self, road: Config, n: int, margin: Margin, config: GateConfig | None = None
    ) -> None:
        self.config = GateConfig() if config is None else config
        self.margin, self.n, self.road = margin, n, road
        self._check(road)
        self._scale = _scales(road)
        self.levels = np.tile(np.array(road.target_speeds), (n, 1))
        self._seen = road.observation_vehicles_count - 1
        h, m = self.config.horizon, self._seen * (2 if self.config.memory else 1)
        looks = h * road.frames // self.config.stride
        share = np.arange(1, looks + 1) / looks
        self._growth = np.maximum(share, self.config.floor) ** self.config.growth
        self._ahead = np.empty((m, looks, 2))
        self._gains = filter_gains(road, self.config.filtered)
        self._age = np.zeros(n, np.int64)
        self._ego = np.zeros((n, 5))
        self._place = np.zeros((n, 2))
        self._past = np.zeros((n, h, m, h, 2))
        self._past_id = np.full((n, h, m), -1, np.int64)
        self._fresh = np.zeros(n, np.int64)
        self._cars = np.zeros((n, m, 5))
        self._velocity = np.zeros((n, m, 2))
        self._unseen = np.zeros((n, m), np.int64)
        self._issued = np.zeros((n, h, margin.width))
        self._work = np.empty(m, np.bool_), np.empty(m, np.int64)
        self.sight: Sight | None = None

    def begin(self, chosen: Bools | None = None, levels: ArrayLike | None = None) -> None:
        """Begin episodes: nothing is under way; what the margin has learned it keeps.

        Args:
            chosen: On which roads, (n,); all by default.
            levels: Speed levels from now on [m/s], of one road or (n, levels).
        """
        rows = np.ones(self.n, np.bool_) if chosen is None else chosen
        if levels is not None:
            self.levels = np.where(rows[:, None], levels, self.levels)
        self._age[rows] = 0
        self._place[rows] = 0.0
        self._past_id[rows] = -1

    def __call__(
        self, obs: NDArray[np.float32], values: ArrayLike, active: Bools | None = None
    ) -> Ints:
        """Choose.

        Args:
            obs: Observations, (n, rows, 5).
            values: How much the base policy likes each action, (n, 5); minus infinity for never.
            active: Roads whose errors count, (n,); all by default.

        Returns:
            Actions, (n,).
        """
        counted = np.ones(self.n, np.bool_) if active is None else active
        cars = self._read(obs)
        outcome, identity = self._score(cars, counted)
        scored = outcome.known[:, -1]
        missed = scored & (outcome.errors[:, -1] > self._issued[:, -1, 0])
        self.margin.learn(outcome, self._issued)
        issued = self.margin.issue()
        tolerated, shift, aims, forecast = self.look(cars)
        liked = np.asarray(values, np.float64)
        chosen = _choose(liked, tolerated, issued[:, 0], self.config)
        self._remember(chosen, issued, identity, shift, aims, forecast)
        self.sight = Sight(
            tolerated=tolerated,
            margin=issued[:, 0],
            chosen=chosen,
            changed=chosen != liked.argmax(axis=1),
            outcome=outcome,
            scored=scored,
            missed=missed,
        )
        return chosen

    def look(self, cars: Floats) -> tuple[Floats, Floats, Floats, Floats]:
        """Return D(a), the ego car's advance and aims with each action, and the forecasts."""
        c, h = self.config, self.config.horizon
        tolerated, shift = np.empty((self.n, 5)), np.empty((self.n, 5))
        aims, forecast = np.empty((self.n, 5, 2)), np.empty((self.n, cars.shape[1], h, 2))
        _kernels.look(
            cars, self._ego, self.levels, self.road.lanes_count,
            1 / self.road.simulation_frequency, self.road.frames, c.stride, h,
            FORECASTS.index(c.forecast), c.after, c.weight, self._growth,
            self._ahead, tolerated, shift, aims, forecast,
        )  # fmt: skip
        return tolerated, shift, aims, forecast

    def _read(self, obs: NDArray[np.float32]) -> Floats:
        """Take observations apart, in metres; the ego car's targets are remembered."""
        metres = obs * self._scale
        ego, cars = metres[:, 0], self._cars
        cars[:, : self._seen] = metres[:, 1:]
        self._ego[:, 0] = ego[:, 2]
        self._ego[:, 1] = np.arctan2(ego[:, 4], ego[:, 3])
        self._ego[:, 2] = np.hypot(ego[:, 3], ego[:, 4])
        begun = self._age == 0
        if begun.any():
            lane = np.clip(np.rint(ego[:, 2] / 4.0), 0, self.road.lanes_count - 1)
            low, span = self.levels[:, 0], self.levels[:, -1] - self.levels[:, 0]
            top = self.levels.shape[1] - 1
            index = np.clip(np.rint((self._ego[:, 2] - low) / span * top), 0, top).astype(np.int64)
            self._ego[begun, 3] = lane[begun]
            self._ego[begun, 4] = self.levels[np.arange(self.n), index][begun]
        self._place[:, 1] = ego[:, 2]
        return cars

    def _score(self, cars: Floats, counted: Bools) -> tuple[Outcome, Ints]:
        c, n, m = self.config, self.n, cars.shape[1]
        identity = np.empty((n, m), np.int64)
        errors, known = np.empty((n, c.horizon)), np.empty((n, c.horizon), np.bool_)
        clearance = np.empty(n)
        _kernels.associate(
            cars, self._seen, self._ego, self._place, self._age, self._past, self._past_id,
            self._velocity, self._unseen, c.memory, c.radius, c.weight, self._gains,
            self._fresh, identity, *self._work,
        )  # fmt: skip
        _kernels.score(
            cars, self._seen, self._place, self._age, self._past, self._past_id, identity,
            c.weight, ERRORS.index(c.error), c.far, errors, known, clearance,
        )  # fmt: skip
        known &= counted[:, None]
        return Outcome(errors=errors, known=known, clearance=clearance, active=counted), identity

    def _remember(
        self,
        chosen: Ints,
        issued: Floats,
        identity: Ints,
        shift: Floats,
        aims: Floats,
        forecast: Floats,
    ) -> None:
        rows = np.arange(self.n)
        for ring in (self._past, self._past_id, self._issued):
            ring[:, 1:] = ring[:, :-1].copy()
        self._past[:, 0] = forecast
        self._past[:, 0, :, :, 0] += self._place[:, 0, None, None]
        self._past_id[:, 0] = identity
        self._issued[:, 0] = issued
        self._place[:, 0] += shift[rows, chosen]
        self._ego[:, 3:] = aims[rows, chosen]
        self._age += 1

    @staticmethod
    def _check(road: Config) -> None:
        if road.features != _FEATURES or road.absolute:
            raise ValueError(f"road must show {_FEATURES} relative to the ego car, got {road!r}")


def gated(gate: Gate, values: Callable[[NDArray[np.float32]], Floats]) -> Callable:
    """Return the gated policy, from observations to actions."""
    return lambda obs: gate(obs, values(obs))


def _scales(road: Config) -> Floats:
    if not road.normalize:
        return np.ones(5)
    ranges = road.ranges()
    sides = [ranges[name] for name in _FEATURES[1:]]
    if any(low != -high for low, high in sides):
        raise ValueError(f"features_range must be symmetric, got {ranges!r}")
    return np.array([1.0, *(high for _, high in sides)])


def _choose(values: Floats, tolerated: Floats, margin: Floats, config: GateConfig) -> Ints:
    """Return the most liked action that tolerates the margin, else the one that tolerates most."""
    allowed = np.zeros(5, np.bool_)
    allowed[list(config.actions)] = True
    fine = (tolerated >= margin[:, None]) & allowed
    liked = np.where(fine, values, -np.inf)
    safest = np.where(allowed, tolerated, -np.inf)
    # Among equally safe actions the base policy decides.
    best = safest >= safest.max(axis=1, keepdims=True)
    fallback = np.argmax(np.where(best, values, -np.inf), axis=1)
    return np.where(fine.any(axis=1), np.argmax(liked, axis=1), fallback)
