"""How often does split conformal prediction cover, when scores are exchangeable?

A threshold is taken from n calibration scores; its coverage, given those scores, should follow a
Beta law whose mean is at least 1 - alpha. Paper: Section II, the opening promise.

Four kinds of exchangeable scores: independent; with a level and a scale shared by all (dependent);
drawn from an urn without replacement; and rounded, so that there are ties.
"""

from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy import stats as sp

from cpl.experiments.run.spec import Experiment, Shard, parts
from cpl.rng import stream
from cpl.settings.ranges import Count, Settings
from cpl.stats import split_conformal_law, split_conformal_rank

__all__ = ["BINS", "EXPERIMENT", "KINDS", "PROFILES", "Config"]

KINDS = ("independent", "shared level", "urn", "ties")
BINS = 20  # cells of the probability transform, each of probability 1/20 under the Beta law

_PART = 10_000  # draws in a shard


@dataclass(frozen=True, kw_only=True)
class Config(Settings):
    """How much is drawn.

    Attributes:
        alpha: Nominal miscoverage [-].
        n: Calibration scores in a draw.
        draws: Draws of each kind, each with fresh calibration scores and one fresh test score.
        seed: Seed of all draws.
    """

    alpha: float
    n: int
    draws: Count
    seed: int

    def __post_init__(self) -> None:
        super().__post_init__()
        split_conformal_law(self.n, self.alpha)


PROFILES = {
    "smoke": Config(alpha=0.1, n=50, draws=500, seed=0),
    "book": Config(alpha=0.1, n=100, draws=10_000, seed=0),
    "paper": Config(alpha=0.1, n=100, draws=100_000, seed=0),
}


def _shards(config: Config) -> list[Shard]:
    """Cut the draws of each kind into parts."""
    return [
        Shard(f"{kind.replace(' ', '-')}-{part}", {"kind": kind, "part": part, "draws": draws})
        for kind in KINDS
        for part, draws in parts(config.draws, _PART)
    ]


def run_shard(config: Config, shard: Shard) -> pd.DataFrame:
    """Draw, calibrate, test.

    Returns:
        One row: ``kind``, ``part``, ``draws``, ``covered`` (test scores under the threshold), sums
        of the coverage given the calibration scores and of its square, and ``pit_00`` ...
        ``pit_19``, how many of these coverages fall into each twentieth of the Beta law. The last
        are empty where the coverage given the calibration scores has another law (urn, ties).
    """
    kind, part, draws = shard.text("kind"), shard.number("part"), shard.number("draws")
    rng = stream(config.seed, "split_conformal", kind, part)
    scores = _draw(kind, draws, config.n + 1, rng)
    k = split_conformal_rank(config.n, config.alpha)
    threshold = np.partition(scores[:, :-1], k - 1, axis=1)[:, k - 1]
    covered = scores[:, -1] <= threshold
    row = {"kind": kind, "part": part, "draws": draws, "covered": int(covered.sum())}
    coverage = np.zeros(0)
    if kind == "independent":
        coverage = sp.expon.cdf(threshold)
    elif kind == "shared level":
        level, scale = _shared(draws, stream(config.seed, "split_conformal", kind, part))
        coverage = sp.norm.cdf((threshold - level) / scale)
    return pd.DataFrame([row | _summary(coverage, config)])


EXPERIMENT = Experiment(
    run=run_shard,
    profiles=PROFILES,
    shards=_shards,
    label="simulated",
)


def _draw(kind: str, draws: int, size: int, rng: np.random.Generator) -> NDArray[np.float64]:
    """Draw exchangeable scores, one row a draw; the last column is the test score."""
    if kind == "independent":
        return rng.exponential(size=(draws, size))
    if kind == "shared level":
        level, scale = _shared(draws, rng)
        return level[:, None] + scale[:, None] * rng.standard_normal((draws, size))
    if kind == "urn":
        return rng.permuted(np.tile(np.arange(2.0 * size), (draws, 1)), axis=1)[:, :size]
    return np.round(rng.exponential(size=(draws, size)), 1)


def _shared(
    draws: int, rng: np.random.Generator
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Draw what all scores of a draw share: dependent they become, exchangeable they stay."""
    return rng.normal(0.0, 3.0, draws), rng.exponential(1.0, draws) + 0.1


def _summary(coverage: NDArray[np.float64], config: Config) -> dict[str, float | int]:
    transform = split_conformal_law(config.n, config.alpha).cdf(coverage)
    cells = np.bincount(np.minimum((transform * BINS).astype(int), BINS - 1), minlength=BINS)
    sums = {"coverage_sum": float(coverage.sum()), "coverage_sumsq": float((coverage**2).sum())}
    return sums | {f"pit_{b:02d}": int(count) for b, count in enumerate(cells)}
