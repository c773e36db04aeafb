"""Train the predictor and its relatives until the validation loss has stopped falling.

torch is imported here and nowhere else below the experiments: using what was trained needs numpy
only. Weights and batches are drawn from a numpy generator, none from torch's global one.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import Literal

import numpy as np
import torch
from numpy.typing import NDArray
from torch.nn import functional

from cpl.forecast.errors import NoRolloutsError, TrainingDivergedError
from cpl.forecast.schedule import Epoch, Fit, Loss, Moments, Schedule
from cpl.network import MLP

__all__ = ["fit"]

_RAYS = 1 << 16  # values of a 16-bit draw, which decides whether a unit is dropped
_CHUNK = 1 << 15  # validation samples at a time


def fit(
    sizes: tuple[int, ...],
    data: Moments,
    schedule: Schedule,
    rng: np.random.Generator,
    *,
    loss: Loss = "mse",
    dropout: float = 0.0,
) -> Fit:
    r"""Train a network with Adam and mini-batches.

    The losses are the squared error of $\sigma(f)$, the cross entropy of $\sigma(f)$, and for two
    outputs the Gaussian likelihood with the variance's logarithm $s$ (Kendall and Gal 2017):

    $$ \tfrac12 e^{-s} (\tilde l - \hat l)^2 + \tfrac12 s $$

    Args:
        sizes: units of every layer, inputs first; the last is 2 for "gaussian" and else 1.
        data: the samples.
        schedule: when to stop.
        rng: initial weights, order of the samples, dropped units.
        loss: which one.
        dropout: probability with which each hidden unit is dropped in training [-].

    Returns:
        The network; with a linear output for "gaussian", else with a sigmoid.

    Raises:
        NoRolloutsError: if there are no training or no validation samples.
        TrainingDivergedError: if a loss is not finite.
    """
    if not (len(data.train) and len(data.validation)):
        counts = f"{len(data.train)} and {len(data.validation)}"
        raise NoRolloutsError(f"train and validation must have samples, got {counts}")
    torch.set_num_threads(1)  # more only wait for each other on layers this small
    net = _Net(sizes, rng, loss, dropout)
    optimiser = torch.optim.Adam(net.parameters, lr=schedule.lr, fused=True)
    curve: list[Epoch] = []
    best: tuple[float, MLP] = (np.inf, net.frozen())
    converged = False
    while not converged and len(curve) < schedule.epochs:
        total = 0.0
        order = rng.permutation(data.train)
        for first in range(0, len(order), schedule.batch):
            rows = order[first : first + schedule.batch]
            value = net.loss(data.inputs[rows], data.targets[rows], rng)
            optimiser.zero_grad()
            value.backward()
            optimiser.step()
            total += float(value.detach()) * len(rows)
        curve.append(Epoch(total / len(order), _validation(net, data)))
        if not np.isfinite(curve[-1]).all():
            raise TrainingDivergedError(
                f"losses must stay finite, got {curve[-1]} in epoch {len(curve)}"
            )
        if curve[-1].validation < best[0]:
            best = (curve[-1].validation, net.frozen())
        converged = _has_converged([e.validation for e in curve], schedule)
    return Fit(best[1], tuple(curve), converged)


def _has_converged(losses: list[float], schedule: Schedule) -> bool:
    late, early = losses[-schedule.patience :], losses[: -schedule.patience]
    return bool(early) and min(late) > min(early) - schedule.tolerance * abs(min(early))


def _validation(net: _Net, data: Moments) -> float:
    rows, total = data.validation, 0.0
    with torch.no_grad():
        for first in range(0, len(rows), _CHUNK):
            part = rows[first : first + _CHUNK]
            total += float(net.loss(data.inputs[part], data.targets[part])) * len(part)
    return total / len(rows)


class _Net:
    """Layers as bare tensors, so that they become an `MLP` without a detour."""

    def __init__(
        self, sizes: tuple[int, ...], rng: np.random.Generator, loss: Loss, dropout: float
    ) -> None:
        self.weights: list[torch.Tensor] = []
        self.biases: list[torch.Tensor] = []
        for inputs, units in pairwise(sizes):
            half = 1 / np.sqrt(inputs)  # what torch.nn.Linear draws from
            self.weights.append(_uniform(rng, half, (inputs, units)))
            self.biases.append(_uniform(rng, half, (units,)))
        self.parameters = [*self.weights, *self.biases]
        self._measure = _LOSSES[loss]
        self._output: Literal["linear", "sigmoid"] = "linear" if loss == "gaussian" else "sigmoid"
        self._dropped = round(dropout * _RAYS)

    def loss(
        self,
        inputs: NDArray[np.float32],
        targets: NDArray[np.float32],
        rng: np.random.Generator | None = None,
    ) -> torch.Tensor:
        """Mean loss of a batch; units are dropped only where a generator is given."""
        h = torch.from_numpy(inputs)
        last = len(self.weights) - 1
        for i, (w, b) in enumerate(zip(self.weights, self.biases, strict=True)):
            if self._dropped and rng is not None and i > 0:
                h = h * self._mask(rng, tuple(h.shape))
            h = torch.addmm(b, h, w)
            h = h if i == last else torch.relu(h)
        return self._measure(h, torch.from_numpy(targets))

    def frozen(self) -> MLP:
        """The present weights, copied."""
        return MLP(
            tuple(w.detach().numpy().copy() for w in self.weights),
            tuple(b.detach().numpy().copy() for b in self.biases),
            self._output,
        )

    def _mask(self, rng: np.random.Generator, shape: tuple[int, ...]) -> torch.Tensor:
        kept = rng.integers(0, _RAYS, shape, np.uint16) >= self._dropped
        return torch.from_numpy(kept * np.float32(_RAYS / (_RAYS - self._dropped)))


def _uniform(rng: np.random.Generator, half: float, shape: tuple[int, ...]) -> torch.Tensor:
    drawn = rng.uniform(-half, half, shape).astype(np.float32)
    return torch.from_numpy(drawn).requires_grad_()


def _squared(h: torch.Tensor, y: torch.Tensor) -> torch.Tensor:
    return functional.mse_loss(torch.sigmoid(h[:, 0]), y)


def _gaussian(h: torch.Tensor, y: torch.Tensor) -> torch.Tensor:
    s = h[:, 1]
    return 0.5 * (torch.exp(-s) * (y - torch.sigmoid(h[:, 0])) ** 2 + s).mean()


def _entropy(h: torch.Tensor, y: torch.Tensor) -> torch.Tensor:
    return functional.binary_cross_entropy_with_logits(h[:, 0], y)


_LOSSES: dict[Loss, Callable[[torch.Tensor, torch.Tensor], torch.Tensor]] = {
    "mse": _squared,
    "gaussian": _gaussian,
    "cross entropy": _entropy,
}
