"""The reference learner: Stable-Baselines3's own DQN. Imported only where it is asked for.

Nothing of it is ever written: its archives hold pickles, which run whatever they contain when they
are opened. What leaves this module is numbers.
"""

from __future__ import annotations

import random
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np
import pandas as pd
import torch
from gymnasium.spaces import Box, Discrete
from numpy.typing import NDArray
from stable_baselines3 import DQN
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.logger import Logger
from stable_baselines3.common.vec_env import VecEnv
from stable_baselines3.common.vec_env.base_vec_env import VecEnvIndices, VecEnvStepReturn

from cpl.highway.sb3 import HighwayVecEnv
from cpl.network import MLP
from cpl.policies.dqn.compiled import recent
from cpl.policies.dqn.config import DQNConfig
from cpl.policies.dqn.curve import Curve
from cpl.policies.dqn.task import Plain, Task

__all__ = ["TaskVecEnv", "extract_network", "make_dqn", "own_globals", "train_reference"]


def train_reference(config: DQNConfig, task: Task, seed: int) -> tuple[MLP, pd.DataFrame]:
    """Learn; see `cpl.policies.dqn.train`."""
    curve = Curve(every=config.curve_every, policy_frequency=task.roads[0].policy_frequency)
    with own_globals():
        model = make_dqn(config, task, seed, kind=_Reporting)
        model.curve = curve
        model.learn(config.steps, callback=_Watch(curve), log_interval=_NEVER)
        return extract_network(model.q_net), curve.table()


def make_dqn(config: DQNConfig, task: Task, seed: int, *, kind: type[DQN] = DQN) -> Any:  # noqa: ANN401
    """Build Stable-Baselines3's learner with these settings.

    Args:
        config: The settings.
        task: What it drives; a road without a wrapper is driven through `HighwayVecEnv`.
        seed: Seed of everything random.
        kind: The class.

    Returns:
        The learner, before its first step.
    """
    plain = type(task.wrapper) is Plain and len(task.roads) == 1
    model = kind(
        "MlpPolicy",
        HighwayVecEnv(1, task.roads[0]) if plain else TaskVecEnv(task),
        learning_rate=config.learning_rate,
        buffer_size=config.buffer_size,
        learning_starts=config.learning_starts,
        batch_size=config.batch_size,
        gamma=config.gamma,
        train_freq=config.train_freq,
        gradient_steps=config.gradient_steps,
        target_update_interval=config.target_update_interval,
        exploration_fraction=config.exploration_fraction,
        exploration_initial_eps=config.exploration_initial,
        exploration_final_eps=config.exploration_final,
        max_grad_norm=config.max_grad_norm,
        policy_kwargs={"net_arch": list(config.hidden), "optimizer_kwargs": {"fused": True}},
        device="cpu",
        seed=seed,
    )
    model.set_logger(Logger(folder=None, output_formats=[]))
    return model


@contextmanager
def own_globals() -> Iterator[None]:
    """Lend out the process's global random generators and torch's threads, one, and restore them.

    Stable-Baselines3 seeds and draws from the generators of Python, numpy and torch.
    """
    python, torchs, threads = random.getstate(), torch.get_rng_state(), torch.get_num_threads()
    numpys = np.random.get_state()  # noqa: NPY002 - it is what Stable-Baselines3 draws from
    torch.set_num_threads(1)
    try:
        yield
    finally:
        random.setstate(python)
        np.random.set_state(numpys)  # noqa: NPY002
        torch.set_rng_state(torchs)
        torch.set_num_threads(threads)


def extract_network(module: torch.nn.Module) -> MLP:
    """Copy the layers of a torch network.

    Args:
        module: A network whose linear layers follow each other.

    Returns:
        The same network.
    """
    layers = [layer for layer in module.modules() if isinstance(layer, torch.nn.Linear)]
    weights = tuple(layer.weight.detach().numpy().T.copy() for layer in layers)
    return MLP(weights, tuple(layer.bias.detach().numpy().copy() for layer in layers))


