"""Does an eventually safe policy keep its error rate at alpha, whatever the scores?

All deterministic decision processes of a few states are enumerated. In each the switching policy
acts: safe when the quantile is at or above the floor, fast below it. The score belongs to the state
and may be so large that no threshold reaches it. Assumption 1 is checked on what happens, with the
quantifiers that the paper leaves out; so is the bound. Arithmetic is in integers.

Paper: Assumption 1 and the Corollary; errata 13 to 15.
"""

from dataclasses import dataclass
from fractions import Fraction
from itertools import product
from typing import Annotated

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from cpl.conformal.bounds import eventually_safe_deviation_bound
from cpl.experiments.run.spec import Experiment, Shard, grid
from cpl.settings.ranges import Settings, interval

__all__ = ["CONDITIONS", "EXPERIMENT", "PROFILES", "Config"]

CONDITIONS = ("unbounded", "bounded")

Integers = NDArray[np.int64]
_HUGE = 10**12  # a score that no threshold reaches within the horizon


@dataclass(frozen=True, kw_only=True)
class Config(Settings):
    """What is enumerated.

    Attributes:
        states: Number of states; there are 3^states labellings and states^(2 states) dynamics.
        alphas: Nominal miscoverages [-], decimal.
        Ks: Block lengths of Assumption 1 [steps].
        floor_steps: The floor of the assumption, in steps of eta; even.
        T: Horizon [steps].
    """

    states: Annotated[int, interval("[1, 3]")]
    alphas: tuple[float, ...]
    Ks: tuple[int, ...]
    floor_steps: Annotated[int, interval("[2, inf)")]
    T: int

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.floor_steps % 2:
            raise ValueError(f"floor_steps must be even, got {self.floor_steps!r}")
        if any(not 1 <= K <= self.T for K in self.Ks):
            raise ValueError(f"Ks must lie in [1, T], got {self.Ks!r}")


PROFILES = {
    "smoke": Config(states=2, alphas=(0.1,), Ks=(1, 4), floor_steps=4, T=60),
    "book": Config(states=2, alphas=(0.1, 0.2), Ks=(1, 2, 4), floor_steps=4, T=300),
    "paper": Config(states=3, alphas=(0.1, 0.2, 0.5), Ks=(1, 2, 4, 10), floor_steps=6, T=400),
}


def run_shard(config: Config, shard: Shard) -> pd.DataFrame:
    """Run every process from one state, and compare every window with the bound.

    Returns:
        One row for each K: ``condition, alpha, start, K``, ``processes``; ``safe``,
        how many satisfy the assumption; ``violations`` of the bound among these and ``ratio``, the
        largest deviation as a share of it; ``unsafe``, and ``unsafe_broken``, how many of those
        pass the bound of an eventually safe policy. With bounded scores the assumption is not
        asked for: all processes count as safe, and the bound is that of Theorem 1 (K = 1).
    """
    condition, alpha = shard.text("condition"), Fraction(repr(float(shard["alpha"])))
    err, q = _run(condition, alpha, shard.number("start"), config)
    deviation = _largest_deviation(err, alpha)
    rows = []
    for K in config.Ks if condition == "unbounded" else (1,):
        safe = _satisfies(err, q, alpha, K, config)
        if condition == "bounded":
            safe[:] = True
        steps = config.floor_steps
        bound = Fraction(eventually_safe_deviation_bound(alpha, Fraction(1), steps, K=K))
        limit = bound * alpha.denominator
        broken = deviation * limit.denominator >= limit.numerator
        largest = int(deviation[safe].max(initial=0))
        rows.append(
            {
                "condition": condition,
                "alpha": float(alpha),
                "start": shard.number("start"),
                "K": K,
                "processes": len(safe),
                "safe": int(safe.sum()),
                "violations": int((safe & broken).sum()),
                "ratio": float(Fraction(largest) / limit),
                "unsafe": int((~safe).sum()),
                "unsafe_broken": int((~safe & broken).sum()),
            }
        )
    return pd.DataFrame(rows)


EXPERIMENT = Experiment(
    run=run_shard,
    profiles=PROFILES,
    shards=grid(
        "{condition}-{alpha}-{start}", condition=CONDITIONS, alpha="alphas", start="states"
    ),
    label="exact",
)


def _processes(condition: str, states: int, unit: int, steps: int) -> tuple[Integers, Integers]:
    """List all processes: score of each state, and next state for (state, fast or safe)."""
    greatest = _HUGE if condition == "unbounded" else steps * unit
    levels = (0, steps * unit // 2, greatest)
    scores = np.array(list(product(levels, repeat=states)), dtype=np.int64)
    dynamics = np.array(list(product(range(states), repeat=2 * states)), dtype=np.int64)
    return (
        np.repeat(scores, len(dynamics), axis=0),
        np.tile(dynamics.reshape(-1, states, 2), (len(scores), 1, 1)),
    )


def _run(
    condition: str, alpha: Fraction, start: int, config: Config
) -> tuple[NDArray[np.bool_], Integers]:
    """Run all processes side by side; q is in units of eta / m, alpha = a / m."""
    a, m = alpha.numerator, alpha.denominator
    scores, dynamics = _processes(condition, config.states, m, config.floor_steps)
    which = np.arange(len(scores))
    state = np.full(len(which), start)
    q = np.zeros((config.T, len(which)), dtype=np.int64)
    err = np.zeros((config.T, len(which)), dtype=np.bool_)
    now = np.zeros(len(which), dtype=np.int64)
    for t in range(config.T):
        q[t] = now
        err[t] = scores[which, state] > now
        careful = (now >= config.floor_steps * m).astype(np.int64)
        state = dynamics[which, state, careful]
        now = now + m * err[t] - a
    return err, q


def _satisfies(
    err: NDArray[np.bool_], q: Integers, alpha: Fraction, K: int, config: Config
) -> NDArray[np.bool_]:
    """Check Assumption 1 from every start time: K steps at the floor, fewer than alpha K misses."""
    high = q >= config.floor_steps * alpha.denominator
    steps_high, misses = _block_sums(high, K), _block_sums(err, K)
    many = misses * alpha.denominator >= alpha.numerator * K
    return ~((steps_high == K) & many).any(axis=0)


def _block_sums(flags: NDArray[np.bool_], K: int) -> Integers:
    total = np.concatenate([np.zeros((1, flags.shape[1]), dtype=np.int64), flags.cumsum(axis=0)])
    return total[K:] - total[:-K]


def _largest_deviation(err: NDArray[np.bool_], alpha: Fraction) -> Integers:
    """Return the largest |m N_W - a W| over all windows of each run."""
    a, m = alpha.numerator, alpha.denominator
    least = greatest = total = largest = np.zeros(err.shape[1], dtype=np.int64)
    for missed in err:
        total = total + m * missed - a
        largest = np.maximum(largest, np.maximum(total - least, greatest - total))
        least, greatest = np.minimum(least, total), np.maximum(greatest, total)
    return largest
