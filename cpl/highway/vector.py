"""Many roads as one Gymnasium vector environment."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from cpl.highway.config import Config
from cpl.highway.engine import Engine, Info
from cpl.highway.env import (
    action_space,
    checked_seed,
    info_at_reset,
    observation_space,
    state_of,
)
from cpl.highway.options import make_config
from cpl.highway.render import Renderer
from cpl.highway.state import State

__all__ = ["HighwayVectorEnv"]

_IDLE = 1
_Obs = NDArray[np.float32]


class HighwayVectorEnv(VectorEnv[NDArray[np.float32], NDArray[np.int64], NDArray[Any]]):
    """`num_envs` roads, stepped by one call of the engine.

    It is interchangeable with Gymnasium's `SyncVectorEnv` of as many `cpl/highway-v0`, the info
    dictionary included. What happens after an episode's end is the autoreset mode:

    - `NextStep` (Gymnasium's default): the step that ends an episode returns its last observation;
      the next step ignores that environment's action, resets it and returns the first observation
      with reward 0.
    - `SameStep`: the step that ends an episode resets at once; the last observation and info are in
      `info["final_obs"]` and `info["final_info"]`.
    - `Disabled`: the caller resets with `options={"reset_mask": ended}`; stepping on is an error.

    Args:
        num_envs: how many roads.
        render_mode: None or "rgb_array".
        autoreset_mode: one of the three, as `AutoresetMode` or its string.
        threads: how many threads share a step; results do not depend on it.
        **options: highway-env's options, flat or nested; see `cpl.highway.make_config`.

    Raises:
        ValueError: for an unknown mode or option, or an option's impossible value.

    Example:
        >>> import gymnasium
        >>> envs = gymnasium.make_vec("cpl/highway-v0", num_envs=3, vehicles_count=5)
        >>> obs, infos = envs.reset(seed=0)
        >>> obs, rewards, terminated, truncated, infos = envs.step(np.array([1, 3, 4]))
        >>> obs.shape, rewards.shape, infos["speed"].shape
        ((3, 5, 5), (3,), (3,))
    """

    # Gymnasium's annotation: a class has one, and so may each environment.
    metadata: dict[str, Any] = {"render_modes": ["rgb_array"]}  # noqa: RUF012

    def __init__(
        self,
        num_envs: int = 1,
        render_mode: str | None = None,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        threads: int = 1,
        **options: Any,  # noqa: ANN401
    ) -> None:
        if render_mode not in (None, *self.metadata["render_modes"]):
            raise ValueError(f'render_mode must be None or "rgb_array", got {render_mode!r}')
        config, picture = make_config(**options)
        self.autoreset_mode = AutoresetMode(autoreset_mode)
        self.engine = Engine(config, num_envs, threads=threads)
        self.num_envs = self.engine.n_envs
        self.render_mode = render_mode
        self.metadata = {
            "render_modes": ["rgb_array"],
            "render_fps": 2 * config.policy_frequency,
            "autoreset_mode": self.autoreset_mode,
        }
        self.single_observation_space = observation_space(config)
        self.single_action_space = action_space()
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self._renderer = Renderer(config, picture)
        self._obs = np.zeros(self.observation_space.shape or (), dtype=np.float32)
        self._ended = np.zeros(self.num_envs, dtype=np.bool_)
        self._seeded = np.zeros(self.num_envs, dtype=np.bool_)

    @property
    def config(self) -> Config:
        """The roads' settings."""
        return self.engine.config

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[_Obs, dict[str, Any]]:
        """Begin episodes.

        Args:
            seed: an integer s seeds environment i with s + i; a list gives each its own, None where
                one goes on with its random numbers.
            options: `{"reset_mask": mask}` resets the environments of a bool array only.

        Returns:
            The observations, those of environments left alone as they were, and the infos.

        Raises:
            ValueError: if there are not as many seeds as environments, a seed does not fit 64 bits,
                the mask is not a bool array of their number with one True, or an option is unknown.
        """
        mask = self._mask(options)
        if isinstance(seed, int | np.integer):
            super().reset(seed=checked_seed(seed))
        seeds, seeded = self._seeds(seed)
        fresh = np.zeros_like(self._obs)
        if (mask & seeded).any():
            fresh = self.engine.reset(seeds, mask & seeded)
        if (mask & ~seeded).any():
            fresh = fresh + self.engine.reset(None, mask & ~seeded)
        self._seeded |= mask
        self._obs = np.where(mask[:, None, None], fresh, self._obs)
        self._ended = self._ended & ~mask
        idle = np.full(self.num_envs, _IDLE)
        return self._obs.copy(), _infos(info_at_reset(self.engine), idle, mask)

    def step(
        self, actions: NDArray[np.int64]
    ) -> tuple[_Obs, NDArray[np.float64], NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]]:
        """Take one decision in every environment.

        Args:
            actions: indices into `cpl.highway.ACTIONS`, (num_envs,).

        Returns:
            Observations, rewards, terminated, truncated and infos, in new arrays.

        Raises:
            ValueError: if the actions have another shape or kind, no reset came before, or, without
                autoreset, an environment has ended.
        """
        same_step = self.autoreset_mode is AutoresetMode.SAME_STEP
        if self.autoreset_mode is AutoresetMode.DISABLED and self._ended.any():
            ended = np.flatnonzero(self._ended).tolist()
            raise ValueError(f"environments {ended} have ended; reset them with a reset_mask")
        resting, before = self._ended, self._draws(self._ended)
        out = self.engine.step(actions)
        self._put_back(before, resting)
        action = np.array(actions, dtype=np.int64)
        reward = np.where(resting, 0.0, out.reward)
        terminated, truncated = out.terminated & ~resting, out.truncated & ~resting
        ended = terminated | truncated
        again = ended if same_step else resting
        obs, info, infos = out.obs, out.info, {}
        if same_step and ended.any():
            infos = _final(obs, _infos(info, action, ended), ended)
        if again.any():
            obs = np.where(again[:, None, None], self.engine.reset(None, again), obs)
            info = _choose(again, info_at_reset(self.engine), info)
            action = np.where(again, _IDLE, action)
        self._obs, self._ended = obs, np.zeros_like(ended) if same_step else ended
        infos |= _infos(info, action, np.ones_like(ended))
        return obs.copy(), reward, terminated, truncated, infos

    def render(self) -> tuple[NDArray[np.uint8], ...] | None:
        """Draw every road; None without a render mode."""
        if self.render_mode is None:
            return None
        return tuple(self._renderer.draw(state_of(self.engine, e)) for e in range(self.num_envs))

    def close_extras(self, **kwargs: Any) -> None:  # noqa: ANN401
        """Let the renderer go."""
        del kwargs
        self._renderer.close()

    def _mask(self, options: dict[str, Any] | None) -> NDArray[np.bool_]:
        given = dict(options or {})
        mask = given.pop("reset_mask", np.ones(self.num_envs, dtype=np.bool_))
        if given:
            raise ValueError(f"unknown option of reset: {next(iter(given))}")
        if not isinstance(mask, np.ndarray) or mask.dtype != np.bool_ or not mask.any():
            raise ValueError(f"reset_mask must be a bool array with a True in it, got {mask!r}")
        if mask.shape != (self.num_envs,):
            raise ValueError(f"reset_mask must have shape ({self.num_envs},), got {mask.shape}")
        return mask

    def _seeds(
        self, seed: int | Sequence[int | None] | None
    ) -> tuple[NDArray[np.uint64], NDArray[np.bool_]]:
        """Seeds, and which environments they are for: those given one or never reset before."""
        given: list[int | None] = [None] * self.num_envs
        if isinstance(seed, int | np.integer):
            given = [checked_seed(int(seed) + e) for e in range(self.num_envs)]
        elif seed is not None:
            given = [checked_seed(number) for number in seed]
        if len(given) != self.num_envs:
            raise ValueError(f"seed has {len(given)} entries for {self.num_envs} environments")
        for e, number in enumerate(given):
            if number is None and not self._seeded[e]:
                given[e] = int(self.np_random.integers(2**63))
        seeded = np.array([number is not None for number in given])
        return np.array([number or 0 for number in given], dtype=np.uint64), seeded

    def _draws(self, resting: NDArray[np.bool_]) -> State | None:
        """The random numbers' state before a step that some environments only sit out."""
        config = self.config
        draws = config.order == "shuffled" or config.observation_noise or config.observation_dropout
        return self.engine.state() if draws and resting.any() else None

    def _put_back(self, before: State | None, resting: NDArray[np.bool_]) -> None:
        """Undo what the step drew for environments that sat it out."""
        if before is None:
            return
        state, column = self.engine.state(), resting[:, None]
        names = ("generator", "noise_generator")
        kept = {n: np.where(column, getattr(before, n), getattr(state, n)) for n in names}
        self.engine.set_state(replace(state, **kept))


