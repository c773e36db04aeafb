"""Train orthonormal certificates: many directions in which the training data do not vary."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cpl.forecast.errors import NoRolloutsError, TrainingDivergedError

__all__ = ["CertificateFit", "fit_certificates"]

_BETA, _GAMMA, _TINY = 0.9, 0.999, 1e-8  # Adam's own constants


@dataclass(frozen=True, eq=False)
class CertificateFit:
    """Trained certificates.

    Attributes:
        weight: C, float32 (units, k).
        bias: b, float32 (k,).
        curve: mean square of the certificates on the training data, an entry an epoch.
        penalty: mean square of C'C - I at the end.
    """

    weight: NDArray[np.float32]
    bias: NDArray[np.float32]
    curve: tuple[float, ...]
    penalty: float


def fit_certificates(
    phi: NDArray[np.float32],
    rng: np.random.Generator,
    *,
    k: int = 100,
    epochs: int = 100,
    steps: int = 100,
    lr: float = 1e-3,
) -> CertificateFit:
    r"""Learn k linear functions that are 0 on the data, and orthonormal.

    $$ \frac1{nk} \sum_i \lVert C^\top \phi_i + b \rVert^2
       + \frac1{k^2} \lVert C^\top C - I \rVert_F^2 $$

    Tagasovska and Lopez-Paz 2019, with the mean squares and the weight 1 of their code, and Adam.
    The first term is quadratic in the features, so their second moments are all it needs of the
    data: every step here uses all of them.

    Args:
        phi: features of the training data, float32 (n, units).
        rng: initial weights.
        k: certificates, the paper's 100.
        epochs: epochs, the paper's 100.
        steps: steps an epoch.
        lr: learning rate of Adam.

    Returns:
        The certificates.

    Raises:
        NoRolloutsError: if there are no features.
        TrainingDivergedError: if the loss is not finite.

    Example:
        >>> rng = np.random.default_rng(0)
        >>> flat = np.array([[1.0, 0.0], [-1.0, 0.0]], np.float32)  # no variation in the second
        >>> np.abs(fit_certificates(flat, rng, k=1, epochs=20).weight.ravel()).round(2).tolist()
        [0.0, 1.0]
    """
    if not len(phi):
        raise NoRolloutsError("phi must hold the features of at least one sample, got none")
    moments = _second_moments(phi)
    units = phi.shape[1]
    half = 1 / np.sqrt(units)  # what torch.nn.Linear draws from
    w = rng.uniform(-half, half, (units + 1, k))
    first, second = np.zeros_like(w), np.zeros_like(w)
    curve: list[float] = []
    for step in range(1, epochs * steps + 1):
        shown = moments @ w
        excess = w[:-1].T @ w[:-1] - np.eye(k)
        gradient = shown * (2 / k)
        gradient[:-1] += w[:-1] @ excess * (4 / k**2)
        first += (1 - _BETA) * (gradient - first)
        second += (1 - _GAMMA) * (gradient**2 - second)
        spread = np.sqrt(second / (1 - _GAMMA**step)) + _TINY
        w -= lr / (1 - _BETA**step) * first / spread
        if step % steps == 0:
            curve.append(float(np.sum(w * (moments @ w)) / k))
    penalty = float(np.mean((w[:-1].T @ w[:-1] - np.eye(k)) ** 2))
    if not np.isfinite(curve[-1] + penalty):
        raise TrainingDivergedError(f"the certificates' loss must stay finite, got {curve[-1]}")
    return CertificateFit(
        w[:-1].astype(np.float32), w[-1].astype(np.float32), tuple(curve), penalty
    )


def _second_moments(phi: NDArray[np.float32], chunk: int = 1 << 16) -> NDArray[np.float64]:
    """Mean of (phi, 1)(phi, 1)' without a copy of all features in double precision."""
    total = np.zeros((phi.shape[1] + 1,) * 2)
    for first in range(0, len(phi), chunk):
        part = phi[first : first + chunk].astype(np.float64)
        total[:-1, :-1] += part.T @ part
        total[-1, :-1] += part.sum(axis=0)
    total[:-1, -1] = total[-1, :-1]
    total /= len(phi)
    total[-1, -1] = 1.0
    return total
