"""The batched engine: N independent roads, one decision at a time."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import numpy as np

from cpl.highway.config import Config
from cpl.highway.draws import seed_many
from cpl.highway.layout import allocate, feature_table, settings_of, workspace
from cpl.highway.paths import PATHS, active_path
from cpl.highway.simulate import refresh_range, reset_range, step_range
from cpl.highway.state import State, read_state, write_state

__all__ = ["NOISE_KEY", "Engine", "Info", "Step"]

NOISE_KEY = 0x6F6273
"""Spawn key of the observation's stream: "obs" in ASCII."""


class Info(NamedTuple):
    """What highway-env reports beside the reward, each (n_envs,).

    `speed` is the ego car's [m/s], `crashed` whether it has crashed, and the others are the
    reward's unweighted terms: `right_lane` 0 to 1, `high_speed` 0 to 1, `on_road` 0 or 1.
    """

    speed: np.ndarray
    crashed: np.ndarray
    right_lane: np.ndarray
    high_speed: np.ndarray
    on_road: np.ndarray


class Step(NamedTuple):
    """One decision's outcome.

    `obs` is float32 (n_envs, rows, features), `reward` float64 (n_envs,), `terminated` and
    `truncated` bool (n_envs,), `info` an `Info`.
    """

    obs: np.ndarray
    reward: np.ndarray
    terminated: np.ndarray
    truncated: np.ndarray
    info: Info


