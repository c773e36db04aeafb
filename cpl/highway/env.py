"""The road as a Gymnasium environment, `cpl/highway-v0`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, cast

import gymnasium
import numpy as np
from numpy.typing import NDArray

from cpl.highway.config import Config
from cpl.highway.engine import Engine, Info
from cpl.highway.geometry import CAR_LENGTH, LANE_WIDTH, ROAD_LENGTH
from cpl.highway.live_options import LiveOptions
from cpl.highway.options import change_config, make_config
from cpl.highway.reference import CAR_FIELDS, EGO_FIELDS
from cpl.highway.render import Renderer

__all__ = [
    "ACTIONS",
    "ENV_ID",
    "HighwayEnv",
    "action_space",
    "checked_seed",
    "info_at_reset",
    "info_dict",
    "observation_space",
    "register",
    "state_of",
]

ENV_ID = "cpl/highway-v0"

ACTIONS = {0: "LANE_LEFT", 1: "IDLE", 2: "LANE_RIGHT", 3: "FASTER", 4: "SLOWER"}
"""highway-env's meta-actions."""

_LEFT, _IDLE, _RIGHT, _FASTER, _SLOWER = range(5)


class HighwayEnv(gymnasium.Env[NDArray[np.float32], np.int64]):
    """One road, interchangeable with highway-env's `highway-v0`.

    Observations, rewards, terminations and the info dictionary are highway-env's for the same
    options, seeds and actions. What differs:

    | highway-env 1.12.1 | here |
    |---|---|
    | any observation, action and vehicle type | Kinematics, DiscreteMetaAction, IDM; else refused |
    | the observation space is unbounded | bounded where the observation is |
    | with one row of observation, every car in sight | the ego car alone |
    | `info["action"]` of a reset is random, nobody took it | IDLE |
    | a road from the start, before any reset | stepping or rendering before a reset is an error |
    | `config` changes act at once or at the next reset, by option | at the next reset |
    | a nested option that is set replaces the whole of it | what is left out keeps its value |
    | an unknown option or key of `reset(options=...)` is ignored | refused |
    | a window (`render_mode="human"`), keyboard control | refused |
    | frequencies may be fractions; no frame at all is accepted | whole numbers, one frame or more |
    | `road`, `vehicle` and functions that edit them (`simplify`, ...) | not there; `engine` is |

    Args:
        render_mode: None or "rgb_array" (drawn by highway-env's renderer).
        **options: highway-env's options, flat or nested; see `cpl.highway.make_config`.

    Raises:
        ValueError: for an unknown render mode or option, or an option's impossible value.

    Example:
        >>> env = gymnasium.make("cpl/highway-v0", vehicles_count=5, target_speeds=(20, 30, 40))
        >>> obs, info = env.reset(seed=0)
        >>> obs, reward, terminated, truncated, info = env.step(1)
        >>> obs.shape, terminated, truncated, float(info["speed"]) < 30
        ((5, 5), False, False, True)
    """

    # Gymnasium's annotation: a class has one, and so may each environment.
    metadata: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": 2}  # noqa: RUF012

    def __init__(self, render_mode: str | None = None, **options: Any) -> None:  # noqa: ANN401
        if render_mode not in (None, *self.metadata["render_modes"]):
            raise ValueError(f'render_mode must be None or "rgb_array", got {render_mode!r}')
        self.render_mode = render_mode
        self._configure(*make_config(**options))

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Begin an episode.

        Args:
            seed: of numpy's PCG64, as in highway-env; None goes on with the random numbers of the
                episode before, and starts from Gymnasium's own seed the first time.
            options: as in highway-env, `{"config": {...}}` changes options from now on; what was
                set in `config` before holds as well.

        Returns:
            The observation and the info.

        Raises:
            ValueError: if the seed is no integer of 64 bits, an option is unknown or impossible, or
                `options` holds anything but `config`.
        """
        seed = checked_seed(seed)
        if unknown := (options or {}).keys() - {"config"}:
            raise ValueError(
                f"options of a reset must be {{'config': {{...}}}}, got {sorted(unknown)}; options "
                f"of the road go inside, as in options={{'config': {options!r}}}"
            )
        changes = (options or {}).get("config")
        if changes:
            self.configure(changes)
        super().reset(seed=seed)
        self._apply()
        if seed is None and not self._seeded:
            seed = int(self.np_random.integers(2**63))
        obs = self._engine.reset(None if seed is None else np.array([seed], dtype=np.uint64))
        self._seeded = True
        return obs[0], info_dict(info_at_reset(self._engine), 0, _IDLE)

    def step(
        self, action: np.int64 | int
    ) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        """Take one decision.

        Args:
            action: an index into `ACTIONS`.

        Returns:
            Observation, reward, terminated, truncated and info.

        Raises:
            ValueError: if the action is not one of the five, or no reset came before.
        """
        decision = np.asarray(action)
        if decision.size != 1 or decision.dtype.kind not in "iu":
            raise ValueError(f"action must be one integer, got {action!r}")
        out = self._engine.step(decision.reshape(1))
        return (
            out.obs[0],
            float(out.reward[0]),
            bool(out.terminated[0]),
            bool(out.truncated[0]),
            info_dict(out.info, 0, int(decision.reshape(1)[0])),
        )

    def render(self) -> NDArray[np.uint8] | None:
        """Draw the road as highway-env does.

        Returns:
            The picture, uint8 (height, width, 3), or None without a render mode.

        Raises:
            ValueError: before the first reset.
        """
        if self.render_mode is None:
            gymnasium.logger.warn('render() needs gymnasium.make(..., render_mode="rgb_array")')
            return None
        if not self._seeded:
            raise ValueError("render before reset: there is no road yet")
        return self._renderer.draw(state_of(self._engine, 0))

    def close(self) -> None:
        """Let the renderer go."""
        self._renderer.close()

    @property
    def engine(self) -> Engine:
        """The engine, a batch of one."""
        return self._engine

    @property
    def config(self) -> LiveOptions:
        """highway-env's dictionary of options; what is set holds from the next reset on."""
        return LiveOptions(lambda: self._wanted, self.configure)

    def configure(self, changes: Mapping[str, Any] | None) -> None:
        """Change options from the next reset on, as `config.update` does.

        Args:
            changes: highway-env's options, flat or nested; None changes nothing.

        Raises:
            ValueError: an option is unknown or impossible; then none is changed.
        """
        self._wanted = change_config(*self._wanted, changes or {})

    def get_available_actions(self) -> list[int]:
        """Say which actions change something, in highway-env's order.

        Returns:
            Indices into `ACTIONS`: IDLE, the lanes beside the ego car's, the next speed levels.

        Raises:
            ValueError: before the first reset.
        """
        if not self._seeded:
            raise ValueError("actions before reset: there is no road yet")
        state, config = state_of(self._engine, 0), self._engine.config
        lane, level = int(state["lane"][0]), int(state["speed_index"])
        beside = [
            action
            for action, side in ((_LEFT, lane - 1), (_RIGHT, lane + 1))
            if 0 <= side < config.lanes_count and _reachable(state["x"][0], state["y"][0], side)
        ]
        faster = [_FASTER] if level < len(config.target_speeds) - 1 else []
        return [_IDLE, *beside, *faster, *([_SLOWER] if level > 0 else [])]

    def _configure(self, config: Config, picture: Mapping[str, object]) -> None:
        self._engine = Engine(config, 1)
        self._picture = picture
        self._wanted = (config, picture)
        self._renderer = Renderer(config, picture)
        self._seeded = False
        box = observation_space(config)
        self.observation_space = cast("gymnasium.Space[NDArray[np.float32]]", box)
        self.action_space = action_space()
        self.metadata = {**type(self).metadata, "render_fps": 2 * config.policy_frequency}

    def _apply(self) -> None:
        """Build the road that is wanted, going on with this one's random numbers."""
        if self._wanted == (self._engine.config, self._picture):
            return
        before, seeded = self._engine.state(), self._seeded
        self._renderer.close()
        self._configure(*self._wanted)
        blank = self._engine.state()
        self._engine.set_state(
            replace(blank, generator=before.generator, noise_generator=before.noise_generator)
        )
        self._seeded = seeded


