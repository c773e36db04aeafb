"""Worlds that streams of episodes pass through without notice, and how they are driven there."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import islice
from typing import Any, Protocol

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from cpl.highway import PAPER, Config, Engine, Info, Plan, Step, Turn, episodes
from cpl.policies.gate import Gate, Sight
from cpl.rng import stream

__all__ = ["WORLDS", "Driver", "Gated", "Roads", "World", "drive", "schedule", "turns"]

Bools = NDArray[np.bool_]
Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True, kw_only=True)
class World:
    """What is different from the paper's road.

    Attributes:
        top_speed: Upper end of the ego car's speed levels [m/s]; the lower is 20.
        changes: Settings of the road.
        braking: Chance in each decision that the car ahead begins to brake hard [-].
        burst: Noise that comes and goes within an episode, as `observation_noise`; 0 for none.
    """

    top_speed: float = 30.0
    changes: Mapping[str, Any] = field(default_factory=dict)
    braking: float = 0.0
    burst: float = 0.0

    @property
    def road(self) -> Config:
        """The road's settings."""
        levels = tuple(np.linspace(20.0, self.top_speed, 3).tolist())
        return replace(PAPER, target_speeds=levels, **self.changes)


_AGGRESSIVE = {
    "other_speed_range": (21.0, 28.0),
    "time_wanted": 0.6,
    "distance_wanted": 7.0,
    "comfort_acc_max": 6.0,
    "lane_change_min_acc_gain": 0.05,
    "lane_change_max_braking_imposed": 6.0,
    "lane_change_delay": 0.5,
}

WORLDS: dict[str, World] = {
    "in": World(),
    "to40": World(top_speed=40.0),
    "to50": World(top_speed=50.0),
    "noise": World(changes={"observation_noise": 0.02}),
    "dropout": World(changes={"observation_dropout": 0.3}),
    "braking": World(braking=0.2),
    "aggressive": World(changes=_AGGRESSIVE),
    "dense": World(changes={"vehicles_density": 1.3}),
    "bursts": World(burst=0.02),
}
"""By name; only `bursts` is left out of the changing stream: it changes within an episode."""

_BRAKED = 5.0  # [m/s] what a braking car slows down to
_BRAKES = 3  # [decisions] for how long it wants to
_BURST = (10, 15)  # [decisions] of silence, then of noise


