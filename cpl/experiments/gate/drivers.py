"""Who else drives the streams: without a gate, by the clock, by a coin, or knowing the future."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields, replace

import numpy as np
from numpy.typing import NDArray

from cpl.conformal import BatchTracker, Fixed, Rule
from cpl.experiments.gate.streams import Bools, Floats, Ints, Roads
from cpl.highway import Config, Engine, State
from cpl.highway.proximity import proximity
from cpl.policies.headway import FASTER, SLOWER
from cpl.rng import stream

__all__ = ["Capped", "Foresight", "Plain", "Scheduled", "Switching"]

Obs = NDArray[np.float32]
Values = Callable[[Obs], NDArray[np.floating]]

_HORIZON = 3  # [decisions]
_PAPER = Fixed(eta=0.1)


class Plain:
    """A base policy and nothing else."""

    def __init__(self, name: str, values: Values) -> None:
        self.names, self.values = (name,), values

    def begin(self, roads: Roads, rows: slice) -> None:
        """Nothing is remembered."""

    def act(self, obs: Obs, active: Bools, roads: Roads, rows: slice) -> Ints:
        """Take the best-liked action."""
        return np.asarray(self.values(obs)).argmax(axis=1)


class Capped:
    """A base policy that may not go faster than a cap: the nearest trivial remedy.

    Args:
        name: What it is called.
        values: The base policy's.
        cap: The cap [m/s]; speed levels above it are not chosen.
    """

    def __init__(self, name: str, values: Values, cap: float) -> None:
        self.names, self.values, self.cap = (name,), values, cap

    def begin(self, roads: Roads, rows: slice) -> None:
        """Nothing is remembered."""

    def act(self, obs: Obs, active: Bools, roads: Roads, rows: slice) -> Ints:
        """Take the best-liked action that keeps to the cap, or slow down to it."""
        levels, speed = roads.levels[rows], 80.0 * obs[:, 0, 3].astype(np.float64)
        now = np.abs(levels - speed[:, None]).argmin(axis=1)
        above = np.minimum(now + 1, levels.shape[1] - 1)
        values = np.array(self.values(obs), np.float64)
        each = np.arange(len(values))
        values[levels[each, above] > self.cap, FASTER] = -np.inf
        chosen = values.argmax(axis=1)
        return np.where((levels[each, now] > self.cap) & (now > 0), SLOWER, chosen)


class Scheduled:
    """The safe policy drives where a schedule says so, by time or by a coin; the other elsewhere.

    Args:
        name: What it is called.
        safe: The safe policy's values.
        speed: The other's.
        until: Decisions that the safe one begins with; None for a coin an episode.
        share: The coin's chance of the safe one.
    """

    def __init__(
        self, name: str, safe: Values, speed: Values, *, until: int | None, share: float = 0.0
    ) -> None:
        self.names, self.safe, self.speed = (name,), safe, speed
        self.until, self.share = until, share
        self._coin, self._rounds = np.zeros(0, np.bool_), 0

    def begin(self, roads: Roads, rows: slice) -> None:
        """Throw the coins."""
        throw = stream(self._rounds, "gate", "coin").random(rows.stop - rows.start)
        self._coin = throw < self.share
        self._rounds += 1

    def act(self, obs: Obs, active: Bools, roads: Roads, rows: slice) -> Ints:
        """Ask whom the schedule names."""
        if self.until is None:
            slow = self._coin
        else:
            slow = np.full(len(obs), roads.step_number < self.until)
        a, b = (np.asarray(values(obs)).argmax(axis=1) for values in (self.safe, self.speed))
        return np.where(slow, a, b)


class Switching:
    r"""The paper's switch, with the distance that is seen now as its forecast.

    $$ \text{safe where } \hat l + q > q_{safe} $$

    Paper: Section IV. The forecast is persistence (no network), the score |l~ - l^|, the step a
    constant; the quantile is carried over between episodes.

    Args:
        name: What it is called.
        safe: The safe policy's values.
        speed: The other's.
        n: Rows.
        q_safe: The switch's threshold.
        alpha: Miscoverage aimed at.
        rule: What tracks the quantile, the paper's unless given; None for no quantile, q = 0.
    """

    def __init__(
        self,
        name: str,
        safe: Values,
        speed: Values,
        n: int,
        *,
        q_safe: float,
        alpha: float = 0.1,
        rule: Rule | None = _PAPER,
    ) -> None:
        self.names, self.safe, self.speed, self.q_safe = (name,), safe, speed, q_safe
        self.tracker = None if rule is None else BatchTracker(rule, n, alpha=alpha)
        self._zero = np.zeros(n)
        self._past: list[tuple[Floats, Floats]] = []

    def begin(self, roads: Roads, rows: slice) -> None:
        """Forget what is under way."""
        self._past = []

    def act(self, obs: Obs, active: Bools, roads: Roads, rows: slice) -> Ints:
        """Score what is known, and switch."""
        cars = obs[:, 1:]
        apart = np.hypot(200.0 * cars[..., 1], 16.0 * cars[..., 2])
        nearest = np.where(cars[..., 0] > 0.5, apart, 200.0).min(axis=1)
        l_tilde = np.asarray(proximity(nearest.astype(np.float64)), np.float64)
        if self.tracker is not None and len(self._past) == _HORIZON:
            forecast, met = self._past.pop(0)
            self.tracker.feedback(np.abs(l_tilde - forecast), met, active)
        q = self._zero if self.tracker is None else self.tracker.q
        self._past.append((l_tilde, q))
        a, b = (np.asarray(values(obs)).argmax(axis=1) for values in (self.safe, self.speed))
        return np.where(l_tilde + q > self.q_safe, a, b)


class Foresight:
    """The gate with the true future in place of a forecast, and no margin: how far one could come.

    Each action's plan is driven ahead in copies of the roads, all other cars reacting as they will.

    Args:
        name: What it is called.
        values: The base policy's.
        horizon: How far [decisions].
    """

    def __init__(self, name: str, values: Values, horizon: int = _HORIZON) -> None:
        self.names, self.values, self.horizon = (name,), values, horizon
        self._copies: dict[tuple[Config, int], Engine] = {}

    def begin(self, roads: Roads, rows: slice) -> None:
        """Nothing is remembered."""

    def act(self, obs: Obs, active: Bools, roads: Roads, rows: slice) -> Ints:
        """Take the best-liked action whose plan does not crash, else the one that does so last."""
        liked = np.asarray(self.values(obs), np.float64)
        chosen = liked.argmax(axis=1)
        for _, where, engine in roads.parts:
            inside = (where >= rows.start) & (where < rows.stop)
            mine = where[inside] - rows.start
            if mine.size:
                safe_for = self._ahead(engine, np.flatnonzero(inside))
                values, fine = liked[mine], safe_for >= self.horizon
                best = np.where(fine, values, -np.inf).argmax(axis=1)
                late = safe_for == safe_for.max(axis=1, keepdims=True)
                last = np.where(late, values, -np.inf).argmax(axis=1)
                chosen[mine] = np.where(fine.any(axis=1), best, last)
        return chosen

    def _ahead(self, engine: Engine, places: Ints) -> Floats:
        """Decisions that each action's plan goes without a crash, (rows, 5)."""
        state, count = engine.state(), places.size
        five = np.repeat(places, 5)
        copied = State(**{f.name: getattr(state, f.name)[five] for f in fields(State)})
        road = replace(engine.config, observation_noise=0.0, observation_dropout=0.0)
        if (road, five.size) not in self._copies:
            self._copies[road, five.size] = Engine(road, five.size)
        copy = self._copies[road, five.size]
        copy.set_state(copied)
        actions, lasted = np.tile(np.arange(5), count), np.zeros(five.size)
        for _ in range(self.horizon):
            out = copy.step(actions)
            lasted += ~out.info.crashed
            actions = np.full(five.size, SLOWER)
        return lasted.reshape(count, 5)
