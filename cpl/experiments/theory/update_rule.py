"""Which share of errors does the update rule produce, as printed and as corrected?

The printed rule is q - eta g(err - alpha) with g the slope of the quantile loss; the corrected one
is q + eta (err - alpha). Paper: eq. (4) and "we would like it close to 1 - alpha"; errata 1 and 9.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from cpl.experiments.run.spec import Experiment, Shard, grid
from cpl.rng import stream
from cpl.settings.ranges import Count, Positive, Settings, interval

__all__ = ["EXPERIMENT", "PROFILES", "Config"]

_DRAWS: dict[str, Callable[[np.random.Generator, int], NDArray[np.float64]]] = {
    "uniform": lambda rng, T: rng.random(T),
    "exponential": lambda rng, T: np.minimum(rng.exponential(0.2, T), 1.0),
    "constant": lambda rng, T: np.full(T, rng.random()),
}
_RULES = ("printed", "corrected")


@dataclass(frozen=True, kw_only=True)
class Config(Settings):
    """Tracker and length.

    Attributes:
        alphas: Nominal miscoverages [-].
        eta: Step size [score], for scores in [0, 1].
        T: Length of each run [steps].
        runs: Runs of each rule, alpha and law of the scores.
        seed: Seed of all draws.
    """

    alphas: Annotated[tuple[float, ...], interval("(0, 1)")]
    eta: Positive
    T: Count
    runs: Count
    seed: int


PROFILES = {
    "smoke": Config(alphas=(0.1,), eta=0.1, T=300, runs=2, seed=0),
    "book": Config(alphas=(0.1, 0.2), eta=0.1, T=2000, runs=5, seed=0),
    "paper": Config(alphas=(0.05, 0.1, 0.2, 0.4), eta=0.1, T=10_000, runs=20, seed=0),
}


def run_shard(config: Config, shard: Shard) -> pd.DataFrame:
    """Run one rule.

    Returns:
        One row a run: ``rule, alpha, law, run, T``, ``errors`` (their number), ``q_end`` [score].
    """
    rule, alpha, law = shard.text("rule"), float(shard["alpha"]), shard.text("law")
    rows = []
    for run in range(config.runs):
        # The rule is not part of the stream's name: both rules meet the same scores.
        scores = _DRAWS[law](stream(config.seed, "update_rule", law, run), config.T)
        errors, q_end = _follow(scores.tolist(), rule, alpha, config.eta)
        row = {"rule": rule, "alpha": alpha, "law": law, "run": run, "T": config.T}
        rows.append(row | {"errors": errors, "q_end": q_end})
    return pd.DataFrame(rows)


EXPERIMENT = Experiment(
    run=run_shard,
    profiles=PROFILES,
    shards=grid("{rule}-{alpha}-{law}", rule=_RULES, alpha="alphas", law=_DRAWS),
    label="simulated",
)


def _follow(scores: list[float], rule: str, alpha: float, eta: float) -> tuple[int, float]:
    q, errors = 0.0, 0
    for score in scores:
        err = score > q
        errors += err
        q += eta * (err - alpha) if rule == "corrected" else -eta * _slope(err - alpha, alpha)
    return errors, q


def _slope(u: float, alpha: float) -> float:
    """Return the slope of the quantile loss at level 1 - alpha, at u."""
    return (1 - alpha) - (u < 0)