def _choose(first: NDArray[np.bool_], one: Info, other: Info) -> Info:
    return Info(*(np.where(first, a, b) for a, b in zip(one, other, strict=True)))


def _infos(info: Info, action: NDArray[np.int64], present: NDArray[np.bool_]) -> dict[str, Any]:
    """Infos in Gymnasium's form: under each key an array, under _key who has it; 0 elsewhere."""
    rewards = {
        "collision_reward": info.crashed.astype(np.float64),
        "right_lane_reward": info.right_lane,
        "high_speed_reward": info.high_speed,
        "on_road_reward": info.on_road,
    }
    plain = {"speed": info.speed, "crashed": info.crashed, "action": action}
    return _masked(plain, present) | {
        "rewards": _masked(rewards, present),
        "_rewards": present.copy(),
    }


def _masked(values: dict[str, NDArray[Any]], present: NDArray[np.bool_]) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for name, value in values.items():
        found[name] = np.where(present, value, np.zeros_like(value))
        found[f"_{name}"] = present.copy()
    return found


def _final(obs: _Obs, infos: dict[str, Any], ended: NDArray[np.bool_]) -> dict[str, Any]:
    last = np.full(len(ended), None, dtype=object)
    for e in np.flatnonzero(ended):
        last[e] = obs[e].copy()
    return {
        "final_obs": last,
        "_final_obs": ended.copy(),
        "final_info": infos,
        "_final_info": ended.copy(),
    }
