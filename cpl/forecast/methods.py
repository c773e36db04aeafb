"""Forecasters: what comes in three seconds, and how uncertain that is, by every method compared.

Each takes histories (n, length * width) and returns the forecast l_hat and its uncertainty, both
(n,). The uncertainty is the method's own times a `scale`: 1 as published, and what calibration on
the training range gave otherwise. The paper's own method has none here: its quantile comes from
`cpl.conformal`, which adds it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cpl.forecast.errors import HistoryShapeError
from cpl.network import MLP
from cpl.stats import split_conformal_rank

__all__ = [
    "METHODS",
    "Certificates",
    "Constant",
    "Dropout",
    "Ensemble",
    "Forecaster",
    "Heteroscedastic",
    "Plain",
    "calibrate",
    "features",
]

METHODS = ("conformal", "none", "dropout", "ensemble", "hau", "certificates")
"""The paper's comparison: its own, No Quantile, and four estimates of uncertainty."""

Floats = NDArray[np.float32]
Guess = tuple[Floats, Floats | None]

_RAYS = 1 << 16  # values of a 16-bit draw, which decides whether a unit is dropped


@dataclass(frozen=True, eq=False)
class Plain:
    """The network alone; the paper's "No Quantile", and what a tracked quantile is added to.

    Args:
        network: histories to l_hat.

    Example:
        >>> net = MLP((np.zeros((2, 1), np.float32),), (np.zeros(1, np.float32),), "sigmoid")
        >>> Plain(net)(np.ones((1, 2), np.float32))
        (array([0.5], dtype=float32), None)
    """

    network: MLP

    def __call__(self, flat: Floats) -> Guess:
        """Return l_hat and no uncertainty."""
        return self.network(_checked(flat, self.network))[:, 0], None


@dataclass(frozen=True, eq=False)
class Constant:
    """The network and one number for all times: split conformal prediction.

    Args:
        network: histories to l_hat.
        scale: the number, a quantile of the scores on calibration data.
    """

    network: MLP
    scale: float

    def __call__(self, flat: Floats) -> Guess:
        """Return l_hat and the constant."""
        l_hat = self.network(_checked(flat, self.network))[:, 0]
        return l_hat, np.full(len(l_hat), self.scale, np.float32)


@dataclass(frozen=True, eq=False)
class Dropout:
    """Mean and standard deviation of passes in which units are dropped (Gal, Ghahramani 2016).

    The paper: "a 0.1 dropout rate at each linear layer ... from five runs". Ruling: the outputs of
    each hidden layer are dropped, here as in training. Dropping the observations too, as Gal and
    Ghahramani's derivation allows, costs the forecast much of its skill.

    Args:
        network: trained with dropout.
        rng: draws the dropped units.
        rate: probability with which a unit is dropped [-].
        passes: forward passes.
        scale: factor of the uncertainty.
    """

    network: MLP
    rng: np.random.Generator
    rate: float = 0.1
    passes: int = 5
    scale: float = 1.0

    def __call__(self, flat: Floats) -> Guess:
        """Return the mean and the scaled deviation of the passes."""
        x = _checked(flat, self.network)
        many = np.concatenate([x] * self.passes)
        return _spread(self._pass(many).reshape(self.passes, len(x)), self.scale)

    def _pass(self, x: Floats) -> Floats:
        net, dropped = self.network, round(self.rate * _RAYS)
        factor = np.float32(_RAYS / (_RAYS - dropped))
        h = x @ net.weights[0] + net.biases[0]
        for w, b in zip(net.weights[1:], net.biases[1:], strict=True):
            kept = self.rng.integers(0, _RAYS, h.shape, np.uint16) >= dropped
            h = (np.maximum(h, np.float32(0.0)) * (factor * kept)) @ w + b
        return _sigmoid(h[:, 0])


@dataclass(frozen=True, eq=False)
class Ensemble:
    """Mean and standard deviation of several networks (Lakshminarayanan et al. 2017).

    The paper trains five on disjoint parts of the data.

    Args:
        networks: the members, of one shape.
        scale: factor of the uncertainty.
    """

    networks: Sequence[MLP]
    scale: float = 1.0

    def __call__(self, flat: Floats) -> Guess:
        """Return the mean and the scaled deviation of the members."""
        x = _checked(flat, self.networks[0])
        return _spread(np.stack([net(x)[:, 0] for net in self.networks]), self.scale)