def schedule(worlds: Sequence[str], streams: int, stay: int, seed: int) -> NDArray[np.str_]:
    """Say which world each stream is in, round by round: all worlds equally often at any time.

    Args:
        worlds: Their names.
        streams: Streams, a multiple of the number of worlds.
        stay: Episodes that a stream stays in a world.
        seed: Of the order.

    Returns:
        Names, (streams, rounds) with a visit of `stay` rounds to each world.

    Raises:
        ValueError: If the streams cannot be dealt evenly.
    """
    count = len(worlds)
    if count < 1 or streams % count or stay < 1:
        raise ValueError(f"streams must be a multiple of {count} worlds, got {streams}")
    rng = stream(seed, "gate", "schedule", *worlds)
    square = np.add.outer(np.arange(count), np.arange(count)) % count
    groups = []
    for _ in range(streams // count):
        mixed = square[rng.permutation(count)][:, rng.permutation(count)]
        groups.append(rng.permutation(count)[mixed])
    return np.array(worlds)[np.repeat(np.concatenate(groups), stay, axis=1)]


class Roads:
    """The roads of one round: each row drives in its stream's world."""

    def __init__(self, worlds: NDArray[np.str_], seeds: Ints) -> None:
        self.worlds, self.n_envs = worlds, len(worlds)
        self.parts: list[tuple[World, Ints, Engine]] = []
        self.levels = np.empty((self.n_envs, 3))
        for name in sorted(set(worlds.tolist())):
            rows, world = np.flatnonzero(worlds == name), WORLDS[name]
            self.levels[rows] = world.road.target_speeds
            self.parts.append((world, rows, Engine(world.road, rows.size)))
        self.step_number = 0
        self._seeds = seeds
        self._until: dict[int, Any] = {}

    def reset(self, seeds: Ints | None = None, mask: Bools | None = None) -> NDArray[np.float32]:
        """Begin the round's episodes, all at once and with its own seeds."""
        if seeds is not None or mask is not None:
            raise ValueError(f"a round begins whole, got seeds {seeds!r} and mask {mask!r}")
        obs = np.empty((self.n_envs, 5, 5), np.float32)
        for k, (world, rows, engine) in enumerate(self.parts):
            obs[rows] = engine.reset(self._seeds[rows])
            if world.braking:
                cars = engine.config.vehicles_count + 1
                self._until[k] = np.zeros((rows.size, cars), np.int64), engine.state().target_speed
        return self._noisy(obs)

    def step(self, actions: NDArray[np.integer]) -> Step:
        """Take one decision; only a crash ends an episode."""
        outs: list[Step] = []
        for k, (world, rows, engine) in enumerate(self.parts):
            if world.braking:
                self._brake(k, world, rows, engine)
            outs.append(engine.step(actions[rows]))
        self.step_number += 1
        info = Info(
            *(self._joined(values) for values in zip(*(out.info for out in outs), strict=True))
        )
        return Step(
            obs=self._noisy(self._joined([out.obs for out in outs])),
            reward=self._joined([out.reward for out in outs]),
            terminated=info.crashed,
            truncated=np.zeros(self.n_envs, np.bool_),
            info=info,
        )

    def _joined(self, values: Sequence[NDArray[Any]]) -> NDArray[Any]:
        """Put what the worlds say into the order of the rows."""
        joined = np.empty((self.n_envs, *values[0].shape[1:]), values[0].dtype)
        for (_, rows, _), value in zip(self.parts, values, strict=True):
            joined[rows] = value
        return joined

    def _uniform(self, rows: Ints, name: str, size: int) -> Floats:
        """Numbers that depend on seed and step, not on who drives."""
        out = np.empty((rows.size, size))
        cache: dict[int, Floats] = {}
        for i, seed in enumerate(self._seeds[rows].tolist()):
            if seed not in cache:
                cache[seed] = _table(seed, name, size)[self.step_number]
            out[i] = cache[seed]
        return out

    def _brake(self, k: int, world: World, rows: Ints, engine: Engine) -> None:
        """Let the car ahead of the ego car brake hard, and those that have braked drive on."""
        until, wish = self._until[k]
        state = engine.state()
        begins = self._uniform(rows, "braking", 1)[:, 0] < world.braking
        dx = state.x[:, 1:] - state.x[:, :1]
        ahead = (dx > 8.0) & (state.lane[:, 1:] == state.lane[:, :1]) & (dx < 80.0)
        nearest = np.argmin(np.where(ahead, dx, np.inf), axis=1)
        chosen = np.flatnonzero(begins & ahead.any(axis=1))
        until[chosen, nearest[chosen] + 1] = self.step_number + _BRAKES
        brakes = until > self.step_number
        target = np.where(brakes, _BRAKED, wish)
        target[:, 0] = state.target_speed[:, 0]
        if (target != state.target_speed).any():
            engine.set_state(replace(state, target_speed=target))

    def _noisy(self, obs: NDArray[np.float32]) -> NDArray[np.float32]:
        quiet, loud = _BURST
        for world, rows, _ in self.parts:
            if world.burst and self.step_number % (quiet + loud) >= quiet:
                u = self._uniform(rows, "burst", 32)
                normal = np.sqrt(-2 * np.log1p(-u[:, :16])) * np.cos(2 * np.pi * u[:, 16:])
                noisy = obs[rows, 1:, 1:] + world.burst * normal.reshape(-1, 4, 4)
                seen = obs[rows, 1:, :1] > 0.5
                obs[rows, 1:, 1:] = np.where(seen, np.clip(noisy, -1, 1), obs[rows, 1:, 1:])
        return obs


_TABLES: dict[tuple[int, str], Floats] = {}


def _table(seed: int, name: str, size: int) -> Floats:
    """An episode's random numbers, (41, size)."""
    if (seed, name) not in _TABLES:
        if len(_TABLES) > 4096:
            _TABLES.clear()
        _TABLES[seed, name] = stream(seed, "gate", name).random((41, size))
    return _TABLES[seed, name]


class Driver(Protocol):
    """What drives some rows: `names` says how they are called, each has all streams."""

    names: Sequence[str]

    def begin(self, roads: Roads, rows: slice) -> None:
        """Begin a round."""
        ...

    def act(self, obs: NDArray[np.float32], active: Bools, roads: Roads, rows: slice) -> Ints:
        """Choose."""
        ...


class Gated:
    """A gate behind a base policy.

    Args:
        names: One a block of streams.
        gate: For all their rows.
        values: The base policy's values, from observations.
    """

    def __init__(self, names: Sequence[str], gate: Gate, values: Any) -> None:  # noqa: ANN401
        self.names, self.gate, self.values = names, gate, values
        self.margins: list[Floats] | None = None

    def begin(self, roads: Roads, rows: slice) -> None:
        """Begin a round: nothing is under way, what was learned is kept."""
        self.gate.begin(levels=roads.levels[rows])

    def act(self, obs: NDArray[np.float32], active: Bools, roads: Roads, rows: slice) -> Ints:
        """Choose, and record the margin if asked to."""
        chosen = self.gate(obs, self.values(obs), active)
        if self.margins is not None and self.gate.sight is not None:
            self.margins.append(self.gate.sight.margin.copy())
        return chosen

    @property
    def sight(self) -> Sight | None:
        """What the gate knew at its last decision."""
        return self.gate.sight


def turns(
    roads: Roads, act: Callable[[NDArray[np.float32], Bools], NDArray[np.integer]], steps: int
) -> Iterator[Turn]:
    """Drive a round: one episode a row, at most so many decisions.

    Args:
        roads: The round's roads.
        act: From observations (n, 5, 5) and which rows still drive (n,) to actions (n,).
        steps: Decisions of an episode that does not crash.
    """
    plan = Plan(roads.n_envs, roads.n_envs)
    return islice(episodes(roads, lambda now: act(now.obs, plan.active), None, plan), steps)


_SUMS = ("speed_sum", "margin_sum", "scored", "missed", "changed", "error_sum")


def drive(
    drivers: Sequence[Driver],
    worlds: NDArray[np.str_],
    *,
    first_seed: int,
    steps: int = 40,
) -> pd.DataFrame:
    """Drive every stream through its worlds with every driver.

    Args:
        drivers: Who drives; each has a block of rows for each of its names.
        worlds: By stream and round, from `schedule`.
        first_seed: Environment seed of stream 0 in round 0; the same for all drivers.
        steps: Decisions of an episode.

    Returns:
        One row an episode: `method`, `stream`, `round`, `world`, `steps`, `crashed`, `speed_sum`
        [m/s, over steps], `margin_sum` [m], `scored`, `missed`, `changed` (decisions that are not
        what the base policy likes best), `error_sum` [m].
    """
    streams, rounds = worlds.shape
    names = [name for driver in drivers for name in driver.names]
    ends = np.cumsum([len(driver.names) * streams for driver in drivers]).tolist()
    blocks = [slice(first, stop) for first, stop in zip([0, *ends], ends, strict=False)]
    tables = []
    for r in range(rounds):
        here = np.tile(worlds[:, r], len(names))
        seeds = np.tile(first_seed + r * streams + np.arange(streams), len(names))
        total = _round(list(zip(drivers, blocks, strict=True)), Roads(here, seeds), steps)
        tables.append(
            pd.DataFrame(
                {
                    "method": np.repeat(names, streams),
                    "stream": np.tile(np.arange(streams), len(names)).astype(np.int16),
                    "round": np.int16(r),
                    "world": here,
                    "steps": total.pop("steps").astype(np.int8),
                    "crashed": total.pop("crashed").astype(np.bool_),
                    **{
                        name: values.astype(np.float32 if name.endswith("sum") else np.int8)
                        for name, values in total.items()
                    },
                }
            )
        )
    return pd.concat(tables, ignore_index=True)


def _round(blocks: list[tuple[Driver, slice]], roads: Roads, steps: int) -> dict[str, Floats]:
    """Return sums over the episodes of a round."""
    total = {name: np.zeros(roads.n_envs) for name in (*_SUMS, "steps", "crashed")}
    for driver, block in blocks:
        driver.begin(roads, block)

    def act(obs: NDArray[np.float32], active: Bools) -> Ints:
        actions = np.empty(len(obs), np.int64)
        for driver, block in blocks:
            actions[block] = driver.act(obs[block], active[block], roads, block)
            _note(total, block, active[block], getattr(driver, "sight", None))
        return actions

    for turn in turns(roads, act, steps):
        total["speed_sum"] += turn.active * turn.out.info.speed
        total["steps"] += turn.active
        total["crashed"] += turn.ended
    return total


def _note(total: dict[str, Floats], block: slice, active: Bools, sight: Sight | None) -> None:
    if sight is None:
        return
    total["margin_sum"][block] += active * sight.margin
    total["scored"][block] += sight.scored
    total["missed"][block] += sight.missed
    total["changed"][block] += active * sight.changed
    total["error_sum"][block] += sight.scored * sight.outcome.errors[:, -1]
