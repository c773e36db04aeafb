"""Is there a guarantee when the step is a tenth of a maximum of the scores?

Paper: Section III, "eta_t = 0.1 B_hat_t. It is trivial to get a guarantee in this setting as well";
B_hat is not defined (erratum 11). Read as the running maximum there is one; read as the maximum of
a trailing window there is none, with the current score in the window or without.
"""

import math
from dataclasses import dataclass
from itertools import product

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from cpl.conformal import RunningMax, TrailingMax, track, track_many
from cpl.conformal.bounds import running_maximum_bound
from cpl.experiments.run.spec import Experiment, Shard
from cpl.experiments.theory._sequences import CLOSED, OBLIVIOUS, adversarial_scores
from cpl.rng import stream
from cpl.settings.ranges import Count, Settings

__all__ = ["EXPERIMENT", "PROFILES", "Config"]

_KINDS = (*OBLIVIOUS, *CLOSED)
_TRAPS = ("freeze", "excluded")
_B = 1.0


@dataclass(frozen=True, kw_only=True)
class Config(Settings):
    """Settings of both readings.

    Attributes:
        alphas: Nominal miscoverages [-].
        c: The share of the maximum that is a step [-]; the paper's is 0.1.
        window: Length of the trailing window that leaves the current score out [steps].
        T: Length of each sequence [steps].
        sequences: Sequences of each kind and alpha.
        seed: Seed of all draws.
    """

    alphas: tuple[float, ...]
    c: float
    window: Count
    T: Count
    sequences: Count
    seed: int

    def __post_init__(self) -> None:
        super().__post_init__()
        running_maximum_bound(self.c, _B, _B)


PROFILES = {
    "smoke": Config(alphas=(0.1,), c=0.1, window=10, T=200, sequences=2, seed=0),
    "book": Config(alphas=(0.1, 0.2), c=0.1, window=10, T=600, sequences=4, seed=0),
    "paper": Config(alphas=(0.05, 0.1, 0.2, 0.5), c=0.1, window=10, T=2000, sequences=40, seed=0),
}


def _shards(config: Config) -> list[Shard]:
    """Return a piece for each alpha and kind of sequence, and for each trap."""
    running = [("running", kind, alpha) for kind, alpha in product(_KINDS, config.alphas)]
    trailing = [("trailing", trap, alpha) for trap, alpha in product(_TRAPS, config.alphas)]
    return [
        Shard(
            f"{reading}-{kind.replace(' ', '-')}-{alpha}",
            {"reading": reading, "kind": kind, "alpha": alpha},
        )
        for reading, kind, alpha in (*running, *trailing)
    ]


def run_shard(config: Config, shard: Shard) -> pd.DataFrame:
    """Track one kind of sequence and compare every window with the bound.

    Returns:
        One row a sequence: ``reading`` (``running`` or ``trailing``), ``kind, alpha, sequence``;
        ``windows`` looked at; ``violations``, how many start times have a window that breaks the
        bound; ``ratio``, the largest deviation as a share of it (for the trailing reading: of the
        bound that the running one has); ``error_rate`` over the second half.
    """
    reading, kind, alpha = shard.text("reading"), shard.text("kind"), float(shard["alpha"])
    if reading == "trailing":
        scores, err = _trap(kind, config, alpha)
        return pd.DataFrame([_row(reading, kind, alpha, 0, scores, err, config.c)])
    rule = RunningMax(c=config.c)
    rng = stream(config.seed, "adaptive_step", shard.name)
    shape = (config.sequences, config.T)
    scores = adversarial_scores(kind, shape, rng, rule=rule, alpha=alpha, B=_B)
    err = track_many(scores, rule, alpha=alpha, bounds=(0.0, _B)).err
    return pd.DataFrame(
        [_row(reading, kind, alpha, i, scores[i], err[i], config.c) for i in range(len(scores))]
    )


EXPERIMENT = Experiment(
    run=run_shard,
    profiles=PROFILES,
    shards=_shards,
    label="simulated",
)


def _row(
    reading: str,
    kind: str,
    alpha: float,
    sequence: int,
    scores: NDArray[np.float64],
    err: NDArray[np.bool_],
    c: float,
) -> dict[str, float | int | str]:
    """Compare all windows that start after the first positive score with the bound."""
    maximum = np.maximum.accumulate(scores)
    first = int(np.argmax(maximum > 0))
    excess = np.concatenate([[0.0], np.cumsum(err - alpha)])[first:]
    greatest = np.maximum.accumulate(excess[::-1])[::-1][1:] - excess[:-1]
    least = np.minimum.accumulate(excess[::-1])[::-1][1:] - excess[:-1]
    worst = np.maximum(greatest, -least)
    per_unit = float(running_maximum_bound(c, _B, _B)) * _B  # it scales as 1 / B_hat
    ratio = worst * maximum[first:] / per_unit
    starts = len(ratio)
    return {
        "reading": reading,
        "kind": kind,
        "alpha": alpha,
        "sequence": sequence,
        "windows": starts * (starts + 1) // 2,
        "violations": int((ratio > 1 + 1e-12).sum()),
        "ratio": float(ratio.max()),
        "error_rate": float(err[len(err) // 2 :].mean()),
    }


def _trap(kind: str, config: Config, alpha: float) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Return the sequence that breaks a trailing maximum, and what is missed of it.

    *freeze*: a one, then perfect forecasts. The window is just so long that the one leaves it when
    the threshold has come down below zero: from then on every step is zero, every forecast missed.
    *excluded*: a one after each window of zeros; it is always missed, with a step of zero.
    """
    if kind == "freeze":
        scores = np.zeros(config.T)
        scores[0] = 1.0
        rule = TrailingMax(c=config.c, window=1 + math.ceil(1 / alpha - 0.5))
        return scores, track(scores, rule, alpha=alpha, q0=alpha * config.c / 2).err
    scores = (np.arange(config.T) % (config.window + 1) == config.window).astype(np.float64)
    return scores, _excluding_current(scores, config, alpha)


def _excluding_current(
    scores: NDArray[np.float64], config: Config, alpha: float
) -> NDArray[np.bool_]:
    """Track with a share of the maximum of the window before the current score.

    Only this experiment needs the rule.
    """
    q, err = 0.0, np.zeros(len(scores), dtype=np.bool_)
    for t, score in enumerate(scores.tolist()):
        err[t] = score > q
        q += config.c * scores[max(t - config.window, 0) : t].max(initial=0.0) * (err[t] - alpha)
    return err
