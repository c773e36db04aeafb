"""Rollouts to learn from: driven in a batch, kept in float32, read as histories without copying."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields
from typing import Literal

import numpy as np
from numpy.lib.stride_tricks import as_strided
from numpy.typing import NDArray

from cpl.forecast.errors import NoRolloutsError
from cpl.highway import Config, Decision, Engine, Plan, Policy, episodes, nearest_distances
from cpl.highway.proximity import proximity

__all__ = ["Rollouts", "collect", "join"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Rollouts:
    """E episodes of at most T steps; what lies behind an episode's end is zero.

    Attributes:
        obs: observations, float32 (E, T + 1, width); the first is that of the reset.
        l_tilde: squashed distance to the nearest car at each of them, float32 (E, T + 1).
        speed: the ego car's speed [m/s], float32 (E, T + 1); NaN at the reset.
        steps: decisions taken, int64 (E,); observations 0 .. steps are there.
        crashed: whether the last decision ended in a crash, bool (E,).
        policy: which policy drove, int64 (E,).
    """

    obs: NDArray[np.float32]
    l_tilde: NDArray[np.float32]
    speed: NDArray[np.float32]
    steps: NDArray[np.int64]
    crashed: NDArray[np.bool_]
    policy: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.steps)

    def histories(self, length: int) -> NDArray[np.float32]:
        """View all runs of `length` observations, without copying.

        Args:
            length: observations in a history.

        Returns:
            Float32 (E (T + 1) - length + 1, length * width), read-only: row r - length + 1 is the
            history that ends with observation r, counted through all episodes.
        """
        flat = self.obs.reshape(-1, self.obs.shape[2])
        count, width = flat.shape
        return as_strided(
            flat,
            (count - length + 1, length * width),
            (flat.strides[0], flat.strides[1]),
            writeable=False,
        )

    def moments(
        self, *, length: int, horizon: int, episodes: NDArray[np.bool_] | None = None
    ) -> NDArray[np.int64]:
        """Number the observations at which a forecast is made and later checked.

        Args:
            length: observations that a forecast needs.
            horizon: steps ahead that it looks; 0 asks for every moment with a history.
            episodes: bool (E,), whose; all unless given.

        Returns:
            Places r in the flattened observations, in order.

        Raises:
            NoRolloutsError: if there is none.
        """
        time = np.arange(self.obs.shape[1])
        fine = (time >= length - 1) & (time + horizon <= self.steps[:, None])
        if episodes is not None:
            fine &= episodes[:, None]
        found = np.flatnonzero(fine)
        if not len(found):
            raise NoRolloutsError(
                f"rollouts must have an episode of {length + horizon - 1} steps, got {len(self)}"
                f" episodes of at most {self.steps.max(initial=0)}"
            )
        return found


def collect(
    road: Config,
    policy: Policy,
    seeds: Sequence[int] | NDArray[np.integer],
    *,
    number: int = 0,
    n_envs: int = 256,
    cars: Literal["all", "observed"] = "all",
) -> Rollouts:
    """Drive one episode a seed, in a batch, and keep what a forecaster learns from.

    Args:
        road: the road.
        policy: what drives: observations (n, rows, features) to actions (n,).
        seeds: environment seeds, one an episode.
        number: what to call the policy in the result.
        n_envs: episodes driven at a time [-]; the result does not depend on it.
        cars: whose distance is forecast; see `cpl.highway.nearest_distances`.

    Returns:
        The rollouts, in the order of the seeds.

    Raises:
        NoRolloutsError: if there is no seed.
    """
    todo = np.asarray(seeds, np.int64)
    if todo.ndim != 1 or not len(todo):
        raise NoRolloutsError(f"seeds must name at least one episode, got {seeds!r}")
    plan = Plan(len(todo), n_envs)
    engine = Engine(road, plan.roads)
    kept = _empty(road, len(todo), number)

    def keep(which: NDArray[np.bool_], step: NDArray[np.int64], obs: NDArray[np.float32]) -> None:
        at = plan.episode[which], step[which]
        kept.obs[at] = obs[which].reshape(len(at[0]), -1)
        kept.l_tilde[at] = proximity(nearest_distances(engine, cars)[which])

    def act(now: Decision) -> NDArray[np.integer]:
        if now.began.any():
            keep(now.began, now.step, now.obs)
        return policy(now.obs)

    for turn in episodes(engine, act, todo, plan):
        out, active, ended = turn.out, turn.active, plan.episode[turn.ended]
        keep(active, turn.step, out.obs)
        kept.speed[plan.episode[active], turn.step[active]] = out.info.speed[active]
        kept.steps[ended] = turn.step[turn.ended]
        kept.crashed[ended] = out.terminated[turn.ended]
    return kept


def join(parts: Iterable[Rollouts]) -> Rollouts:
    """Put rollouts of the same road behind each other.

    Raises:
        NoRolloutsError: if there are none.
    """
    each = list(parts)
    if not each:
        raise NoRolloutsError("parts must hold at least one set of rollouts, got none")
    names = [field.name for field in fields(Rollouts)]
    return Rollouts(**{name: np.concatenate([getattr(p, name) for p in each]) for name in names})


def _empty(road: Config, episodes: int, number: int) -> Rollouts:
    longest = int(np.ceil(road.duration * road.policy_frequency)) + 1
    width = road.observation_vehicles_count * len(road.features)
    speed = np.zeros((episodes, longest), np.float32)
    speed[:, 0] = np.nan
    return Rollouts(
        obs=np.zeros((episodes, longest, width), np.float32),
        l_tilde=np.zeros((episodes, longest), np.float32),
        speed=speed,
        steps=np.zeros(episodes, np.int64),
        crashed=np.zeros(episodes, np.bool_),
        policy=np.full(episodes, number, np.int64),
    )
