"""One update of deep Q-learning, compiled: two forward passes, the gradient, its clipping, Adam.

Activations are stored unit by unit, a mini-batch's numbers side by side; "by sample" marks the few
that are stored the other way round. Parameters, target, Adam's two moments and the gradient are the
rows of one array. A layer's weights are stored (in, out), the last layer's (out, in).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cpl.policies.dqn.tiles import address, kernel, multiply

__all__ = ["GRADIENT", "PARAMETERS", "TARGET", "Layout", "greedy", "layout", "update"]

_BETA_1 = np.float32(0.9)
_BETA_2 = np.float32(0.999)
_NEW_1 = np.float32(1 - 0.9)
_NEW_2 = np.float32(1 - 0.999)
_EPSILON = np.float32(1e-8)
_ZERO, _ONE = np.float32(0), np.float32(1)
# Moments of silent units decay into denormal numbers, which processors are slow at. Below these
# bounds they move no weight: the step is at most 1e-30 / 1e-8 of the learning rate.
_FLUSH_1 = np.float32(1e-30)
_FLUSH_2 = np.float32(1e-36)


PARAMETERS, TARGET, FIRST, SECOND, GRADIENT = range(5)
"""Rows of the learner's memory, each with all parameters."""


class Layout(NamedTuple):
    """Where a network's numbers are.

    `table` holds for each layer of units its size, the place of the weights and of the biases that
    lead away from it, and of its activations, int64 (4, layers); `parameters` and `activations` are
    the numbers in all, `widest` the size of the largest layer.
    """

    table: NDArray[np.int64]
    parameters: int
    activations: int
    widest: int


def layout(sizes: tuple[int, ...], batch: int) -> Layout:
    """Place the parameters and a mini-batch's activations.

    Args:
        sizes: Units of each layer, inputs first.
        batch: Samples in a mini-batch.

    Returns:
        The layout.

    Example:
        >>> layout((2, 16, 3), 16).table.tolist()
        [[2, 16, 3], [0, 48, 0], [32, 96, 0], [0, 32, 288]]
    """
    table = np.zeros((4, len(sizes)), np.int64)
    place = act = 0
    for i, size in enumerate(sizes):
        table[0, i], table[3, i] = size, act
        act += size * batch
        if i + 1 < len(sizes):
            table[1, i] = place
            table[2, i] = place + size * sizes[i + 1]
            place += (size + 1) * sizes[i + 1]
    return Layout(table, place, act, max(sizes))


@kernel
def greedy(
    parameters: np.ndarray, table: np.ndarray, line: np.ndarray, observation: np.ndarray
) -> tuple:
    """Find the action of the largest value, the first of equals.

    Args:
        parameters: The network.
        table: Of its `Layout`.
        line: Working memory, float32 (3, widest).
        observation: float32 (inputs,).

    Returns:
        The action and its value.
    """
    layers = table.shape[1] - 1
    line[0, : table[0, 0]] = observation
    line[2] = _ZERO
    for layer in range(layers - 1):
        n_in, n_out = table[0, layer], table[0, layer + 1]
        source, out = layer % 2, (layer + 1) % 2
        weights = address(parameters, table[1, layer])
        left, into = address(line, source * line.shape[1]), address(line, out * line.shape[1])
        start = address(line, 2 * line.shape[1])
        multiply(left, 0, 1, weights, n_out, into, start, 1, n_out, n_in)
        _add_rectified(line[out, :n_out], parameters[table[2, layer] : table[2, layer] + n_out])
    last = layers - 1
    best, action = _ZERO, 0
    for a in range(table[0, layers]):
        value = parameters[table[2, last] + a]
        row = parameters[table[1, last] + a * table[0, last] :]
        for k in range(table[0, last]):
            value += line[last % 2, k] * row[k]
        if a == 0 or value > best:
            best, action = value, a
    return action, best