_NEVER = 10**12
"""Episodes between Stable-Baselines3's own reports."""


class _Reporting(DQN):
    """The learner, telling its losses."""

    curve: Curve

    def train(self, gradient_steps: int, batch_size: int = 100) -> None:
        super().train(gradient_steps, batch_size)
        self.curve.learned(float(self.logger.name_to_value["train/loss"]))


class _Watch(BaseCallback):
    """Reports decisions to a learning curve."""

    def __init__(self, curve: Curve) -> None:
        super().__init__()
        self._curve = curve

    def _on_rollout_start(self) -> None:
        if self.num_timesteps and self._curve.due:
            self._close()

    def _on_step(self) -> bool:
        info, ended = self.locals["infos"][0], bool(self.locals["dones"][0])
        self._curve.add(
            reward=float(self.locals["rewards"][0]),
            ended=ended,
            crashed=ended and not info["TimeLimit.truncated"],
            speed=float(info["speed"]),
        )
        return True

    def _on_training_end(self) -> None:
        if self._curve.due:
            self._close()

    def _close(self) -> None:
        model: Any = self.model
        buffer = model.replay_buffer
        filled = buffer.buffer_size if buffer.full else buffer.pos
        seen = buffer.observations[recent(buffer.pos, filled, buffer.buffer_size), 0]
        values = extract_network(model.q_net)(seen.reshape(len(seen), -1)).max(axis=1)
        self._curve.close(exploration=model.exploration_rate, q_mean=float(values.mean()))


class TaskVecEnv(VecEnv):
    """A task as a Stable-Baselines3 vector environment of one.

    Args:
        task: The task; it carries its own seed.
    """

    def __init__(self, task: Task) -> None:
        self._task = task
        self._actions = np.zeros(1, np.int64)
        seen = Box(-np.inf, np.inf, (task.wrapper.size,), np.float32)
        super().__init__(1, seen, Discrete(task.wrapper.actions))

    def reset(self) -> NDArray[np.float32]:
        """Begin an episode."""
        return self._task.reset()[None]

    def step_async(self, actions: NDArray[np.int64]) -> None:
        """Keep the actions for `step_wait`."""
        self._actions = actions

    def step_wait(self) -> VecEnvStepReturn:
        """Take the decision; an episode that ends is followed by the next at once."""
        out = self._task.step(int(self._actions[0]))
        ended = out.terminated or out.truncated
        info: dict[str, Any] = {
            "speed": out.speed,
            "TimeLimit.truncated": out.truncated and not out.terminated,
        }
        obs = out.obs
        if ended:
            info["terminal_observation"] = out.obs
            obs = self._task.reset()
        return obs[None], np.array([out.reward], np.float32), np.array([ended]), [info]

    def close(self) -> None:
        """Do nothing: there is nothing to let go."""

    def get_attr(self, attr_name: str, indices: VecEnvIndices = None) -> list[Any]:
        """Read an attribute."""
        return [None if attr_name == "render_mode" else getattr(self, attr_name)]

    def set_attr(self, attr_name: str, value: Any, indices: VecEnvIndices = None) -> None:  # noqa: ANN401
        """Set an attribute."""
        setattr(self, attr_name, value)

    def env_method(
        self,
        method_name: str,
        *method_args: Any,  # noqa: ANN401
        indices: VecEnvIndices = None,
        **method_kwargs: Any,  # noqa: ANN401
    ) -> list[Any]:
        """Refuse: a task has no methods for others to call.

        Raises:
            ValueError: always.
        """
        raise ValueError(f"the task has no single environment to call {method_name!r} of")

    def env_is_wrapped(self, wrapper_class: Any, indices: VecEnvIndices = None) -> list[bool]:  # noqa: ANN401
        """Say that nothing is wrapped."""
        return [False]

    def seed(self, seed: int | None = None) -> Sequence[int | None]:
        """Do nothing: the task carries its own seed."""
        return [seed]
