"""How is the predictor trained? Weighted binary cross entropy on the zig-zags' logs.

Paper: Section V-B. Optimiser, learning rate, epochs and split are not stated (contradiction 11);
here Adam on shuffled batches, and whole trajectories are held out, because two rows of one run are
nearly the same row.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from cpl.quadruped.predictor import Predictor
from cpl.settings.ranges import Count, Positive, Settings

if TYPE_CHECKING:
    import torch

__all__ = ["Run", "TrainingConfig", "auc", "train"]

Run = tuple[NDArray[np.float64], NDArray[np.float64]]


@dataclass(frozen=True, kw_only=True)
class TrainingConfig(Settings):
    """How to train.

    Args:
        units: Hidden units [-]; the paper's 128.
        positive_weight: Weight of a positive sample in the loss [-]; the paper's 5.
        learning_rate: Adam's step [-].
        weight_decay: Decoupled L2 decay a step [-].
        epochs: Passes over the data [-].
        batch: Rows a step [-].
    """

    units: Count = 128
    positive_weight: Positive = 5.0
    learning_rate: Positive = 1e-3
    weight_decay: float = 1e-2
    epochs: Count = 40
    batch: Count = 128


def train(runs: Sequence[Run], config: TrainingConfig, seed: int) -> Predictor:
    """Train the predictor; the same runs, configuration and seed give the same weights.

    loss = mean( -w l log l_hat - (1 - l) log(1 - l_hat) ),   w = positive_weight

    Paper: Section V-B.

    Args:
        runs: Features (T, 47) and labels (T,) of each run.
        config: How.
        seed: Draws the initial weights and the order of the rows.

    Returns:
        The trained predictor.

    Raises:
        ValueError: No rows, or labels of one kind only.
    """
    import torch

    x = np.concatenate([features for features, _ in runs])
    y = np.concatenate([label for _, label in runs])
    if len(np.unique(y)) < 2:
        raise ValueError(f"runs must hold labels of both kinds, not {np.unique(y).tolist()} alone")
    mean, std = x.mean(axis=0), np.maximum(x.std(axis=0), 1e-3)
    threads = torch.get_num_threads()
    torch.set_num_threads(1)  # a network this small loses more to threads than it gains
    try:
        weights = _fit((x - mean) / std, y, config, seed)
    finally:
        torch.set_num_threads(threads)
    return Predictor(mean=mean, std=std, **weights)


def auc(score: NDArray[np.float64], label: NDArray[np.float64]) -> float:
    """Return the probability that a positive scores above a negative, ties counted half.

    Args:
        score: Shape (T,).
        label: 0 or 1, shape (T,).

    Returns:
        In [0, 1]; NaN where one kind is missing.

    >>> auc(np.array([0.1, 0.4, 0.4, 0.9]), np.array([0.0, 0.0, 1.0, 1.0]))
    0.875
    """
    positive, negative = score[label != 0], np.sort(score[label == 0])
    if not len(positive) or not len(negative):
        return float("nan")
    below = np.searchsorted(negative, positive, side="left")
    upto = np.searchsorted(negative, positive, side="right")
    return float((below + upto).mean() / 2 / len(negative))


def _fit(
    x: NDArray[np.float64], y: NDArray[np.float64], config: TrainingConfig, seed: int
) -> dict[str, NDArray[np.float64]]:
    """Return the weights after all epochs."""
    import torch

    generator = torch.Generator().manual_seed(seed)
    inputs, targets = torch.from_numpy(x).float(), torch.from_numpy(y).float()
    parameters = _initial(inputs.shape[1], config.units, generator)
    w1, b1, w2, b2 = parameters
    optimiser = torch.optim.AdamW(
        parameters, lr=config.learning_rate, weight_decay=config.weight_decay
    )
    weight = torch.tensor(config.positive_weight)
    for _ in range(config.epochs):
        order = torch.randperm(len(targets), generator=generator)
        for rows in order.split(config.batch):
            logit = torch.relu(inputs[rows] @ w1.T + b1) @ w2 + b2
            loss = torch.nn.functional.binary_cross_entropy_with_logits(
                logit, targets[rows], pos_weight=weight
            )
            optimiser.zero_grad()
            loss.backward()
            optimiser.step()
    names = ("w1", "b1", "w2", "b2")
    return {n: p.detach().double().numpy() for n, p in zip(names, parameters, strict=True)}


def _initial(inputs: int, units: int, generator: torch.Generator) -> list[torch.Tensor]:
    """Return weights uniform in +-1/sqrt(fan-in), as torch.nn.Linear draws them."""
    import torch

    def uniform(*shape: int, fan_in: int) -> torch.Tensor:
        bound = fan_in**-0.5
        return ((2 * torch.rand(shape, generator=generator) - 1) * bound).requires_grad_()

    return [
        uniform(units, inputs, fan_in=inputs),
        uniform(units, fan_in=inputs),
        uniform(units, fan_in=units),
        uniform(fan_in=units),
    ]
