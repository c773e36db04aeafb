"""The driver that takes the action of the largest value."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cpl.network import MLP

__all__ = ["Greedy"]


@dataclass(frozen=True)
class Greedy:
    r"""Drive a batch by a network of action values.

    $$ \pi(x) = \arg\max_a Q(x, a) $$

    Paper: Section IV, Base Policies Training.

    Args:
        network: Q, from a flattened observation to a value for each action.

    Example:
        >>> q = MLP((np.array([[1.0, -1.0], [0.0, 0.0]], np.float32),), (np.zeros(2, np.float32),))
        >>> Greedy(q)(np.array([[[2.0, 0.0]], [[-2.0, 0.0]]], np.float32)).tolist()
        [0, 1]
    """

    network: MLP

    def __call__(self, obs: NDArray[np.float32]) -> NDArray[np.int64]:
        """Choose the actions, the first of equals.

        Args:
            obs: observations, float32 (n, rows, features) or (n, rows * features).

        Returns:
            Actions, int64 (n,).

        Raises:
            ValueError: if an observation has another size than the network's input.
        """
        return self.values(obs).argmax(axis=1)

    def values(self, obs: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return the value of each action.

        Args:
            obs: as for a call.

        Returns:
            float32 (n, actions).

        Raises:
            ValueError: if an observation has another size than the network's input.
        """
        size = int(np.prod(np.shape(obs)[1:]))
        return self.network(np.reshape(obs, (len(obs), size)))
