"""Driving a batch of roads with a policy: transitions as a generator, episodes as a tidy table."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cpl.highway.config import Config
from cpl.highway.engine import Engine, Step
from cpl.highway.state import State

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["Policy", "Transition", "rollout", "run_episodes"]

Policy = Callable[[NDArray[np.float32]], NDArray[np.integer]]
"""From observations (n, rows, features) to actions (n,)."""


class Transition(NamedTuple):
    """One step of every environment, in the time suffixes of the literature: a_tm1 leads to r_t."""

    obs_tm1: NDArray[np.float32]
    action_tm1: NDArray[np.integer]
    reward_t: NDArray[np.float64]
    obs_t: NDArray[np.float32]
    terminated_t: NDArray[np.bool_]
    truncated_t: NDArray[np.bool_]


def rollout(
    engine: Engine, policy: Policy, seeds: Sequence[int] | NDArray[np.integer] | None = None
) -> Iterator[Transition]:
    """Drive a batch for ever; an environment that ends starts anew before its next step.

    The first episodes are seeded, later ones continue each environment's random numbers, as
    highway-env does. `obs_t` of a last step is the last observation of that episode, never the
    first of the next.

    Args:
        engine: the roads; they are reset first.
        policy: what drives.
        seeds: one for each environment; None continues the engine's random numbers.

    Yields:
        Transitions, arrays that are not written to again.

    Example:
        >>> engine = Engine(Config(vehicles_count=5), 2)
        >>> idle = lambda obs: np.ones(len(obs), dtype=np.int64)
        >>> step = next(rollout(engine, idle, seeds=[0, 1]))
        >>> step.obs_t.shape, step.terminated_t.tolist()
        ((2, 5, 5), [False, False])
    """
    obs = engine.reset(None if seeds is None else np.asarray(seeds, dtype=np.int64))
    while True:
        action = np.asarray(policy(obs))
        out = engine.step(action)
        step = Transition(
            obs_tm1=obs,
            action_tm1=action,
            reward_t=out.reward,
            obs_t=out.obs,
            terminated_t=out.terminated,
            truncated_t=out.truncated,
        )
        yield step
        ended = step.terminated_t | step.truncated_t
        obs = step.obs_t
        if ended.any():
            first = engine.reset(None, ended)
            obs = np.where(ended[:, None, None], first, step.obs_t)


def run_episodes(
    config: Config,
    policy: Policy,
    seeds: Sequence[int] | NDArray[np.integer],
    *,
    n_envs: int = 64,
) -> pd.DataFrame:
    """Drive one episode for each seed.

    Every episode that is begun is finished and counted, so that short episodes are not favoured,
    as they are when the first so many to end are taken.

    Args:
        config: the road.
        policy: what drives; it sees `n_envs` observations at once.
        seeds: the seeds of the resets, one an episode.
        n_envs: episodes driven at a time.

    Returns:
        A row for each seed, in their order: `seed`, `steps`, `duration_s`, `crashed`,
        `episode_mean_speed_mps` (the ego's speed after each step, averaged),
        `mean_speed_before_crash_mps` (the same without the step that ended in a crash; NaN if
        there was no other), `distance_m` (along the road), `overtaken` (cars passed less cars that
        passed the ego) and `episode_return`.

    Raises:
        ValueError: if there is no seed or no environment.

    Example:
        >>> slower = lambda obs: np.full(len(obs), 4)
        >>> table = run_episodes(Config(vehicles_count=5, duration=10), slower, [0, 1, 2])
        >>> table.duration_s.tolist(), table.crashed.any()
        ([10.0, 10.0, 10.0], np.False_)
    """
    import pandas as pd

    todo = np.asarray(seeds, dtype=np.int64)
    if todo.ndim != 1 or len(todo) == 0:
        raise ValueError(f"seeds must be a list of at least one seed, got {seeds!r}")
    if n_envs < 1:
        raise ValueError(f"n_envs must be at least 1, got {n_envs}")
    engine = Engine(config, min(n_envs, len(todo)))
    slots = np.arange(engine.n_envs)  # which episode each environment drives
    rows: dict[int, dict[str, object]] = {}
    obs = engine.reset(todo[slots])
    tally = _Tally(engine)
    following = engine.n_envs
    while len(rows) < len(todo):
        out = engine.step(np.asarray(policy(obs)))
        obs = out.obs
        tally.add(out)
        ended = np.flatnonzero((out.terminated | out.truncated) & (slots >= 0))
        if not len(ended):
            continue
        state = engine.state()
        for e in ended.tolist():
            rows[int(slots[e])] = {"seed": int(todo[slots[e]]), **tally.row(e, out, state)}
        slots[ended] = -1  # it drives on, uncounted, unless an episode is left
        again = np.zeros(engine.n_envs, dtype=np.bool_)
        again[ended[: len(todo) - following]] = True
        if again.any():
            slots[again] = following + np.arange(again.sum())
            following += int(again.sum())
            first = engine.reset(np.where(again, todo[slots], 0), again)
            obs = np.where(again[:, None, None], first, obs)
            tally.begin(again)
    return pd.DataFrame([rows[number] for number in range(len(todo))])


class _Tally:
    """Sums over each environment's present episode."""

    def __init__(self, engine: Engine) -> None:
        self._engine = engine
        self._steps = np.zeros(engine.n_envs, dtype=np.int64)
        self._speed_sum = np.zeros(engine.n_envs)
        self._reward_sum = np.zeros(engine.n_envs)
        self._first = engine.state()

    def begin(self, chosen: NDArray[np.bool_]) -> None:
        for total in (self._steps, self._speed_sum, self._reward_sum):
            total[chosen] = 0
        state = self._engine.state()
        self._first = replace(self._first, x=np.where(chosen[:, None], state.x, self._first.x))

    def add(self, out: Step) -> None:
        self._steps += 1
        self._speed_sum += out.info.speed
        self._reward_sum += out.reward

    def row(self, e: int, out: Step, state: State) -> dict[str, object]:
        steps, speed_sum = int(self._steps[e]), float(self._speed_sum[e])
        crashed = bool(out.info.crashed[e])
        counted = steps - crashed
        before = (speed_sum - out.info.speed[e] * crashed) / counted if counted else np.nan
        ahead_first = self._first.x[e, 1:] > self._first.x[e, 0]
        ahead_last = state.x[e, 1:] > state.x[e, 0]
        return {
            "steps": steps,
            "duration_s": steps / self._engine.config.policy_frequency,
            "crashed": crashed,
            "episode_mean_speed_mps": speed_sum / steps,
            "mean_speed_before_crash_mps": float(before),
            "distance_m": float(state.x[e, 0] - self._first.x[e, 0]),
            "overtaken": int(ahead_first.sum() - ahead_last.sum()),
            "episode_return": float(self._reward_sum[e]),
        }