class Engine:
    """N roads of one `Config`, each with its own random generator.

    An environment that has terminated or truncated may be stepped on: like highway-env, the engine
    then keeps simulating. Crashed cars brake to a standstill, are pushed apart and are hit again,
    the others drive on, and `terminated` stays True.

    Example:
        >>> engine = Engine(Config(vehicles_count=5), n_envs=2)
        >>> engine.reset(seeds=[0, 1]).shape
        (2, 5, 5)
        >>> out = engine.step([1, 3])
        >>> out.reward.shape, out.info.speed.shape
        ((2,), (2,))
    """

    def __init__(
        self, config: Config, n_envs: int, *, threads: int = 1, path: str | None = None
    ) -> None:
        """Allocate the batch.

        Args:
            config: The road.
            n_envs: Number of environments [-].
            threads: Threads that share a step [-]; results do not depend on it.
            path: One of `cpl.highway.paths.PATHS`, the arithmetic; None takes `active_path()`.

        Raises:
            ValueError: If an argument is of the wrong kind or out of range.
        """
        if not isinstance(config, Config):
            raise ValueError(f"config must be a cpl.highway.Config, got {config!r}")
        self.config = config
        self.n_envs = _positive("n_envs", n_envs)
        self.threads = min(_positive("threads", threads), self.n_envs)
        if path is not None and path not in PATHS:
            raise ValueError(f"path must be one of {tuple(PATHS)} or None, got {path!r}")
        self.path = path or active_path()
        self._memory = allocate(config, self.n_envs)
        self._settings = settings_of(config)  # counts and numbers
        self._levels = np.array(config.target_speeds)
        self._columns = feature_table(config)  # codes and ranges
        self._spaces = [workspace(config) for _ in range(self.threads)]
        cuts = [self.n_envs * k // self.threads for k in range(self.threads + 1)]
        self._parts = list(zip(cuts[:-1], cuts[1:], self._spaces, strict=True))
        self._pool = ThreadPoolExecutor(self.threads) if self.threads > 1 else None
        self._shape = (self.n_envs, config.observation_vehicles_count, len(config.features))

    def reset(
        self, seeds: np.ndarray | list[int] | None = None, mask: np.ndarray | None = None
    ) -> np.ndarray:
        """Begin new episodes.

        Args:
            seeds: Non-negative integers (n_envs,), one generator each, numpy's
                PCG64(SeedSequence(seed)) as in gymnasium; None continues each generator where the
                last episode left it (the first time, from the operating system's entropy).
            mask: bool (n_envs,), the environments to reset; None resets all.

        Returns:
            Observations, float32 (n_envs, rows, features); zeros where the mask is False.

        Raises:
            ValueError: If an argument has the wrong shape, kind or range.
        """
        m = self._memory
        chosen = np.ones(self.n_envs, np.bool_) if mask is None else self._mask(mask)
        if seeds is not None:
            self._seed(self._seeds(seeds), chosen)
        else:
            fresh = chosen & ~m.generator[:, 3].astype(np.bool_)  # the increment is odd once seeded
            if fresh.any():
                entropy = np.random.SeedSequence().generate_state(self.n_envs, np.uint64)
                self._seed(entropy, fresh)
        obs = np.zeros(self._shape, np.float32)
        common = (*self._settings, self._levels, *self._columns, chosen, obs, *m)
        self._run(lambda first, stop, w: reset_range(first, stop, w.nearest, *common))
        return obs

    def step(self, actions: np.ndarray | list[int]) -> Step:
        """Take one decision in every environment.

        Args:
            actions: Integers (n_envs,): 0 lane left, 1 idle, 2 lane right, 3 faster, 4 slower.

        Returns:
            The outcome, in new arrays.

        Raises:
            ValueError: If actions have the wrong shape, kind or range, or an environment was
                never reset.
        """
        m = self._memory
        chosen = self._actions(actions)
        if not m.ready.all():
            raise ValueError(
                f"step before reset: environment {int(np.argmin(m.ready))} was never reset"
            )
        obs = np.empty(self._shape, np.float32)
        reward = np.empty(self.n_envs)
        terms = np.empty((self.n_envs, 5))
        ended = np.empty((2, self.n_envs), np.bool_)
        results = (obs, reward, terms, ended)
        common = (
            *self._settings,
            self._levels,
            *self._columns,
            chosen,
            *results,
            PATHS[self.path],
            *m,
        )
        self._run(lambda first, stop, w: step_range(first, stop, *w, *common))
        crashed, right_lane, high_speed, on_road, speed = terms.T
        info = Info(speed, crashed > 0, right_lane, high_speed, on_road)
        return Step(obs, reward, ended[0], ended[1], info)

    def state(self) -> State:
        """Copy the batch's complete state.

        Returns:
            The state; `set_state` of it continues bit for bit.
        """
        return read_state(self._memory, self.config)

    def set_state(self, state: State) -> None:
        """Continue from a state.

        Args:
            state: Arrays of this engine's shapes.

        Raises:
            ValueError: Naming the array that has a wrong shape, kind or value; nothing is changed.
        """
        write_state(self._memory, self.config, state)
        common = (PATHS[self.path], *self._settings, *self._memory)
        self._run(lambda first, stop, _: refresh_range(first, stop, *common))

    def _run(self, part) -> None:  # noqa: ANN001
        if self._pool is None:
            part(*self._parts[0])
        else:
            for done in [self._pool.submit(part, *bounds) for bounds in self._parts]:
                done.result()

    def _seed(self, seeds: np.ndarray, chosen: np.ndarray) -> None:
        seed_many(self._memory.generator, seeds, chosen, -1)
        seed_many(self._memory.noise_generator, seeds, chosen, NOISE_KEY)

    def _mask(self, mask: np.ndarray) -> np.ndarray:
        array = np.asarray(mask)
        if array.shape != (self.n_envs,) or array.dtype != np.bool_:
            raise ValueError(
                f"mask must be bool of shape ({self.n_envs},), got {array.dtype} {array.shape}"
            )
        return array

    def _seeds(self, seeds: np.ndarray | list[int]) -> np.ndarray:
        array = np.asarray(seeds)
        if array.shape != (self.n_envs,) or array.dtype.kind not in "iu":
            raise ValueError(
                f"seeds must be integers of shape ({self.n_envs},), got {array.dtype} {array.shape}"
            )
        if (array < 0).any():
            raise ValueError(f"seeds must not be negative, got {array.min()}")
        return array.astype(np.uint64)

    def _actions(self, actions: np.ndarray | list[int]) -> np.ndarray:
        array = np.asarray(actions)
        if array.shape != (self.n_envs,) or array.dtype.kind not in "iu":
            raise ValueError(
                f"actions must be integers of shape ({self.n_envs},),"
                f" got {array.dtype} {array.shape}"
            )
        if array.min() < 0 or array.max() > 4:
            wrong = array[(array < 0) | (array > 4)][0]
            raise ValueError(f"actions must be in [0, 4], got {wrong}")
        return array.astype(np.int64)


def _positive(name: str, value: int) -> int:
    if isinstance(value, bool) or not hasattr(value, "__index__") or value.__index__() < 1:
        raise ValueError(f"{name} must be a positive integer, got {value!r}")
    return value.__index__()
