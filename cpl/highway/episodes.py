"""The loop that drives episodes on a batch of roads, and which road drives which of them."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from cpl.highway.engine import Step

__all__ = ["Batch", "Decision", "Plan", "Turn", "episodes"]

Bools = NDArray[np.bool_]
Ints = NDArray[np.int64]
Singles = NDArray[np.float32]


class Batch(Protocol):
    """What episodes are driven on: an `Engine`, or something that steps like one."""

    @property
    def n_envs(self) -> int:
        """How many roads there are."""
        ...

    def reset(self, seeds: Ints | None, mask: Bools | None = None) -> Singles:
        """Begin anew where `mask` says, and return all observations."""
        ...

    def step(self, actions: NDArray[np.integer]) -> Step:
        """Take one decision on every road."""
        ...


class Decision(NamedTuple):
    """What there is to act on.

    Attributes:
        obs: Observations, float32 (n, rows, features).
        step: Decisions taken before in the episode of each road, (n,).
        began: On which roads an episode begins with this observation, (n,).
    """

    obs: Singles
    step: Ints
    began: Bools


class Turn(NamedTuple):
    """What a decision led to.

    Attributes:
        obs_tm1: Observations before it, float32 (n, rows, features).
        action_tm1: What was chosen, (n,).
        out: What the roads returned; `out.obs` is the last observation of an episode that ended.
        step: Decisions taken in the episode of each road, this one included, (n,).
        active: Which roads drove an episode; the others drive on, uncounted, (n,).
        ended: Where one ended, (n,).
    """

    obs_tm1: Singles
    action_tm1: NDArray[np.integer]
    out: Step
    step: Ints
    active: Bools
    ended: Bools


class Plan:
    """Which road drives which episode of which setting, and what comes after it.

    Streams keep to their road, in the order of the episodes; else the next episode goes to the
    next road that is free. Every episode that is begun is finished, so that short ones are not
    favoured, as they are when the first so many to end are taken.

    Args:
        episodes: How many, the same in every setting.
        roads: How many roads at most; as many as there are streams if those are given.
        settings: How many settings.
        streams: How many streams the episodes of a setting are dealt to; none if None.

    Attributes:
        roads: How many roads are needed.
        setting: The setting that each road drives, (roads,).
        episode: The number of the episode that each road drives, (roads,).
        active: Which roads have an episode, (roads,).

    Examples:
        >>> plan = Plan(3, 2)
        >>> again = plan.next(np.array([True, True]))
        >>> plan.episode.tolist(), plan.active.tolist()
        ([2, 1], [True, False])
    """

    def __init__(
        self, episodes: int, roads: int, *, settings: int = 1, streams: int | None = None
    ) -> None:
        jobs = [(k, e) for e in range(episodes) for k in range(settings)]
        if streams is None:
            self.roads = min(roads, len(jobs))
            queues = [deque(jobs)] * self.roads  # one queue for all
        else:
            streams = min(streams, episodes)
            self.roads = settings * streams
            queues = [deque[tuple[int, int]]() for _ in range(self.roads)]
            for k, e in jobs:
                queues[k * streams + e % streams].append((k, e))
        self._queues = queues
        self.setting = np.zeros(self.roads, dtype=np.int64)
        self.episode = np.zeros(self.roads, dtype=np.int64)
        self.active = np.ones(self.roads, dtype=np.bool_)
        self.next(self.active)

    def next(self, ended: Bools) -> Bools:
        """Hand out the next episodes; return which roads got one."""
        again = np.zeros(self.roads, dtype=np.bool_)
        for road in np.flatnonzero(ended).tolist():
            if self._queues[road]:
                self.setting[road], self.episode[road] = self._queues[road].popleft()
                again[road] = True
        self.active = self.active & (~ended | again)
        return again


def episodes(
    roads: Batch,
    act: Callable[[Decision], NDArray[np.integer]],
    seeds: Ints | None,
    plan: Plan | None = None,
) -> Iterator[Turn]:
    """Drive episodes on a batch of roads; where one ends, the next begins before the next decision.

    Args:
        roads: The roads; they are reset first.
        act: Called once a decision, for all roads.
        seeds: With a plan, one for each of its episodes; without, one for each road or None, which
            continues the roads' random numbers.
        plan: Who drives what. Without one it goes on for ever, each later episode with the random
            numbers of its road going on, as in highway-env.

    Yields:
        Each turn, before the roads whose episode has ended begin the next one.
    """
    obs = roads.reset(seeds if plan is None or seeds is None else seeds[plan.episode])
    step = np.zeros(roads.n_envs, dtype=np.int64)
    began = active = np.ones(roads.n_envs, dtype=np.bool_)
    while active.any():
        action = act(Decision(obs, step, began))
        out = roads.step(action)
        step = step + active  # a road without an episode stands still
        ended = (out.terminated | out.truncated) & active
        yield Turn(obs, action, out, step, active, ended)
        obs = out.obs
        began = ended if plan is None else plan.next(ended)
        active = active if plan is None else plan.active
        if began.any():
            wanted = None
            if plan is not None and seeds is not None:
                wanted = np.where(began, seeds[plan.episode], 0)
            first = roads.reset(wanted, began)
            obs = np.where(began[:, None, None], first, obs)
            step = np.where(began, 0, step)
