"""How much an agent's choice depends on each of its inputs, where it really drives."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from cpl.network import MLP

__all__ = ["flips", "gradients", "saliency"]

Singles = NDArray[np.float32]
Floats = NDArray[np.float64]


def gradients(network: MLP, x: Singles) -> Singles:
    r"""Differentiate the advantage of the best choice by the inputs.

    $$ g(x) = \nabla_x \Bigl( Q(x, a^*) - \tfrac1A \sum_a Q(x, a) \Bigr),
       \quad a^* = \arg\max_a Q(x, a) \text{ held fixed} $$

    Args:
        network: From inputs to the value of each choice.
        x: Inputs, float32 (n, in).

    Returns:
        Float32 (n, in).

    Examples:
        >>> net = MLP((np.array([[1.0, -1.0], [0.0, 4.0]], np.float32),), (np.zeros(2),))
        >>> gradients(net, np.array([[1.0, 0.0]], np.float32)).tolist()
        [[1.0, -2.0]]
    """
    layers = [np.asarray(x, np.float32)]
    for w, b in zip(network.weights[:-1], network.biases[:-1], strict=True):
        layers.append(np.maximum(layers[-1] @ w + b, np.float32(0)))
    values = layers[-1] @ network.weights[-1] + network.biases[-1]
    choices = values.shape[1]
    back = np.full(values.shape, -1 / choices, np.float32)
    back[np.arange(len(values)), values.argmax(axis=1)] += 1
    for k in range(len(network.weights) - 1, -1, -1):
        back = back @ network.weights[k].T
        if k:
            back = back * (layers[k] > 0)
    return back


def saliency(network: MLP, x: Singles, groups: Mapping[str, slice]) -> dict[str, float]:
    r"""Scale the gradient by how much each input varies, and add up over groups of inputs.

    $$ S_G = \mathrm{E} \sqrt{\sum_{i \in G} g_i(x)^2\, \mathrm{Var}(x_i)} $$

    Args:
        network: The agent.
        x: Inputs where it drives, float32 (n, in).
        groups: Which inputs belong together.

    Returns:
        By group, in units of value.
    """
    each = (gradients(network, x).astype(np.float64) * x.std(axis=0, dtype=np.float64)) ** 2
    return {
        name: float(np.sqrt(each[:, group].sum(axis=1)).mean()) for name, group in groups.items()
    }


def flips(
    network: MLP, x: Singles, groups: Mapping[str, slice], rng: np.random.Generator
) -> dict[str, float]:
    """Give a group of inputs the values of another moment, and count how often the choice changes.

    Args:
        network: The agent.
        x: Inputs where it drives, float32 (n, in).
        groups: Which inputs belong together.
        rng: Deals the moments.

    Returns:
        By group, the share of moments.
    """
    chosen = network(x).argmax(axis=1)
    found = {}
    for name, group in groups.items():
        other = x.copy()
        other[:, group] = x[rng.permutation(len(x)), group]
        found[name] = float(np.mean(network(other).argmax(axis=1) != chosen))
    return found
