"""Where can the quantile go, and does the range that the paper prints contain it?

Sequences are built to push the quantile out: just under the greatest score, then one miss; a tie at
zero, then one covered score. Arithmetic is exact (fractions), so a range is left or it is not.

Paper: last line of the proof of Theorem 1; errata 4, 5 and 6.
"""

from dataclasses import dataclass
from fractions import Fraction
from itertools import product

import numpy as np
import pandas as pd

from cpl.conformal.bounds import quantile_range, quantile_range_as_printed
from cpl.experiments.run.spec import Experiment, Shard, parts
from cpl.rng import stream
from cpl.settings.ranges import Count, Settings

__all__ = ["EXPERIMENT", "PROFILES", "Config"]

_DELAYS = (1, 3)
_PER_SHARD = 25


@dataclass(frozen=True, kw_only=True)
class Config(Settings):
    """How many settings, and how long they are pushed.

    Attributes:
        settings: Number of random settings (alpha, eta, B), besides the paper's own.
        T: Length of each run [steps].
        seed: Seed of settings and of the random sequences.
    """

    settings: Count
    T: Count
    seed: int


PROFILES = {
    "smoke": Config(settings=4, T=60, seed=0),
    "book": Config(settings=25, T=200, seed=0),
    "paper": Config(settings=200, T=400, seed=0),
}


def _shards(config: Config) -> list[Shard]:
    """Cut the settings into parts; number 0 is the paper's own."""
    return [
        Shard(f"settings-{part}", {"first": part * _PER_SHARD, "count": count})
        for part, count in parts(config.settings + 1, _PER_SHARD)
    ]


def run_shard(config: Config, shard: Shard) -> pd.DataFrame:
    """Push the quantile of each setting to both ends.

    Returns:
        One row a setting and delay: ``setting, alpha, eta, B, delay``; ``q_min`` and ``q_max``,
        the ends reached; ``low`` and ``high``, the corrected range; ``low_printed`` and
        ``high_printed``; and whether the range was left: ``leaves`` (corrected, high end excluded),
        ``leaves_printed_low``, ``leaves_printed_high``.
    """
    first = shard.number("first")
    numbers = range(first, first + shard.number("count"))
    return pd.DataFrame([_row(config, n, h) for n, h in product(numbers, _DELAYS)])


EXPERIMENT = Experiment(
    run=run_shard,
    profiles=PROFILES,
    shards=_shards,
    label="exact",
)


def _row(config: Config, number: int, delay: int) -> dict[str, float | int | bool]:
    rng = stream(config.seed, "quantile_range", number)
    alpha, eta, B = _setting(number, rng)
    runs = [_push(kind, alpha, eta, B, delay, config.T, rng) for kind in ("up", "down", "random")]
    q_min, q_max = min(low for low, _ in runs), max(high for _, high in runs)
    allowed = quantile_range(alpha, eta, B, delay=delay)
    printed = quantile_range_as_printed(alpha, eta, B)
    return {
        "setting": number,
        "alpha": float(alpha),
        "eta": float(eta),
        "B": float(B),
        "delay": delay,
        "q_min": float(q_min),
        "q_max": float(q_max),
        "low": float(allowed.low),
        "high": float(allowed.high),
        "low_printed": float(printed.low),
        "high_printed": float(printed.high),
        "leaves": q_min < allowed.low or q_max >= allowed.high,
        "leaves_printed_low": q_min < printed.low,
        "leaves_printed_high": q_max > printed.high,
    }


def _setting(number: int, rng: np.random.Generator) -> tuple[Fraction, Fraction, Fraction]:
    if number == 0:
        return Fraction(1, 10), Fraction(1, 10), Fraction(1)
    alpha = Fraction(int(rng.integers(1, 20)), 20)
    return alpha, Fraction(int(rng.integers(1, 61)), 20), Fraction(int(rng.integers(1, 41)), 20)


def _push(
    kind: str,
    alpha: Fraction,
    eta: Fraction,
    B: Fraction,
    delay: int,
    T: int,
    rng: np.random.Generator,
) -> tuple[Fraction, Fraction]:
    """Return the least and the greatest threshold of one run that looks at the threshold."""
    q, low, high = Fraction(0), Fraction(0), Fraction(0)
    pending: list[int] = []
    target = "up" if kind == "up" else "down"
    for t in range(T):
        if kind == "random":
            score = B * Fraction(int(rng.integers(0, 9)), 8)
        elif target == "up":
            score = B  # a miss whenever q < B
        else:
            score = Fraction(0)  # covered whenever q >= 0
        if kind != "random" and t % 40 == 39:  # turn round: approach the end from another side
            target = "down" if target == "up" else "up"
        pending.append(int(score > q))
        if len(pending) == delay:
            q += eta * (pending.pop(0) - alpha)
        low, high = min(low, q), max(high, q)
    return low, high
