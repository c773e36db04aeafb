"""Sequences of scores in [0, B] that try to break a guarantee, seeded.

Oblivious ones are fixed in advance; the closed-loop ones see the threshold before they choose, as
the scores of a policy that acts on it do.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from cpl.conformal import Rule, Tracker

__all__ = ["CLOSED", "OBLIVIOUS", "adversarial_scores"]

FloatArray = NDArray[np.float64]
_Draw = Callable[[np.random.Generator, tuple[int, int]], FloatArray]


def _late_blow(rng: np.random.Generator, shape: tuple[int, int]) -> FloatArray:
    """Zeros up to a random time, then the greatest score for ever: the worst case of Theorem 1."""
    start = rng.integers(1, shape[1], size=(shape[0], 1))
    return (np.arange(shape[1]) >= start).astype(np.float64)


def _blocks(rng: np.random.Generator, shape: tuple[int, int]) -> FloatArray:
    """Alternate between nothing and the greatest score in blocks of random length."""
    length = rng.integers(1, 60, size=(shape[0], 1))
    return ((np.arange(shape[1]) // length) % 2).astype(np.float64)


def _drift(rng: np.random.Generator, shape: tuple[int, int]) -> FloatArray:
    """Rise and fall slowly, with noise."""
    period = rng.integers(20, 2000, size=(shape[0], 1))
    wave = 0.5 + 0.5 * np.sin(2 * np.pi * np.arange(shape[1]) / period)
    return np.clip(wave + rng.normal(0, 0.05, shape), 0, 1)


def _steps(rng: np.random.Generator, shape: tuple[int, int]) -> FloatArray:
    """Jump between levels at random times: a distribution that shifts."""
    jumps = rng.random(shape) < 0.01
    jumps[:, 0] = True
    which = np.cumsum(jumps, axis=1) - 1
    levels = rng.random((shape[0], int(which.max()) + 1))
    level = np.take_along_axis(levels, which, axis=1)
    return np.clip(level + rng.normal(0, 0.02, shape), 0, 1)


OBLIVIOUS: dict[str, _Draw] = {
    "uniform": lambda rng, shape: rng.random(shape),
    "rare": lambda rng, shape: (rng.random(shape) < rng.random((shape[0], 1))).astype(float),
    "heavy": lambda rng, shape: np.minimum(rng.pareto(1.0, shape) / 50, 1.0),
    "shrinking": lambda rng, shape: rng.random(shape) / np.sqrt(1 + np.arange(shape[1])),
    "late blow": _late_blow,
    "blocks": _blocks,
    "drift": _drift,
    "shifts": _steps,
}
"""Kinds that are fixed in advance, on [0, 1]."""

CLOSED = ("just above", "tie", "at random around")
"""Kinds that see the threshold: just above it (a miss), equal to it (covered), either at random."""


def adversarial_scores(
    kind: str,
    shape: tuple[int, int],
    rng: np.random.Generator,
    *,
    rule: Rule,
    alpha: float,
    B: float,
    q0: float = 0.0,
) -> FloatArray:
    """Draw sequences of one kind.

    Args:
        kind: A key of `OBLIVIOUS`, or one of `CLOSED`.
        shape: Number of sequences and their length.
        rng: Where they come from.
        rule: Step rule of the tracker that the closed-loop kinds look at.
        alpha: Its miscoverage.
        B: Greatest score.
        q0: Its first threshold.

    Returns:
        Scores in [0, B], of the shape asked for.
    """
    if kind in OBLIVIOUS:
        return B * OBLIVIOUS[kind](rng, shape)
    return np.stack(
        [_closed_loop(kind, shape[1], rng, rule, alpha, B, q0) for _ in range(shape[0])]
    )


def _closed_loop(
    kind: str,
    T: int,
    rng: np.random.Generator,
    rule: Rule,
    alpha: float,
    B: float,
    q0: float,
) -> FloatArray:
    tracker = Tracker(rule, alpha=alpha, q0=q0)
    miss = {"just above": np.ones(T), "tie": np.zeros(T)}.get(kind, rng.random(T) < rng.random())
    miss[rng.random(T) < 0.05 * rng.random()] = 0  # a pause now and then, so that no two are alike
    scores = np.empty(T)
    scores[0] = B * rng.uniform(0.1, 1.0)  # sets the scale of a rule that learns it
    tracker.update(float(scores[0]))
    for t in range(1, T):
        q = tracker.q
        scores[t] = min(max(np.nextafter(q, np.inf) if miss[t] else q, 0.0), B)
        tracker.update(float(scores[t]))
    return scores