def register() -> None:
    """Register `cpl/highway-v0` with Gymnasium, once."""
    if ENV_ID not in gymnasium.registry:
        gymnasium.register(
            id=ENV_ID,
            entry_point="cpl.highway.env:HighwayEnv",
            vector_entry_point="cpl.highway.vector:HighwayVectorEnv",
        )


def checked_seed(seed: object) -> int | None:
    """Take a seed that numpy and the engine both take.

    Args:
        seed: an integer in [0, 2**64), or None.

    Returns:
        The same as a Python integer, or None.

    Raises:
        ValueError: if it is something else.
    """
    if seed is None:
        return None
    if not isinstance(seed, int | np.integer) or isinstance(seed, bool):
        raise ValueError(f"seed must be an integer in [0, 2**64), got {seed!r}")
    if not 0 <= int(seed) < 2**64:
        raise ValueError(f"seed must be an integer in [0, 2**64), got {seed!r}")
    return int(seed)


def action_space() -> gymnasium.spaces.Discrete:
    """The five meta-actions."""
    return gymnasium.spaces.Discrete(len(ACTIONS))


def observation_space(config: Config) -> gymnasium.spaces.Box:
    """Where a configuration's observations lie.

    highway-env calls it unbounded; here it is [-1, 1] if every feature is mapped there and clipped
    (or is a presence, a cosine or a sine, which lie there anyway), and no noise is added.

    Args:
        config: the road.

    Returns:
        A box of float32 (rows, features).

    Example:
        >>> observation_space(Config()).shape
        (5, 5)
    """
    mapped = set(config.ranges()) if config.normalize and config.clip else set()
    unit = {"presence", "cos_h", "sin_h", "cos_d", "sin_d"} - (
        set(config.ranges()) if config.normalize else set()
    )
    bounded = set(config.features) <= mapped | unit and not config.observation_noise
    bound = 1.0 if bounded else np.inf
    shape = (config.observation_vehicles_count, len(config.features))
    return gymnasium.spaces.Box(-bound, bound, shape, np.float32)