@kernel
def update(
    memory: np.ndarray,
    table: np.ndarray,
    online: np.ndarray,
    target: np.ndarray,
    scratch: np.ndarray,
    replay: np.ndarray,
    index: np.ndarray,
    gamma: np.float32,
    max_norm: np.float32,
    step_size: np.float32,
    correction: np.float32,
) -> float:
    r"""Do one update on a mini-batch.

    $$ y = r + (1 - d)\,\gamma \max_{a'} Q^-(s', a'), \qquad
       L = \tfrac1B \sum_b \text{huber}(Q(s, a) - y) $$

    Args:
        memory: float32 (5, parameters), see `PARAMETERS`.
        table: Of the network's `Layout`.
        online: Working memory, float32 (activations,).
        target: The same for the target network.
        scratch: Working memory, float32 (4, batch * widest); its last row is all zeros.
        replay: float32 (transitions, 2 inputs + 3): observation, next one, action, reward, and
            whether the episode terminated (not: ran out of time).
        index: The mini-batch, int64 (batch,).
        gamma: Discount a decision.
        max_norm: Longer gradients are scaled to this length.
        step_size: Learning rate / (1 - beta_1^t).
        correction: sqrt(1 - beta_2^t).

    Returns:
        The loss before the update.
    """
    parameters, gradient = memory[PARAMETERS], memory[GRADIENT]
    batch, layers, inputs = index.shape[0], table.shape[1] - 1, table[0, 0]
    _gather(replay, index, 0, inputs, online)
    _gather(replay, index, inputs, inputs, target)
    _forward(parameters, table, online, batch)
    _forward(memory[TARGET], table, target, batch)
    loss = _last_layer(parameters, gradient, table, online, target, scratch, replay, index, gamma)
    zeros = address(scratch, 3 * scratch.shape[1])
    for layer in range(layers - 2, -1, -1):
        n_in, n_out = table[0, layer], table[0, layer + 1]
        below, weights = table[3, layer], table[1, layer]
        by_sample = address(scratch, 0)
        into = address(gradient, weights)
        multiply(
            address(online, below), batch, 1, by_sample, n_out, into, zeros, n_in, n_out, batch
        )
        _sum_samples(scratch, n_out, batch, gradient, table[2, layer])
        if layer > 0:
            _transpose(scratch[0], batch, n_out, scratch[1])
            left, right, out = address(parameters, weights), scratch.shape[1], scratch.shape[1] * 2
            multiply(
                left, n_out, 1, address(scratch, right), batch,
                address(scratch, out), zeros, n_in, batch, n_out,
            )  # fmt: skip
            _mask(online[below : below + n_in * batch], scratch[2])
            _transpose(scratch[2], n_in, batch, scratch[0])
    _adam(memory, _clip(gradient, max_norm), step_size, correction)
    return loss


@kernel
def _gather(
    replay: np.ndarray, index: np.ndarray, first: int, columns: int, out: np.ndarray
) -> None:
    batch = index.shape[0]
    for b in range(batch):
        for k in range(columns):
            out[k * batch + b] = replay[index[b], first + k]


@kernel
def _forward(parameters: np.ndarray, table: np.ndarray, acts: np.ndarray, batch: int) -> None:
    layers = table.shape[1] - 1
    for layer in range(layers):
        n_in, n_out, out = table[0, layer], table[0, layer + 1], table[3, layer + 1]
        last = layer == layers - 1
        multiply(
            address(parameters, table[1, layer]),
            n_in if last else 1,
            1 if last else n_out,
            address(acts, table[3, layer]),
            batch,
            address(acts, out),
            address(parameters, table[2, layer]),
            n_out,
            batch,
            n_in,
        )
        if not last:
            _rectify(acts[out : out + n_out * batch])


