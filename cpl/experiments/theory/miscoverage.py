"""Is a score missed exactly when it lies above the threshold, ties included?

Paper: Section III, "err_t = 1 <=> s(x_t, y_t) > q_t". The online tracker is fed one score at a
time; what it reports must follow the equivalence.
"""

from dataclasses import dataclass

import numpy as np
import pandas as pd

from cpl.conformal import PI, Decaying, Fixed, Rule, RunningMax, Tracker, TrailingRange
from cpl.experiments.run.spec import Experiment, Shard, grid
from cpl.rng import stream
from cpl.settings.ranges import Count, Settings

__all__ = ["EXPERIMENT", "PROFILES", "RULES", "Config"]

RULES: dict[str, Rule] = {
    "fixed": Fixed(eta=0.1),
    "running maximum": RunningMax(c=0.1),
    "trailing range": TrailingRange(lr=0.1, window=50),
    "decaying": Decaying(c=0.5, power=0.6),
    "integral": PI(Fixed(eta=0.1), K_I=0.5, C_sat=2.0, lag=0),
}


@dataclass(frozen=True, kw_only=True)
class Config(Settings):
    """How many scores each tracker meets.

    Attributes:
        alphas: Nominal miscoverages [-].
        points: Scores for each rule and alpha; a third of them is set equal to the threshold.
        seed: Seed of all draws.
    """

    alphas: tuple[float, ...]
    points: Count
    seed: int


PROFILES = {
    "smoke": Config(alphas=(0.1,), points=300, seed=0),
    "book": Config(alphas=(0.1, 0.2), points=3000, seed=0),
    "paper": Config(alphas=(0.05, 0.1, 0.2, 0.5), points=50_000, seed=0),
}


def run_shard(config: Config, shard: Shard) -> pd.DataFrame:
    """Feed one tracker.

    Returns:
        One row: ``rule, alpha, points``; ``ties``, scores equal to the threshold; ``misses``;
        ``wrong_report``, how often what the tracker said is not ``s > q``; ``wrong_set``, how often
        it is not "the score lies outside the prediction set (-inf, q]".
    """
    rule, alpha = shard.text("rule"), float(shard["alpha"])
    rng = stream(config.seed, "miscoverage", shard.name)
    drawn, tie = rng.random(config.points), rng.random(config.points) < 1 / 3
    tracker = Tracker(RULES[rule], alpha=alpha)
    ties = misses = wrong_report = wrong_set = 0
    for u, at_threshold in zip(drawn.tolist(), tie.tolist(), strict=True):
        q = tracker.q
        score = q if at_threshold and np.isfinite(q) else u
        in_set = score <= q
        err = tracker.update(score)
        ties += score == q
        misses += err
        wrong_report += err != (score > q)
        wrong_set += err == in_set
    row = {"rule": rule, "alpha": alpha, "points": config.points, "ties": ties}
    counts = {"misses": misses, "wrong_report": wrong_report, "wrong_set": wrong_set}
    return pd.DataFrame([row | {name: int(count) for name, count in counts.items()}])


EXPERIMENT = Experiment(
    run=run_shard,
    profiles=PROFILES,
    shards=grid("{rule}-{alpha}", rule=RULES, alpha="alphas"),
    label="simulated",
)
