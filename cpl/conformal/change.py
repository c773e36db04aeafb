r"""Has the world changed? Bets that win when it has, and when to believe them.

A bettor starts with 1 and bets, score by score, against the claim that nothing has changed. What
the capital is multiplied with at time t is $e_t \ge 0$, and while the claim is true
$E[e_t \mid \text{past}] \le 1$: nobody grows rich for long against a fair coin. Three ways to turn
the factors into an alarm at a level c, each with its guarantee:

| alarm | statistic | while nothing has changed |
|---|---|---|
| Ville | $S_t = e_t S_{t-1}$ | the chance of *ever* alarming is at most 1 / c |
| CUSUM | $C_t = e_t \max(C_{t-1}, 1)$ | the mean time to an alarm is at least c |
| Shiryaev-Roberts | $R_t = e_t (1 + R_{t-1})$ | the mean time to an alarm is at least c |

Ville's inequality is about the supremum of a supermartingale. $R_t - t$ is a supermartingale that
starts at 0, so $E[\tau] \ge E[R_\tau] \ge c$; and $C_t \le R_t$ alarms no earlier. The first
forgets nothing and is slow when the change comes late; the other two forget and alarm for ever and
again.

Vovk, Gammerman and Shafer (2022), chapter 8; ours is compared with ``online-cp``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cpl.conformal._validate import as_number, as_probability, as_scores
from cpl.rng import stream

__all__ = ["Alarms", "alarms", "bets_on_errors", "bets_on_ranks", "p_values"]

FloatArray: TypeAlias = NDArray[np.float64]

_SLOPES = np.linspace(-0.95, 0.95, 20)
_SHARES = np.linspace(0.05, 0.95, 10)


@dataclass(frozen=True, kw_only=True)
class Alarms:
    """The three statistics, and when each first reached the level.

    Attributes:
        level: c.
        ville: S, shape (T,).
        cusum: C, shape (T,).
        shiryaev_roberts: R, shape (T,).
        first: First step at which each is at least c, by name; None if never.
    """

    level: float
    ville: FloatArray
    cusum: FloatArray
    shiryaev_roberts: FloatArray
    first: dict[str, int | None]


def alarms(factors: ArrayLike, *, level: float) -> Alarms:
    """Multiply up what a bettor wins, in the three ways.

    Args:
        factors: e, what the capital is multiplied with at each step, >= 0, shape (T,).
        level: c, > 1: for Ville one over the chance of a false alarm, for the others the least
            mean time to one [steps].

    Raises:
        ValueError: If a factor is negative or not finite, or the level is not above 1.

    Examples:
        >>> found = alarms([0.5, 0.5, 4.0, 4.0], level=10.0)
        >>> found.ville.tolist(), found.cusum.tolist()
        ([0.5, 0.25, 1.0, 4.0], [0.5, 0.5, 4.0, 16.0])
        >>> found.shiryaev_roberts.tolist(), found.first["ville"], found.first["cusum"]
        ([0.5, 0.75, 7.0, 32.0], None, 3)
    """
    e = as_scores(factors, ndim=1, name="factors")
    if e.size and e.min() < 0:
        raise ValueError(f"factors must be >= 0, got {float(e.min())!r}")
    if as_number("level", level) <= 1.0:
        raise ValueError(f"level must be > 1, got {level!r}")
    s, c, r = (np.empty_like(e) for _ in range(3))
    capital, best, total = 1.0, 0.0, 0.0
    for t, factor in enumerate(e.tolist()):
        capital, best, total = factor * capital, factor * max(best, 1.0), factor * (1.0 + total)
        # Beyond the level the exact value says no more, and infinity times 0 would be no number.
        capital, best, total = min(capital, 1e300), min(best, 1e300), min(total, 1e300)
        s[t], c[t], r[t] = capital, best, total
    named = {"ville": s, "cusum": c, "shiryaev_roberts": r}
    first = {name: _first(values >= level) for name, values in named.items()}
    return Alarms(level=float(level), first=first, **named)


def p_values(scores: ArrayLike, *, seed: int = 0) -> FloatArray:
    r"""Return where each score ranks among those so far, ties broken by a coin.

    $$ p_t = \frac{\#\{i \le t: s_i > s_t\} + u_t\,\#\{i \le t: s_i = s_t\}}{t} $$

    Of exchangeable scores these are independent and uniform on [0, 1], whatever the distribution.
    Scores of consecutive steps of one episode are not exchangeable; take one of each episode, or
    the mean of a block.

    Args:
        scores: Finite scores, shape (T,).
        seed: Of the coins.

    Examples:
        The second is the largest of two, the third the second of three:

        >>> p = p_values([1.0, 3.0, 2.0])
        >>> bool(p[1] < 1 / 2), bool(1 / 3 < p[2] < 2 / 3)
        (True, True)
    """
    values = as_scores(scores, ndim=1)
    coins = stream(seed, "conformal", "ranks").random(values.size)
    p = np.empty_like(values)
    for t, s in enumerate(values):
        known = values[: t + 1]
        p[t] = ((known > s).sum() + coins[t] * (known == s).sum()) / (t + 1)
    return p


def bets_on_ranks(p: ArrayLike) -> FloatArray:
    r"""Bet that ranks are no longer uniform, and return the factors.

    A mixture over slopes a of $1 + a (1 - 2p)$, each weighted by what it has won: large scores
    (small p) pay for positive a, small ones for negative. The mean factor under uniform p is 1.

    Args:
        p: From `p_values`, shape (T,).

    Examples:
        Fifty scores that all rank near the top, and fifty in the middle:

        >>> [bool(bets_on_ranks(np.full(50, p)).prod() > 1e6) for p in (0.05, 0.5)]
        [True, False]
    """
    ranks = as_scores(p, ndim=1, name="p")
    if ranks.size and not (ranks.min() >= 0.0 and ranks.max() <= 1.0):
        raise ValueError(f"p must lie in [0, 1], got {float(ranks.min())!r} to {ranks.max()!r}")
    return _mixture(1.0 + _SLOPES * (1.0 - 2.0 * ranks[:, None]))


def bets_on_errors(errors: ArrayLike, *, alpha: float) -> FloatArray:
    r"""Bet that a frozen threshold errs more often than alpha, and return the factors.

    A mixture over bets $1 + \lambda(\mathrm{err}_t - \alpha)$ with $\lambda \in (0, 1/\alpha)$. The
    claim that is bet against is $P(\mathrm{err}_t = 1 \mid \text{past}) \le \alpha$ at every step;
    nothing is asked of how the steps hang together.

    Args:
        errors: Whether each score exceeded the threshold, shape (T,).
        alpha: The share promised.

    Examples:
        >>> bool((bets_on_errors([0, 0, 0, 0], alpha=0.1) < 1).all())
        True
    """
    level = as_probability("alpha", alpha)
    err = np.asarray(errors, dtype=np.float64)
    return _mixture(1.0 + _SHARES / level * (err[:, None] - level))


def _mixture(own: FloatArray) -> FloatArray:
    """Return the factors of a mixture of bettors, (T,), from each bettor's, (T, bettors)."""
    logs = np.cumsum(np.log(own), axis=0)
    top = logs.max(axis=1, keepdims=True, initial=-np.inf)
    wealth = top[:, 0] + np.log(np.exp(logs - top).mean(axis=1))
    return np.exp(np.diff(wealth, prepend=0.0))


def _first(reached: NDArray[np.bool_]) -> int | None:
    return int(np.argmax(reached)) if reached.any() else None
