"""Many roads as a Stable-Baselines3 vector environment.

Stable-Baselines3 is imported here and nowhere else in the package, so that the road can be used
without it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray
from stable_baselines3.common.vec_env import VecEnv
from stable_baselines3.common.vec_env.base_vec_env import (
    VecEnvIndices,
    VecEnvObs,
    VecEnvStepReturn,
)

from cpl.highway.config import Config
from cpl.highway.engine import Engine
from cpl.highway.env import (
    action_space,
    info_at_reset,
    info_dict,
    observation_space,
    state_of,
)
from cpl.highway.options import RENDER_OPTIONS, change_config
from cpl.highway.render import Renderer

__all__ = ["HighwayVecEnv"]

_IDLE = 1


class HighwayVecEnv(VecEnv):
    """`n_envs` roads for Stable-Baselines3, stepped by one call of the engine.

    It is interchangeable with a `DummyVecEnv` of as many `cpl/highway-v0`: the step that ends an
    episode returns the first observation of the next one, its own last observation is in
    `info["terminal_observation"]`, and `info["TimeLimit.truncated"]` says that time ran out
    without a crash.

    Args:
        n_envs: how many roads.
        config: the road; highway-env's defaults if left out.
        render_mode: None or "rgb_array".
        threads: how many threads share a step; results do not depend on it.
        **options: highway-env's options, flat or nested, that change `config`.

    Raises:
        ValueError: for an unknown render mode or option, or an option's impossible value.
    """

    actions: NDArray[np.int64]

    def __init__(
        self,
        n_envs: int,
        config: Config | None = None,
        *,
        render_mode: str | None = None,
        threads: int = 1,
        **options: Any,  # noqa: ANN401
    ) -> None:
        if render_mode not in (None, "rgb_array"):
            raise ValueError(f'render_mode must be None or "rgb_array", got {render_mode!r}')
        changed, picture = change_config(config or Config(), RENDER_OPTIONS, options)
        self.engine = Engine(changed, n_envs, threads=threads)
        self._mode = render_mode
        self._renderer = Renderer(changed, picture)
        super().__init__(self.engine.n_envs, observation_space(changed), action_space())

    @property
    def config(self) -> Config:
        """The roads' settings."""
        return self.engine.config

    def reset(self) -> VecEnvObs:
        """Begin an episode in every environment, seeded if `seed` was called before.

        Returns:
            The observations.

        Raises:
            ValueError: if options were set, of which there are none.
        """
        if any(self._options):
            raise ValueError(f"options of reset are not known: {self._options}")
        seeded = np.array([seed is not None for seed in self._seeds])
        obs = np.zeros((self.num_envs, *(self.observation_space.shape or ())), dtype=np.float32)
        if seeded.any():
            seeds = np.array([seed or 0 for seed in self._seeds], dtype=np.uint64)
            obs = obs + self.engine.reset(seeds, seeded)
        if not seeded.all():
            obs = obs + self.engine.reset(None, ~seeded)
        self._reset_seeds()
        self._note_resets(range(self.num_envs))
        return obs

    def step_async(self, actions: NDArray[np.int64]) -> None:
        """Keep the actions for `step_wait`."""
        self.actions = actions

    def step_wait(self) -> VecEnvStepReturn:
        """Take the decisions; environments that end are reset at once.

        Returns:
            Observations, rewards (float32), whether each ended, and an info for each.
        """
        out = self.engine.step(self.actions)
        obs, ended = out.obs, out.terminated | out.truncated
        infos = []
        for e, action in enumerate(self.actions):
            info = info_dict(out.info, e, int(action))
            info["TimeLimit.truncated"] = bool(out.truncated[e] and not out.terminated[e])
            infos.append(info)
        if ended.any():
            for e in np.flatnonzero(ended):
                infos[e]["terminal_observation"] = obs[e].copy()
            obs = np.where(ended[:, None, None], self.engine.reset(None, ended), obs)
            self._note_resets(np.flatnonzero(ended))
        return obs, out.reward.astype(np.float32), ended, infos

    def close(self) -> None:
        """Let the renderer go."""
        self._renderer.close()

    def get_images(self) -> Sequence[NDArray[np.uint8] | None]:
        """Draw every road; None each without a render mode."""
        if self.render_mode is None:
            return [None] * self.num_envs
        return [self._renderer.draw(state_of(self.engine, e)) for e in range(self.num_envs)]

    def get_attr(self, attr_name: str, indices: VecEnvIndices = None) -> list[Any]:
        """Read an attribute, which all environments share.

        Raises:
            AttributeError: if there is none of the name.
        """
        value = self._mode if attr_name == "render_mode" else getattr(self, attr_name)
        return [value for _ in self._get_indices(indices)]

    def set_attr(
        self,
        attr_name: str,
        value: Any,  # noqa: ANN401
        indices: VecEnvIndices = None,
    ) -> None:
        """Set an attribute of all environments at once.

        Raises:
            ValueError: if it is to be set for some only; they are one engine.
        """
        if indices is not None and len(list(self._get_indices(indices))) != self.num_envs:
            raise ValueError(f"{attr_name} cannot be set for environments {indices!r} only")
        setattr(self, attr_name, value)

    def env_method(
        self,
        method_name: str,
        *method_args: Any,  # noqa: ANN401
        indices: VecEnvIndices = None,
        **method_kwargs: Any,  # noqa: ANN401
    ) -> list[Any]:
        """Refuse: the environments are one engine and have no methods of their own.

        Raises:
            ValueError: always.
        """
        del method_args, method_kwargs, indices
        raise ValueError(f"the batch has no single environment to call {method_name!r} of")

    def env_is_wrapped(
        self, wrapper_class: type[gymnasium.Wrapper], indices: VecEnvIndices = None
    ) -> list[bool]:
        """Say that nothing is wrapped."""
        del wrapper_class
        return [False for _ in self._get_indices(indices)]

    def _note_resets(self, environments: Sequence[int] | NDArray[np.intp] | range) -> None:
        info = info_at_reset(self.engine)
        for e in environments:
            self.reset_infos[e] = info_dict(info, int(e), _IDLE)
