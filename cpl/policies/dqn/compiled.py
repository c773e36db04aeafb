"""The compiled learner: Stable-Baselines3's DQN step for step, with the same random numbers."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pandas as pd
from gymnasium.spaces import Discrete
from numpy.typing import NDArray

from cpl.network import MLP
from cpl.policies.dqn.config import DQNConfig
from cpl.policies.dqn.curve import Curve
from cpl.policies.dqn.initial import initial_network
from cpl.policies.dqn.task import Task
from cpl.policies.dqn.update import PARAMETERS, TARGET, greedy, layout, update

__all__ = ["Learner", "recent", "train_compiled"]


class Learner:
    """The online and the target network with Adam's moments.

    Args:
        network: Initial weights of both networks.
        config: Settings; of them the batch, the discount, the learning rate and the clipping.
    """

    def __init__(self, network: MLP, config: DQNConfig) -> None:
        self._sizes, self._config = network.sizes, config
        self._layout = layout(self._sizes, config.batch_size)
        self._memory = np.zeros((5, self._layout.parameters), np.float32)
        self._online = np.zeros(self._layout.activations, np.float32)
        self._target = np.zeros_like(self._online)
        self._scratch = np.zeros((4, config.batch_size * self._layout.widest), np.float32)
        self._line = np.zeros((3, self._layout.widest), np.float32)
        self._scalars = np.float32(config.gamma), np.float32(config.max_grad_norm)
        self._power_1 = self._power_2 = 1.0  # Adam's betas to the power of the updates
        last = len(self._sizes) - 2
        for layer, (w, b) in enumerate(zip(network.weights, network.biases, strict=True)):
            weights, biases = self._places(layer)
            self._memory[PARAMETERS, weights] = (w.T if layer == last else w).ravel()
            self._memory[PARAMETERS, biases] = b
        self.copy_to_target()

    def best(self, obs: NDArray[np.float32]) -> tuple[int, float]:
        """Return the best action for one observation (size,), and its value."""
        return greedy(self._memory[PARAMETERS], self._layout.table, self._line, obs)

    def learn(self, replay: NDArray[np.float32], index: NDArray[np.int64]) -> float:
        """Do one update.

        Args:
            replay: Transitions, one a row, as `cpl.policies.dqn.update.update` wants them.
            index: The mini-batch.

        Returns:
            The loss before the update.
        """
        self._power_1 *= 0.9
        self._power_2 *= 0.999
        step_size = np.float32(self._config.learning_rate / (1 - self._power_1))
        correction = np.float32(math.sqrt(1 - self._power_2))
        work = (self._online, self._target, self._scratch)
        return update(
            self._memory, self._layout.table, *work, replay, index, *self._scalars, step_size,
            correction,
        )  # fmt: skip

    def copy_to_target(self) -> None:
        """Make the target network equal to the online one."""
        self._memory[TARGET] = self._memory[PARAMETERS]

    def network(self) -> MLP:
        """Copy the online network."""
        weights, biases = [], []
        last = len(self._sizes) - 2
        for layer, shape in enumerate(zip(self._sizes[:-1], self._sizes[1:], strict=True)):
            w, b = (self._memory[PARAMETERS, place].copy() for place in self._places(layer))
            weights.append(w.reshape(shape[::-1]).T if layer == last else w.reshape(shape))
            biases.append(b)
        return MLP(tuple(weights), tuple(biases))

    def _places(self, layer: int) -> tuple[slice, slice]:
        table = self._layout.table
        w, b = int(table[1, layer]), int(table[2, layer])
        return slice(w, b), slice(b, b + int(table[0, layer + 1]))


def recent(position: int, filled: int, size: int) -> NDArray[np.int64]:
    """Return the places of the last 256 transitions of a ring of a size, or of all there are."""
    count = min(filled, 256)
    return (position - 1 - np.arange(count)) % size


def train_compiled(config: DQNConfig, task: Task, seed: int) -> tuple[MLP, pd.DataFrame]:
    """Learn; see `cpl.policies.dqn.train`."""
    config.check_vectors()
    size, actions = task.wrapper.size, task.wrapper.actions
    learner = Learner(initial_network((size, *config.hidden, actions), seed), config)
    curve = Curve(every=config.curve_every, policy_frequency=task.roads[0].policy_frequency)
    draws = np.random.RandomState(seed)  # the numbers that SB3 takes from numpy's global generator
    choices: Any = Discrete(actions, seed=seed)
    replay = np.zeros((config.buffer_size, 2 * size + 3), np.float32)
    position, exploration = 0, 0.0
    obs = task.reset()
    for step in range(1, config.steps + 1):
        if step <= config.learning_starts or draws.random_sample() < exploration:
            action = int(choices.sample())
        else:
            action, _ = learner.best(obs)
        out = task.step(action)
        ended = out.terminated or out.truncated
        row = replay[position]
        row[:size], row[size : 2 * size] = obs, out.obs
        row[2 * size :] = action, out.reward, out.terminated
        position = (position + 1) % config.buffer_size
        obs = task.reset() if ended else out.obs
        if step % config.target_update_interval == 0:
            learner.copy_to_target()
        exploration = config.exploration(step)
        curve.add(reward=out.reward, ended=ended, crashed=out.terminated, speed=out.speed)
        filled = min(step, config.buffer_size)
        if step % config.train_freq == 0 and step > config.learning_starts:
            for _ in range(config.gradient_steps):
                index = draws.randint(0, filled, size=config.batch_size)
                curve.learned(learner.learn(replay, index))
        if curve.due:
            seen = replay[recent(position, filled, config.buffer_size), :size]
            q_mean = float(np.mean([learner.best(row)[1] for row in seen]))
            curve.close(exploration=exploration, q_mean=q_mean)
    return learner.network(), curve.table()
