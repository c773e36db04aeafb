"""What the learner drives: one road, seen through an optional wrapper."""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from cpl.highway import Config, Engine
from cpl.rng import stream

__all__ = ["Outcome", "Plain", "Task", "Wrapper"]


class Wrapper(Protocol):
    """What stands between the road and the learner: features, penalties, other choices.

    A wrapper lives through a whole training and may keep state: the forecast's history, a tracker,
    its own statistics. It sees the engine (one environment) after the road has moved, so that it
    can score an earlier forecast with the true distance.
    """

    @property
    def size(self) -> int:
        """Length of the observation the learner sees."""
        ...

    @property
    def actions(self) -> int:
        """How many choices the learner has."""
        ...

    def reset(self, engine: Engine, obs: NDArray[np.float32]) -> NDArray[np.float32]:
        """Begin an episode.

        Args:
            engine: The road.
            obs: Its first observation, (rows, features).

        Returns:
            What the learner sees, (size,).
        """
        ...

    def action(self, choice: int) -> int:
        """Return the road's action for the learner's choice."""
        ...

    def step(
        self, engine: Engine, obs: NDArray[np.float32], reward: float
    ) -> tuple[NDArray[np.float32], float]:
        """Look at a step, the episode's last included.

        Args:
            engine: The road after the step.
            obs: Its observation, (rows, features).
            reward: What the road paid.

        Returns:
            What the learner sees, (size,), and the reward it is paid.
        """
        ...


class Plain:
    """The wrapper that changes nothing.

    Args:
        road: The road.
    """

    def __init__(self, road: Config) -> None:
        self.size = road.observation_vehicles_count * len(road.features)
        self.actions = 5

    def reset(self, engine: Engine, obs: NDArray[np.float32]) -> NDArray[np.float32]:
        """Flatten the first observation."""
        del engine
        return obs.ravel()

    def action(self, choice: int) -> int:
        """Take the choice as the action."""
        return choice

    def step(
        self, engine: Engine, obs: NDArray[np.float32], reward: float
    ) -> tuple[NDArray[np.float32], float]:
        """Flatten the observation."""
        del engine
        return obs.ravel(), reward


class Outcome(NamedTuple):
    """A step as the learner sees it: `obs` (size,), and `speed` of the ego car [m/s]."""

    obs: NDArray[np.float32]
    reward: float
    terminated: bool
    truncated: bool
    speed: float


class Task:
    """One road, or one of several drawn anew for each episode, behind a wrapper.

    Args:
        roads: The roads; with more than one, each episode draws its own with equal chances.
        wrapper: What the learner sees and is paid; None changes nothing.
        seed: Seed of the first episode, as in gymnasium; later ones continue its random numbers.

    Raises:
        ValueError: If there is no road, or the roads' observations or frequencies differ.

    Example:
        >>> task = Task((Config(vehicles_count=5),), None, seed=0)
        >>> task.reset().shape, task.step(1).terminated
        ((25,), False)
    """

    def __init__(self, roads: tuple[Config, ...], wrapper: Wrapper | None, seed: int) -> None:
        if not roads:
            raise ValueError(f"roads must name at least one road, got {roads!r}")
        alike = {
            (road.observation_vehicles_count, road.features, road.policy_frequency)
            for road in roads
        }
        if len(alike) > 1:
            raise ValueError(f"roads must agree in what is observed and how often, got {alike}")
        self.roads = roads
        self.wrapper = Plain(roads[0]) if wrapper is None else wrapper
        self._seed = seed
        self._draws = stream(seed, "dqn", "roads")
        self._engines: dict[int, Engine] = {}
        self._engine = Engine(roads[0], 1)

    def reset(self) -> NDArray[np.float32]:
        """Begin an episode.

        Returns:
            The first observation, (size,).
        """
        number = int(self._draws.integers(len(self.roads))) if len(self.roads) > 1 else 0
        if number in self._engines:
            self._engine = self._engines[number]
            obs = self._engine.reset()
        else:
            self._engine = self._engines[number] = Engine(self.roads[number], 1)
            obs = self._engine.reset([self._seed + number])
        return self.wrapper.reset(self._engine, obs[0])

    def step(self, choice: int) -> Outcome:
        """Take a decision.

        Args:
            choice: One of the wrapper's choices.

        Returns:
            What came of it; after a last step `reset` must follow.
        """
        out = self._engine.step([self.wrapper.action(choice)])
        obs, reward = self.wrapper.step(self._engine, out.obs[0], float(out.reward[0]))
        terminated, truncated = bool(out.terminated[0]), bool(out.truncated[0])
        return Outcome(obs, reward, terminated, truncated, float(out.info.speed[0]))
