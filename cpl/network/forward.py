"""A forward pass with the same bits on every machine: sums in a fixed order, no libm.

A matrix library adds in an order of its own, which depends on the processor and on how many rows
come at once.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from cpl import portable
from cpl.network.mlp import MLP

__all__ = ["Portable", "forward", "packed"]

_LINEAR, _SIGMOID = 0, 1


@njit(cache=True, error_model="numpy")
def forward(
    sizes: NDArray[np.int64], numbers: NDArray[np.float32], output: int, work: NDArray[np.float32]
) -> None:
    """Compute one row: from `work[0]`'s first numbers to `work[0]`'s first numbers.

    Args:
        sizes: Units of every layer, inputs first.
        numbers: Each layer's biases and weights in turn, as `packed` lays them out.
        output: What is done to the last layer: 0 nothing, 1 the sigmoid.
        work: Working memory, (2, units of the largest layer).
    """
    x, y = work[0], work[1]
    place = 0
    last = sizes.size - 2
    for layer in range(last + 1):
        rows, columns = sizes[layer], sizes[layer + 1]
        for j in range(columns):
            y[j] = numbers[place + j]
        place += columns
        for i in range(rows):
            value = x[i]
            if value != np.float32(0.0):  # half of all units after a rectifier
                for j in range(columns):
                    y[j] += value * numbers[place + j]
            place += columns
        for j in range(columns):
            value = y[j]
            if layer < last:
                x[j] = value if value > np.float32(0.0) else np.float32(0.0)
            elif output == _SIGMOID:
                x[j] = np.float32(1.0 / (1.0 + portable.exp(-np.float64(value))))
            else:
                x[j] = value


def packed(network: MLP) -> tuple[NDArray[np.int64], NDArray[np.float32], int]:
    """Lay a network out for `forward`: sizes, numbers, output.

    Example:
        >>> packed(MLP((np.ones((1, 2), np.float32),), (np.zeros(2, np.float32),)))[1].tolist()
        [0.0, 0.0, 1.0, 1.0]
    """
    layers = zip(network.weights, network.biases, strict=True)
    numbers = np.concatenate([part.ravel() for w, b in layers for part in (b, w)])
    output = _SIGMOID if network.output == "sigmoid" else _LINEAR
    return np.array(network.sizes, np.int64), numbers, output


@dataclass(frozen=True, eq=False)
class Portable(MLP):
    """A network whose outputs are the same bits on every machine, row by row.

    Args:
        weights: As for `MLP`.
        biases: As for `MLP`.
        output: As for `MLP`.

    Example:
        >>> net = Portable((np.eye(2, dtype=np.float32),), (np.zeros(2, np.float32),), "sigmoid")
        >>> net(np.array([[0.0, 100.0]], np.float32)).tolist()
        [[0.5, 1.0]]
    """

    @classmethod
    def of(cls, network: MLP) -> Portable:
        """Return the same network, computed so."""
        return cls(network.weights, network.biases, network.output)

    def __call__(self, x: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return the outputs; as `MLP`.

        Args:
            x: inputs, float32 (n, in).

        Returns:
            float32 (n, out).

        Raises:
            ValueError: if the inputs have another shape.
        """
        rows = np.asarray(x, np.float32)
        if rows.ndim != 2 or rows.shape[1] != self.sizes[0]:
            raise ValueError(f"x must have shape (n, {self.sizes[0]}), got {rows.shape}")
        sizes, numbers, output = packed(self)
        work = np.empty((2, max(self.sizes)), np.float32)
        found = np.empty((len(rows), self.sizes[-1]), np.float32)
        for row, out in zip(rows, found, strict=True):
            work[0, : row.size] = row
            forward(sizes, numbers, output, work)
            out[:] = work[0, : out.size]
        return found
