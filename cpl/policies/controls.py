"""Choosers that explain a gain away, or bound it: they know less than the switch, or everything.

Whoever claims that the *information* in a quantile is worth something has to beat those that have
its side effects without it: a clock, a coin, another episode's quantile. The oracles look into the
future by copying the roads and driving on.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cpl.highway import Config, Engine, Policy, nearest_distances
from cpl.highway.proximity import proximity
from cpl.policies.headway import SLOWER
from cpl.policies.switch import Bools, Floats, Moment, switch, thresholds
from cpl.rng import stream

__all__ = [
    "Always",
    "Clock",
    "Coin",
    "LookAhead",
    "OracleCrash",
    "OracleProximity",
    "RandomSwitch",
    "Replay",
    "capped",
    "cruise",
    "slower",
]


class Always:
    """One of the two policies drives, whatever happens.

    Args:
        safe: Which one, a setting each.
        after: The safe one drives before this decision in any case, as in the switch [steps].
    """

    def __init__(self, safe: Sequence[bool], *, after: int = 0) -> None:
        self.safe, self.after = np.asarray(safe, dtype=np.bool_), after

    def __call__(self, moment: Moment) -> Bools:
        """Say where the safe policy drives."""
        return self.safe[moment.setting] | (moment.step < self.after)


class Clock:
    """One policy until a time, then the other: the schedule looks at the clock and at nothing else.

    Args:
        until: Decisions before the change [steps], a setting each.
        safe_first: Whether the safe policy is the first.
    """

    def __init__(self, until: ArrayLike, *, safe_first: bool) -> None:
        self.until, self.safe_first = np.asarray(until), safe_first

    def __call__(self, moment: Moment) -> Bools:
        """Say where the safe policy drives."""
        return (moment.step < self.until[moment.setting]) == self.safe_first


class Coin:
    """A coin is flipped once an episode: the safe policy drives all of it, or none.

    Args:
        share: Chance of the safe policy [-], a setting each.
        episodes: How many there are.
        seed: Of the coin; the same throw decides in all settings.
    """

    def __init__(self, share: ArrayLike, *, episodes: int, seed: int) -> None:
        self.share = _shares(share)
        self.throw = stream(seed, "control", "coin").random(episodes)

    def __call__(self, moment: Moment) -> Bools:
        """Say where the safe policy drives."""
        return self.throw[moment.episode] < self.share[moment.setting]


class RandomSwitch:
    """A coin is flipped every step: the switch's duty cycle without its reasons.

    Args:
        share: Chance of the safe policy in each step [-], a setting each.
        episodes: How many there are.
        steps: The longest episode [steps].
        seed: Of the coins.
    """

    def __init__(self, share: ArrayLike, *, episodes: int, steps: int, seed: int) -> None:
        self.share = _shares(share)
        self.throw = stream(seed, "control", "random").random((episodes, steps))

    def __call__(self, moment: Moment) -> Bools:
        """Say where the safe policy drives."""
        return self.throw[moment.episode, moment.step] < self.share[moment.setting]


class Replay:
    """The switch with uncertainties that were recorded elsewhere, by step, not by what is seen.

    Other episodes' traces ("donor q") keep everything about q but its link to this episode; the
    mean trace keeps only the ramp; a constant one not even that.

    Args:
        q_safe: Thresholds [-], a setting each.
        traces: Uncertainties [-], shape (settings, donors, steps); episode e takes donor
            e modulo their number.

    Raises:
        ValueError: If there is not one trace a setting, or a threshold is refused.
    """

    def __init__(self, q_safe: ArrayLike, traces: ArrayLike) -> None:
        self.q_safe, self.traces = thresholds(q_safe), np.asarray(traces, np.float64)
        if self.traces.ndim != 3 or len(self.traces) != len(self.q_safe):
            raise ValueError(
                f"traces must have shape ({len(self.q_safe)}, donors, steps),"
                f" got {self.traces.shape}"
            )

    def __call__(self, moment: Moment) -> Bools:
        """Say where the safe policy drives."""
        donor = moment.episode % self.traces.shape[1]
        u = self.traces[moment.setting, donor, moment.step]
        return switch(moment.l_hat, u, self.q_safe[moment.setting]) | ~moment.ready


class LookAhead:
    """The true future of every road, if one policy drove it from now on.

    The roads' states are copied into roads of its own and driven on, other cars included: what is
    seen is exactly what would happen.

    Args:
        policy: What drives ahead.
        steps: How far [steps], >= 1.

    Raises:
        ValueError: If it does not look ahead at all.
    """

    def __init__(self, policy: Policy, steps: int) -> None:
        if steps < 1:
            raise ValueError(f"steps must be >= 1, got {steps!r}")
        self.policy, self.steps = policy, steps
        self._roads: Engine | None = None

    def __call__(self, engine: Engine, obs: NDArray[np.float32]) -> tuple[Floats, Bools]:
        """Drive ahead.

        Args:
            engine: The roads; they are not changed.
            obs: Their present observations.

        Returns:
            l_tilde after each step, (steps, n), and whether the ego car has crashed by then.
        """
        if self._roads is None or self._roads.n_envs != engine.n_envs:
            self._roads = Engine(engine.config, engine.n_envs, path=engine.path)
        roads = self._roads
        roads.set_state(engine.state())
        near = np.empty((self.steps, engine.n_envs))
        crashed = np.empty((self.steps, engine.n_envs), dtype=np.bool_)
        for k in range(self.steps):
            out = roads.step(np.asarray(self.policy(obs)))
            obs, crashed[k] = out.obs, out.info.crashed
            near[k] = proximity(nearest_distances(roads))
        return near, crashed


class OracleProximity:
    """The switch with a perfect forecast: the true l_tilde that pi_speed would lead to.

    Args:
        q_safe: Thresholds [-], a setting each.
        policy: pi_speed.
        horizon: How far the forecast looks [steps].
    """

    def __init__(self, q_safe: ArrayLike, policy: Policy, *, horizon: int = 3) -> None:
        self.q_safe, self.ahead = thresholds(q_safe), LookAhead(policy, horizon)

    def __call__(self, moment: Moment) -> Bools:
        """Say where the safe policy drives."""
        near, _ = self.ahead(moment.engine, moment.obs)
        return switch(near[-1], 0.0, self.q_safe[moment.setting]) | ~moment.ready


class OracleCrash:
    """The safe policy drives exactly when pi_speed would crash within a time.

    Args:
        horizon: That time [steps], a setting each.
        policy: pi_speed.
    """

    def __init__(self, horizon: ArrayLike, policy: Policy) -> None:
        self.horizon = np.asarray(horizon, np.int64)
        self.ahead = LookAhead(policy, int(self.horizon.max()))

    def __call__(self, moment: Moment) -> Bools:
        """Say where the safe policy drives."""
        _, crashed = self.ahead(moment.engine, moment.obs)
        until = self.horizon[moment.setting] - 1
        return crashed[until, np.arange(len(until))] | ~moment.ready


def capped(road: Config, top_speed: float) -> Config:
    """Give the ego car a lower speed limit: its levels spread evenly up to another top speed.

    Args:
        road: The road.
        top_speed: The highest level [m/s], above the lowest.

    Examples:
        >>> capped(Config(), 26.0).target_speeds
        (20.0, 23.0, 26.0)
    """
    levels = np.linspace(road.target_speeds[0], top_speed, len(road.target_speeds))
    return replace(road, target_speeds=tuple(levels.tolist()))


def cruise(road: Config, speed: float) -> Config:
    """Give the ego car a lowest level that `slower` then holds: a constant speed.

    Args:
        road: The road.
        speed: The speed that is held [m/s].

    Examples:
        >>> cruise(Config(), 24.0).target_speeds
        (24.0, 25.0)
    """
    return replace(road, target_speeds=(speed, speed + 1.0))


def slower(obs: NDArray[np.float32]) -> NDArray[np.int64]:
    """Choose the lowest speed level on every road, always: a policy that looks at nothing."""
    return np.full(len(obs), SLOWER)


def _shares(share: ArrayLike) -> Floats:
    values = np.atleast_1d(np.asarray(share, np.float64))
    if not ((values >= 0) & (values <= 1)).all():
        raise ValueError(f"share must lie in [0, 1], got {share!r}")
    return values
