"""A linear reading of a yes or no: ridge logistic regression, and how well it ranks."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import optimize
from scipy import special as sf
from scipy import stats as sp

__all__ = ["Logistic", "auc", "fit_logistic"]

Floats = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, eq=False)
class Logistic:
    """A fitted model of the log odds, linear in standardised features.

    Attributes:
        weights: One a feature.
        bias: Log odds at the features' means.
        mean: Of the features in the fit.
        scale: Their standard deviations there; 1 where a feature did not vary.
    """

    weights: Floats
    bias: float
    mean: Floats
    scale: Floats

    def log_odds(self, x: ArrayLike) -> Floats:
        """Return the log odds of yes, (n,), for features (n, k)."""
        return (np.asarray(x, np.float64) - self.mean) / self.scale @ self.weights + self.bias

    def log_likelihood(self, x: ArrayLike, y: ArrayLike) -> float:
        """Return the mean log likelihood of answers [nat]."""
        z = self.log_odds(x)
        return float(np.mean(_log_likelihood(z, np.asarray(y, np.float64))))


def fit_logistic(x: ArrayLike, y: ArrayLike, *, ridge: float = 1.0) -> Logistic:
    r"""Fit a logistic regression.

    $$ \min_{w, b} \; -\sum_i \log p(y_i \mid z_i) + \tfrac{\lambda}{2} |w|^2, \qquad
       z = w \cdot \frac{x - \bar x}{s_x} + b $$

    Args:
        x: Features, (n, k).
        y: Whether yes, (n,).
        ridge: lambda, >= 0; the bias is not penalised.

    Returns:
        The model. Answers that are all alike give weights of 0 and the log odds of half a
        case of the other kind.

    Raises:
        ValueError: If shapes do not fit, or the penalty is negative.

    Examples:
        Three quarters yes, whatever the feature:

        >>> model = fit_logistic([[0.0], [1.0], [0.0], [1.0]] * 2, [1, 1, 1, 0] + [1, 1, 0, 1])
        >>> round(float(model.log_odds([[0.5]])[0]), 3), round(float(np.log(3)), 3)
        (1.099, 1.099)
    """
    features, answers = np.asarray(x, np.float64), np.asarray(y, np.float64)
    if features.ndim != 2 or answers.shape != features.shape[:1] or len(answers) < 1:
        raise ValueError(f"y must have the length of x {features.shape}, got {answers.shape}")
    if not ridge >= 0:
        raise ValueError(f"ridge must be >= 0, got {ridge!r}")
    mean, scale = features.mean(axis=0), features.std(axis=0)
    scale = np.where(scale > 0, scale, 1.0)
    z, count, yes = (features - mean) / scale, len(answers), float(answers.sum())
    if yes in (0.0, count):
        bias = float(np.log((yes + 0.5) / (count - yes + 0.5)))
        return Logistic(weights=np.zeros(z.shape[1]), bias=bias, mean=mean, scale=scale)

    def loss(parameters: Floats) -> tuple[float, Floats]:
        odds = z @ parameters[:-1] + parameters[-1]
        off = sf.expit(odds) - answers
        penalty = 0.5 * ridge * float(parameters[:-1] @ parameters[:-1])
        slope = np.append(z.T @ off + ridge * parameters[:-1], off.sum())
        return penalty - float(_log_likelihood(odds, answers).sum()), slope

    start = np.append(np.zeros(z.shape[1]), np.log(yes / (count - yes)))
    found = optimize.minimize(loss, start, jac=True, method="L-BFGS-B").x
    return Logistic(weights=found[:-1], bias=float(found[-1]), mean=mean, scale=scale)


def auc(scores: ArrayLike, y: ArrayLike) -> float:
    """Return how often a case with yes has the larger score than one with no; ties count half.

    Args:
        scores: Shape (n,).
        y: Whether yes, (n,).

    Returns:
        The area under the receiver's curve, 0.5 for no information; NaN if all answers are alike.

    Examples:
        >>> auc([0.1, 0.4, 0.35, 0.8], [0, 0, 1, 1])
        0.75
    """
    answers = np.asarray(y, np.bool_)
    yes = int(answers.sum())
    no = len(answers) - yes
    if not yes or not no:
        return float("nan")
    ranks = sp.rankdata(scores)
    return float((ranks[answers].sum() - yes * (yes + 1) / 2) / (yes * no))


def _log_likelihood(log_odds: Floats, y: Floats) -> Floats:
    return y * log_odds - np.logaddexp(0.0, log_odds)
