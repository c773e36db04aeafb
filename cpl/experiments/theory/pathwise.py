"""Does the average of misses reach alpha for any sequence, from both sides?

Paper: Section II ("for any sequence of data points ... alpha + o(1)") and Section III ("a two-sided
guarantee is available by a similar proof strategy"). Nothing is random for the theorem; the
sequences are drawn only to have many that differ.
"""

from dataclasses import dataclass
from itertools import product

import numpy as np
import pandas as pd

from cpl.conformal import Fixed, track_many
from cpl.conformal.bounds import deviation_bound
from cpl.experiments.run.spec import Experiment, Shard, grid
from cpl.experiments.theory._sequences import CLOSED, OBLIVIOUS, adversarial_scores
from cpl.rng import stream
from cpl.settings.ranges import Settings

__all__ = ["EXPERIMENT", "KINDS", "PROFILES", "Config"]

KINDS = (*OBLIVIOUS, *CLOSED)

_B = 1.0  # [score] nothing is lost: the tracker is homogeneous in (scores, B, eta)


@dataclass(frozen=True, kw_only=True)
class Config(Settings):
    """How many sequences of which length.

    Attributes:
        alphas: Nominal miscoverages [-].
        etas: Step sizes [score], for scores in [0, 1].
        horizons: Lengths at which the average is taken [steps], increasing.
        sequences: Sequences of each kind, alpha and eta.
        seed: Seed of all draws.
    """

    alphas: tuple[float, ...]
    etas: tuple[float, ...]
    horizons: tuple[int, ...]
    sequences: int
    seed: int

    def __post_init__(self) -> None:
        super().__post_init__()
        if list(self.horizons) != sorted(set(self.horizons)) or self.horizons[0] < 1:
            raise ValueError(f"horizons must be positive and increase, got {self.horizons!r}")
        for alpha, eta in product(self.alphas, self.etas):
            deviation_bound(alpha, eta, _B)


PROFILES = {
    "smoke": Config(alphas=(0.1,), etas=(0.1,), horizons=(50, 300), sequences=2, seed=0),
    "book": Config(alphas=(0.1, 0.2), etas=(0.05, 0.1), horizons=(100, 1000), sequences=5, seed=0),
    "paper": Config(
        alphas=(0.05, 0.1, 0.2, 0.5),
        etas=(0.02, 0.1, 0.5),
        horizons=(10, 100, 1000, 10_000),
        sequences=80,
        seed=0,
    ),
}


def run_shard(config: Config, shard: Shard) -> pd.DataFrame:
    """Track sequences of one kind and count the misses up to each horizon.

    Returns:
        One row a horizon: ``kind, alpha, eta, T, sequences``; ``bound``, the number of misses by
        which alpha T may be passed on either side; ``above`` and ``below``, how many sequences
        passed it; ``largest`` and ``smallest`` deviation seen; ``mean_error``, the average of err.
    """
    kind, alpha, eta = shard.text("kind"), float(shard["alpha"]), float(shard["eta"])
    rule = Fixed(eta=eta)
    shape = (config.sequences, config.horizons[-1])
    rng = stream(config.seed, "pathwise", shard.name)
    scores = adversarial_scores(kind, shape, rng, rule=rule, alpha=alpha, B=_B)
    count = np.cumsum(track_many(scores, rule, alpha=alpha, bounds=(0.0, _B)).err, axis=1)
    bound = float(deviation_bound(alpha, eta, _B))
    rows = []
    for T in config.horizons:
        deviation = count[:, T - 1] - alpha * T
        rows.append(
            {
                "kind": kind,
                "alpha": alpha,
                "eta": eta,
                "T": T,
                "sequences": config.sequences,
                "bound": bound,
                "above": int((deviation >= bound).sum()),
                "below": int((deviation <= -bound).sum()),
                "largest": float(deviation.max()),
                "smallest": float(deviation.min()),
                "mean_error": float(count[:, T - 1].mean() / T),
            }
        )
    return pd.DataFrame(rows)


EXPERIMENT = Experiment(
    run=run_shard,
    profiles=PROFILES,
    shards=grid("{kind}-{alpha}-{eta}", kind=KINDS, alpha="alphas", eta="etas"),
    label="simulated",
)