@dataclass(frozen=True, eq=False)
class Heteroscedastic:
    r"""A network that says how noisy its target is (HAU; Kendall, Gal 2017).

    $$ (f, s) = \text{net}(x), \qquad \hat l = \sigma(f), \quad u = e^{s/2} $$

    Args:
        network: two linear outputs, the forecast before its sigmoid and the log of the variance.
        scale: factor of the uncertainty.
    """

    network: MLP
    scale: float = 1.0

    def __call__(self, flat: Floats) -> Guess:
        """Return the mean and the scaled deviation that the network states."""
        out = self.network(_checked(flat, self.network))
        return _sigmoid(out[:, 0]), np.float32(self.scale) * np.exp(np.float32(0.5) * out[:, 1])


@dataclass(frozen=True, eq=False)
class Certificates:
    r"""How far a state's features are from where all training data lie (Tagasovska 2019).

    $$ u = \tfrac1k \lVert C^\top \phi(x) + b \rVert^2 $$

    for k orthonormal functions that are 0 on the training data, and phi the predictor's
    second-to-last hidden layer.

    Args:
        network: histories to l_hat.
        weight: C, float32 (units, k).
        bias: b, float32 (k,).
        scale: factor of the uncertainty; it has no unit of its own.
    """

    network: MLP
    weight: Floats
    bias: Floats
    scale: float = 1.0

    def __call__(self, flat: Floats) -> Guess:
        """Return l_hat and the scaled mean square of the certificates."""
        net = self.network
        phi = features(net, _checked(flat, net))
        last = MLP(net.weights[-2:], net.biases[-2:], net.output)
        distance = np.square(phi @ self.weight + self.bias).mean(axis=1)
        return last(phi)[:, 0], np.float32(self.scale) * distance


Forecaster = Plain | Constant | Dropout | Ensemble | Heteroscedastic | Certificates


def features(network: MLP, flat: Floats) -> Floats:
    """Return the activations of the second-to-last hidden layer, float32 (n, units)."""
    return MLP(network.weights[:-1], network.biases[:-1]).hidden(flat)


def calibrate(score: Floats, uncertainty: Floats | None, alpha: float) -> float:
    r"""Find the scale at which a share 1 - alpha of calibration scores is covered.

    $$ \lambda = \text{the } \lceil (1-\alpha)(n+1) \rceil \text{-th smallest } s_i / u_i $$

    Split conformal prediction with the score s / u; without an uncertainty u = 1, and the scale is
    a constant quantile of the scores.

    Args:
        score: |l_tilde - l_hat| on data kept for this, (n,).
        uncertainty: of the same forecasts, (n,), or None.
        alpha: miscoverage aimed at [-].

    Returns:
        The scale; infinite if there are too few scores for alpha.

    Raises:
        ValueError: if there are no scores, or the shapes differ.

    >>> round(calibrate(np.arange(1, 10) / 10, None, alpha=0.1), 6)
    0.9
    """
    s = np.asarray(score, np.float64)
    u = np.ones_like(s) if uncertainty is None else np.asarray(uncertainty, np.float64)
    if s.ndim != 1 or not len(s) or u.shape != s.shape:
        raise ValueError(f"score and uncertainty must be vectors, got {s.shape} and {u.shape}")
    rank = split_conformal_rank(len(s), alpha)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.where(s == 0.0, 0.0, s / u)
    return float(np.sort(ratio)[rank - 1]) if rank <= len(s) else np.inf


def _checked(flat: Floats, network: MLP) -> Floats:
    x = np.asarray(flat, np.float32)
    if x.ndim != 2 or x.shape[1] != network.sizes[0]:
        raise HistoryShapeError(
            f"flat must have shape (n, {network.sizes[0]}), what the forecaster was trained on,"
            f" got {x.shape}"
        )
    return x


def _spread(guesses: Floats, scale: float) -> Guess:
    return guesses.mean(axis=0), np.float32(scale) * guesses.std(axis=0)


def _sigmoid(h: Floats) -> Floats:
    half = np.float32(0.5)
    return half * (np.float32(1.0) + np.tanh(half * h))
