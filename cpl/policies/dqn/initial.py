"""The weights a training starts from: torch's own for a seed, drawn without torch."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from cpl.network import MLP

__all__ = ["initial_network"]


def initial_network(sizes: tuple[int, ...], seed: int) -> MLP:
    r"""Draw what `torch.manual_seed(seed)` and then `torch.nn.Linear` for each layer would.

    $$ W, b \sim U(-1/\sqrt{n}, 1/\sqrt{n}), \quad n \text{ the layer's inputs} $$

    torch takes the low 24 bits of a Mersenne Twister's words, numpy's legacy generator the same
    words from the same seed.

    Args:
        sizes: Units of each layer, inputs first.
        seed: torch's seed, an integer in [0, 2**32).

    Returns:
        The network.

    Example:
        >>> [round(float(b), 4) for b in initial_network((1, 2), 0).biases[0]]
        [-0.823, -0.7359]
    """
    words = np.random.RandomState(seed)
    weights, biases = [], []
    for n_in, n_out in pairwise(sizes):
        # torch's bounds take two ways to the same number; the last bit follows its way.
        bound = math.sqrt(3.0) * (math.sqrt(2.0 / (1 + math.sqrt(5) ** 2)) / math.sqrt(n_in))
        weights.append(_uniform(words, n_in * n_out, bound).reshape(n_out, n_in).T)
        biases.append(_uniform(words, n_out, 1 / math.sqrt(n_in)))
    return MLP(tuple(weights), tuple(biases))


def _uniform(words: np.random.RandomState, count: int, bound: float) -> NDArray[np.float32]:
    drawn = words.randint(0, 2**32, size=count, dtype=np.uint32) & np.uint32(0xFFFFFF)
    low, high = np.float32(-bound), np.float32(bound)
    # One rounding at the end, as a fused multiply-add has: the product is exact in float64.
    exact = drawn * 2.0**-24 * float(high - low) + float(low)
    return exact.astype(np.float32)
