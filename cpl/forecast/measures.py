"""How good is a forecast, and does it tell danger? Numbers on pooled steps."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.stats import rankdata

__all__ = ["auc", "skill"]


def skill(error: ArrayLike, reference: ArrayLike) -> float:
    r"""Share of the reference forecast's mean square error that a forecast removes.

    $$ 1 - \frac{\sum e_t^2}{\sum r_t^2} $$

    Args:
        error: errors of the forecast, (n,).
        reference: errors of the reference at the same times, (n,); persistence here.

    Returns:
        1 for a perfect forecast, 0 for one as good as the reference.

    Raises:
        ValueError: if there are no errors, or the reference is perfect.

    >>> skill([1.0, -1.0], [2.0, 2.0])
    0.75
    """
    e, r = np.asarray(error, np.float64), np.asarray(reference, np.float64)
    if e.shape != r.shape or not e.size or not np.any(r):
        raise ValueError(f"reference must have errors, as many as {e.shape}, got {r.shape}")
    return float(1 - np.mean(e**2) / np.mean(r**2))


def auc(score: ArrayLike, label: ArrayLike) -> float:
    """Probability that a step with the event has a larger score than one without; ties count half.

    Args:
        score: any number a step, (n,).
        label: whether the event follows, bool (n,).

    Returns:
        0.5 for a score that knows nothing; NaN where all steps are of one kind.

    Raises:
        ValueError: if the shapes differ or a score is NaN.

    >>> auc([0.1, 0.4, 0.4, 0.9], [False, False, True, True])
    0.875
    """
    s, event = np.asarray(score, np.float64), np.asarray(label, np.bool_)
    if s.ndim != 1 or s.shape != event.shape or np.isnan(s).any():
        raise ValueError(f"score must be numbers of shape {event.shape}, got shape {s.shape}")
    hits, rest = int(event.sum()), int((~event).sum())
    if not hits or not rest:
        return float("nan")
    return float((rankdata(s)[event].sum() - hits * (hits + 1) / 2) / (hits * rest))
