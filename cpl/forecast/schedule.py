"""Settings and results of training; without torch, for modules that only read them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cpl.network import MLP

__all__ = ["Epoch", "Fit", "Loss", "Moments", "Schedule"]

Loss = Literal["mse", "gaussian", "cross entropy"]


@dataclass(frozen=True, kw_only=True)
class Schedule:
    """How long and how a network is trained.

    It has converged when the best validation loss of the last `patience` epochs is not at least a
    share `tolerance` below the best one before them. The weights of the best epoch are kept.

    Attributes:
        lr: learning rate of Adam, the paper's 0.001, held constant.
        batch: samples in a step [-].
        tolerance: relative improvement that counts [-].
        patience: epochs without one after which training ends [epochs].
        epochs: most epochs; a network that gets so far has not converged.
    """

    lr: float = 1e-3
    batch: int = 512
    tolerance: float = 0.01
    patience: int = 3
    epochs: int


class Moments(NamedTuple):
    """Where the samples are: histories are gathered by place, never copied as a whole.

    Attributes:
        inputs: all histories, float32 (m, in), usually an overlapping view.
        targets: what is learned, float32, one for each history, (m,).
        train: rows to learn from, int64.
        validation: rows that say when to stop, int64.
    """

    inputs: NDArray[np.float32]
    targets: NDArray[np.float32]
    train: NDArray[np.int64]
    validation: NDArray[np.int64]


class Epoch(NamedTuple):
    """Losses of one epoch: the mean over its batches, and on the validation rows after it."""

    train: float
    validation: float


@dataclass(frozen=True, eq=False)
class Fit:
    """A trained network.

    Attributes:
        network: the weights of the best epoch.
        curve: losses, an entry an epoch.
        converged: whether the rule of `Schedule` ended the training.
    """

    network: MLP
    curve: tuple[Epoch, ...]
    converged: bool
