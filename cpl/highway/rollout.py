"""Driving a batch of roads with a policy: transitions as a generator, episodes as a tidy table."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cpl.highway.config import Config
from cpl.highway.engine import Engine, Step
from cpl.highway.episodes import Decision, Plan, Turn, episodes
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
    numbers = None if seeds is None else np.asarray(seeds, dtype=np.int64)
    for turn in episodes(engine, lambda now: np.asarray(policy(now.obs)), numbers):
        out = turn.out
        yield Transition(
            obs_tm1=turn.obs_tm1,
            action_tm1=turn.action_tm1,
            reward_t=out.reward,
            obs_t=out.obs,
            terminated_t=out.terminated,
            truncated_t=out.truncated,
        )


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
    plan = Plan(len(todo), n_envs)
    engine = Engine(config, plan.roads)
    tally = _Tally(engine)

    def act(now: Decision) -> NDArray[np.integer]:
        tally.begin(now.began)
        return np.asarray(policy(now.obs))

    rows: dict[int, dict[str, object]] = {}
    for turn in episodes(engine, act, todo, plan):
        tally.add(turn.out)
        if turn.ended.any():
            state = engine.state()
            for road in np.flatnonzero(turn.ended).tolist():
                episode = int(plan.episode[road])
                rows[episode] = {"seed": int(todo[episode]), **tally.row(road, turn, state)}
    return pd.DataFrame([rows[episode] for episode in range(len(todo))])


class _Tally:
    """Sums over each environment's present episode."""

    def __init__(self, engine: Engine) -> None:
        self._engine = engine
        self._speed_sum = np.zeros(engine.n_envs)
        self._reward_sum = np.zeros(engine.n_envs)
        self._first = engine.state().x

    def begin(self, began: NDArray[np.bool_]) -> None:
        if began.any():
            self._speed_sum[began] = self._reward_sum[began] = 0
            self._first = np.where(began[:, None], self._engine.state().x, self._first)

    def add(self, out: Step) -> None:
        self._speed_sum += out.info.speed
        self._reward_sum += out.reward

    def row(self, e: int, turn: Turn, state: State) -> dict[str, object]:
        info = turn.out.info
        steps, speed_sum = int(turn.step[e]), float(self._speed_sum[e])
        crashed = bool(info.crashed[e])
        counted = steps - crashed
        before = (speed_sum - info.speed[e] * crashed) / counted if counted else np.nan
        first, last = self._first[e], state.x[e]
        return {
            "steps": steps,
            "duration_s": steps / self._engine.config.policy_frequency,
            "crashed": crashed,
            "episode_mean_speed_mps": speed_sum / steps,
            "mean_speed_before_crash_mps": float(before),
            "distance_m": float(last[0] - first[0]),
            "overtaken": int((first[1:] > first[0]).sum() - (last[1:] > last[0]).sum()),
            "episode_return": float(self._reward_sum[e]),
        }
