"""Pictures of the road, drawn by highway-env's own renderer from a state of the engine."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from cpl.highway.config import Config
from cpl.highway.options import RENDER_OPTIONS, highway_env_options

if TYPE_CHECKING:
    from highway_env.envs.highway_env import HighwayEnv

__all__ = ["Renderer"]


class Renderer:
    """Draw states of one configuration's road.

    highway-env and pygame are imported with the first picture. No window is opened and none is
    needed.

    Args:
        config: the road.
        picture: `RENDER_OPTIONS` that differ from highway-env's.

    Raises:
        ValueError: for an unknown option of the picture or a size that is not positive.
    """

    def __init__(self, config: Config, picture: Mapping[str, object] | None = None) -> None:
        self._options = dict(RENDER_OPTIONS)
        for name, value in (picture or {}).items():
            if name not in RENDER_OPTIONS:
                raise ValueError(f"picture has no option {name}={value!r}")
            self._options[name] = value
        for name in ("screen_width", "screen_height", "scaling"):
            value = self._options[name]
            if not isinstance(value, int | float) or value <= 0:
                raise ValueError(f"{name} must be positive, got {value!r}")
        self._config = config
        self._env: HighwayEnv | None = None

    def draw(self, state: Mapping[str, NDArray[Any]]) -> NDArray[np.uint8]:
        """Draw one road.

        Args:
            state: one environment's state, as `cpl.highway.reference.read_state` returns it.

        Returns:
            The picture, uint8 (screen_height, screen_width, 3).
        """
        from cpl.highway.reference import write_state

        env = self._env if self._env is not None else self._open()
        write_state(env, state)
        image = env.render()
        if image is None:  # only without a render mode, which _open sets
            raise RuntimeError("highway-env drew nothing")
        return np.array(image, dtype=np.uint8)

    def close(self) -> None:
        """Let highway-env's viewer go; a later picture opens a new one."""
        if self._env is not None:
            self._env.close()
            self._env = None

    def __getstate__(self) -> dict[str, Any]:
        """Leave the drawing program at home: a copy opens its own with its first picture."""
        return {**vars(self), "_env": None}

    def _open(self) -> HighwayEnv:
        from highway_env.envs.common.graphics import EnvViewer

        from cpl.highway.reference import reference_env

        env = reference_env(highway_env_options(self._config) | self._options)
        env.render_mode = "rgb_array"
        viewer = EnvViewer(env)
        viewer.enabled = True  # it refuses to draw on a machine set up without a display
        vars(env)["viewer"] = viewer
        self._env = env
        return env
