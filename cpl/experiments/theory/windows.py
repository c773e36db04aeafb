"""Does Theorem 1 hold in every window, as printed and as corrected?

Every window (T0, W) of every sequence is looked at. The printed sum runs over W + 1 terms, the
corrected one over W. All arithmetic is exact: alpha, eta, B and q1 are fractions, the threshold is
an integer count, scores are multiples of the common denominator.

Paper: Theorem 1, and the "two-sided guarantee" after it.
"""

from dataclasses import dataclass
from fractions import Fraction
from math import lcm
from typing import Annotated

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from cpl.conformal.bounds import deviation_bound, max_errors, min_errors, quantile_range
from cpl.experiments.run.spec import Experiment, Shard
from cpl.rng import stream
from cpl.settings.ranges import Count, Settings, interval

__all__ = ["EXPERIMENT", "PROFILES", "Config"]


# The paper's constants, B/eta an integer; there the printed form survives.
_PAPER = (Fraction(1, 10), Fraction(1, 10), Fraction(1))
# The smallest counterexample to the printed form: s = 0, B, B with T0 = 2, W = 1.
_COUNTEREXAMPLE = (Fraction(1, 10), Fraction(1), Fraction(17, 20))


@dataclass(frozen=True, kw_only=True)
class Config(Settings):
    """How many settings, sequences and windows.

    Attributes:
        settings: Number of random settings (alpha, eta, B, q1), besides the paper's and the
            counterexample's.
        sequences: Sequences in each setting.
        T: Their length [steps]; each has T (T + 1) / 2 windows.
        seed: Seed of all draws.
    """

    settings: Count
    sequences: Count
    T: Annotated[int, interval("[3, inf)")]
    seed: int


PROFILES = {
    "smoke": Config(settings=4, sequences=6, T=20, seed=0),
    "book": Config(settings=40, sequences=8, T=40, seed=0),
    "paper": Config(settings=400, sequences=12, T=60, seed=0),
}

_PER_SHARD = 50


def _shards(config: Config) -> list[Shard]:
    """Cut the settings into parts; the first two settings are fixed."""
    total = config.settings + 2
    return [
        Shard(f"settings-{first}", {"first": first, "last": min(first + _PER_SHARD, total)})
        for first in range(0, total, _PER_SHARD)
    ]


def run_shard(config: Config, shard: Shard) -> pd.DataFrame:
    """Count, over all windows, where the bounds are passed.

    Returns:
        One row a setting: ``setting`` (number), ``origin`` (``paper``, ``counterexample``,
        ``random``), ``alpha, eta, B, q1``, ``sequences``, ``windows``; ``corrected`` and
        ``printed``, the windows that break Theorem 1 in either reading; ``lower``, those that break
        the other side; ``beyond_exact``, those with more or fewer misses than the exact worst
        cases (for q1 = 0); ``largest_share``, the most misses of a window above alpha W, as a
        share of the bound.
    """
    numbers = range(shard.number("first"), shard.number("last"))
    return pd.DataFrame([_row(config, number) for number in numbers])


EXPERIMENT = Experiment(
    run=run_shard,
    profiles=PROFILES,
    shards=_shards,
    label="exact",
)


def _row(config: Config, number: int) -> dict[str, float | int | str]:
    rng = stream(config.seed, "windows", number)
    origin, (alpha, eta, B, q1) = _setting(number, rng)
    scores, scale, step = _scores(config, alpha, eta, B, rng)
    err = _exact_misses(scores, alpha, step, q1 * scale * alpha.denominator)
    count = np.concatenate([np.zeros((len(err), 1), dtype=np.int64), err.cumsum(axis=1)], axis=1)
    return {
        "setting": number,
        "origin": origin,
        "alpha": float(alpha),
        "eta": float(eta),
        "B": float(B),
        "q1": float(q1),
        "sequences": len(err),
        **_breaks(count, alpha, eta, B, q1),
    }


def _setting(
    number: int, rng: np.random.Generator
) -> tuple[str, tuple[Fraction, Fraction, Fraction, Fraction]]:
    if number < 2:
        return ("paper", "counterexample")[number], (
            *(_PAPER, _COUNTEREXAMPLE)[number],
            Fraction(0),
        )
    alpha = Fraction(int(rng.integers(1, 20)), 20)
    eta, B = Fraction(int(rng.integers(1, 41)), 20), Fraction(int(rng.integers(1, 41)), 20)
    allowed = quantile_range(alpha, eta, B)
    inside = Fraction(allowed.low) + Fraction(allowed.width) * Fraction(int(rng.integers(0, 8)), 8)
    return "random", (alpha, eta, B, inside if rng.random() < 0.5 else Fraction(0))


def _scores(
    config: Config, alpha: Fraction, eta: Fraction, B: Fraction, rng: np.random.Generator
) -> tuple[NDArray[np.int64], int, int]:
    """Draw scores in units of 1/scale, in which all the other numbers are integers as well."""
    scale = 8 * lcm(alpha.denominator * eta.denominator, B.denominator)
    top, shape = int(B * scale), (config.sequences, config.T)
    scores = rng.integers(0, top + 1, size=shape)
    extreme = rng.random(shape) < rng.random((config.sequences, 1))
    scores = np.where(
        extreme, top * (rng.random(shape) < rng.random((config.sequences, 1))), scores
    )
    start = rng.integers(1, config.T, size=config.sequences // 3)
    scores[: len(start)] = top * (np.arange(config.T) >= start[:, None])
    scores[0] = top  # the worst case of Theorem 1: one zero, then the greatest score
    scores[0, 0] = 0
    return scores, scale, int(eta * scale)


def _exact_misses(
    scores: NDArray[np.int64], alpha: Fraction, step: int, start: Fraction
) -> NDArray[np.int64]:
    """Track in integers: the unit is 1/(scale m) with alpha = a/m, so every number is one."""
    a, m = alpha.numerator, alpha.denominator
    q = np.full(len(scores), int(start), dtype=np.int64)
    err = np.empty_like(scores)
    for t in range(scores.shape[1]):
        err[:, t] = scores[:, t] * m > q
        q += step * (m * err[:, t] - a)
    return err


def _breaks(
    count: NDArray[np.int64], alpha: Fraction, eta: Fraction, B: Fraction, q1: Fraction
) -> dict[str, float | int]:
    """Compare the misses of all windows with the bounds, in integers."""
    T = count.shape[1] - 1
    bound = Fraction(deviation_bound(alpha, eta, B))
    found = {"windows": 0, "corrected": 0, "lower": 0, "printed": 0, "beyond_exact": 0}
    largest = Fraction(-1)
    for W in range(1, T + 1):
        misses = count[:, W:] - count[:, :-W]
        found["windows"] += misses.size
        found["corrected"] += int((misses >= _ceiling(alpha * W + bound)).sum())
        found["lower"] += int((misses <= _floor(alpha * W - bound)).sum())
        longer = count[:, W + 1 :] - count[:, : -W - 1]
        found["printed"] += int((longer > _floor(alpha * W + bound)).sum())
        if q1 == 0:
            most, least = max_errors(alpha, eta, B, W), min_errors(alpha, eta, B, W)
            found["beyond_exact"] += int(((misses > most) | (misses < least)).sum())
        largest = max(largest, (int(misses.max()) - alpha * W) / bound)
    return {**found, "largest_share": float(largest)}


def _ceiling(x: Fraction) -> int:
    return -((-x.numerator) // x.denominator)


def _floor(x: Fraction) -> int:
    return x.numerator // x.denominator