def _reachable(x: float, y: float, lane: int) -> bool:
    """Say whether a car may turn to a lane from where it is, as highway-env asks its lanes."""
    return bool(abs(y - lane * LANE_WIDTH) <= 2 * LANE_WIDTH and 0 <= x < ROAD_LENGTH + CAR_LENGTH)


def info_at_reset(engine: Engine) -> Info:
    """What `Step.info` would say of roads that were just reset, before any step."""
    config, state = engine.config, engine.state()
    low, high = config.reward_speed_range
    speed = state.speed[:, 0]
    return Info(
        speed=speed.copy(),
        crashed=state.crashed[:, 0].copy(),
        right_lane=state.target_lane[:, 0] / max(config.lanes_count - 1, 1),
        high_speed=np.clip((speed - low) / (high - low), 0.0, 1.0),
        on_road=np.ones(engine.n_envs),
    )


def info_dict(info: Info, e: int, action: int) -> dict[str, Any]:
    """One environment's info in highway-env's words.

    Args:
        info: the batch's.
        e: which environment.
        action: what it did.

    Returns:
        `speed`, `crashed`, `action` and the unweighted `rewards`.
    """
    return {
        "speed": float(info.speed[e]),
        "crashed": bool(info.crashed[e]),
        "action": action,
        "rewards": {
            "collision_reward": float(info.crashed[e]),
            "right_lane_reward": float(info.right_lane[e]),
            "high_speed_reward": float(info.high_speed[e]),
            "on_road_reward": float(info.on_road[e]),
        },
    }


def state_of(engine: Engine, e: int) -> dict[str, NDArray[Any]]:
    """One environment's state as `cpl.highway.reference.write_state` takes it."""
    state = engine.state()
    return {name: np.array(getattr(state, name)[e]) for name in (*CAR_FIELDS, *EGO_FIELDS)}