@kernel
def _last_layer(
    parameters: np.ndarray,
    gradient: np.ndarray,
    table: np.ndarray,
    online: np.ndarray,
    target: np.ndarray,
    scratch: np.ndarray,
    replay: np.ndarray,
    index: np.ndarray,
    gamma: np.float32,
) -> float:
    """Compute the loss, the last layer's gradient, and the one below it, by sample."""
    batch, layers, inputs = index.shape[0], table.shape[1] - 1, table[0, 0]
    last, width, actions = layers - 1, table[0, layers - 1], table[0, layers]
    weights, biases, values = table[1, last], table[2, last], table[3, layers]
    share = _ONE / np.float32(batch)
    gradient[weights : weights + (width + 1) * actions] = _ZERO
    _transpose(online[table[3, last] :], width, batch, scratch[1])
    loss = 0.0
    for b in range(batch):
        row = replay[index[b]]
        action, reward, terminal = int(row[2 * inputs]), row[2 * inputs + 1], row[2 * inputs + 2]
        best = target[values + b]
        for a in range(1, actions):
            best = max(best, target[values + a * batch + b])
        error = online[values + action * batch + b] - (reward + (_ONE - terminal) * gamma * best)
        size = abs(error)
        loss += 0.5 * error * error if size < _ONE else size - 0.5
        slope = min(max(error, -_ONE), _ONE) * share
        gradient[biases + action] += slope
        place = weights + action * width
        here = slice(place, place + width)
        units = slice(b * width, (b + 1) * width)
        _back(scratch[1, units], slope, parameters[here], gradient[here], scratch[0, units])
    return loss / batch


@kernel
def _back(
    units: np.ndarray, slope: float, weights: np.ndarray, gradient: np.ndarray, below: np.ndarray
) -> None:
    for i in range(units.shape[0]):
        gradient[i] += units[i] * slope
        below[i] = weights[i] * slope if units[i] > _ZERO else _ZERO


@kernel
def _rectify(units: np.ndarray) -> None:
    for i in range(units.shape[0]):
        units[i] = _ZERO if units[i] < _ZERO else units[i]


@kernel
def _add_rectified(units: np.ndarray, biases: np.ndarray) -> None:
    for i in range(units.shape[0]):
        total = units[i] + biases[i]
        units[i] = _ZERO if total < _ZERO else total


@kernel
def _mask(units: np.ndarray, gradient: np.ndarray) -> None:
    for i in range(units.shape[0]):
        gradient[i] = gradient[i] if units[i] > _ZERO else _ZERO


@kernel
def _transpose(source: np.ndarray, rows: int, columns: int, out: np.ndarray) -> None:
    # The shorter side inside: as many cache lines are in use as the first-level cache has room for.
    if rows < columns:
        for j in range(columns):
            for i in range(rows):
                out[j * rows + i] = source[i * columns + j]
    else:
        for i in range(rows):
            for j in range(columns):
                out[j * rows + i] = source[i * columns + j]


@kernel
def _sum_samples(
    scratch: np.ndarray, units: int, batch: int, gradient: np.ndarray, place: int
) -> None:
    total = gradient[place : place + units]
    total[:] = _ZERO
    for b in range(batch):
        row = scratch[0, b * units : (b + 1) * units]
        for o in range(units):
            total[o] += row[o]


@kernel
def _clip(gradient: np.ndarray, max_norm: np.float32) -> np.float32:
    """Return what the gradient is multiplied with, as torch's clip_grad_norm_ does."""
    lanes = np.zeros(64, np.float32)
    whole = gradient.shape[0] // 64 * 64
    for i in range(0, whole, 64):
        for j in range(64):
            lanes[j] += gradient[i + j] * gradient[i + j]
    total = 0.0
    for j in range(64):
        total += lanes[j]
    for i in range(whole, gradient.shape[0]):
        total += gradient[i] * gradient[i]
    return min(max_norm / (np.float32(np.sqrt(total)) + np.float32(1e-6)), _ONE)


@kernel
def _adam(
    memory: np.ndarray, scale: np.float32, step_size: np.float32, correction: np.float32
) -> None:
    parameters, gradient = memory[PARAMETERS], memory[GRADIENT]
    first, second = memory[FIRST], memory[SECOND]
    for i in range(parameters.shape[0]):
        g = gradient[i] * scale
        m = first[i] + _NEW_1 * (g - first[i])
        v = _BETA_2 * second[i] + _NEW_2 * g * g
        m = _ZERO if -_FLUSH_1 < m < _FLUSH_1 else m
        v = _ZERO if v < _FLUSH_2 else v
        first[i], second[i] = m, v
        parameters[i] -= step_size * m / (np.sqrt(v) / correction + _EPSILON)
