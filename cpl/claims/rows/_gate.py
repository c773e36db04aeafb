"""What the book's own claims about the look-ahead share, decided like the paper's.

Crashes are compared at one mean speed. Intervals are over pairs of policies and streams; where a
claim is about worlds, over the worlds as well.
"""

from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cpl.claims.claim import Source
from cpl.rng import stream
from cpl.stats import Estimate, Weights, hierarchical_weights
from cpl.stats.matched import Ratio, apart, beside_curve, ratio

__all__ = ["against", "beside", "changing", "crashes_less", "weights_of", "with_worlds", "without"]


def changing(source: Source) -> Source:
    """Return the rows on the stream whose world changes."""
    return source.where(source["setting"] == "changing")


def without(source: Source, *worlds: str) -> Source:
    """Return the rows in all worlds but some."""
    return source.where(~np.isin(source["world"].astype(str), worlds))


def beside(
    own: Source,
    curve: Source,
    points: NDArray[Any],
    *,
    mixtures: bool = False,
    worlds: bool = False,
) -> Estimate:
    """Compare crashes with those of a curve of other methods, at its own mean speed.

    Args:
        own: The rows of one method.
        curve: Those of its rivals.
        points: Which rival each row of the curve is.
        mixtures: Whether rivals may be mixed by a coin.
        worlds: Whether the worlds are resampled as well.
    """
    crashes, speed = _ratios(own, worlds=worlds)
    weights = with_worlds(own) if worlds else weights_of(crashes.over)
    rivals = _ratios(curve, points, worlds=worlds)
    return beside_curve(crashes, speed, *rivals, weights, mixtures=mixtures)


def against(first: Source, second: Source, curve: Source, points: NDArray[Any]) -> Estimate:
    """Compare the crashes of two methods, each beside mixtures of others at its own speed."""
    own = _ratios(first)
    rivals = _ratios(curve, points)
    return apart(own, _ratios(second), rivals, weights_of(own[0].over), mixtures=True)


def crashes_less(estimate: Estimate) -> Estimate:
    """Turn a difference of crash shares round, so that fewer crashes are positive."""
    return replace(estimate, value=-estimate.value, low=-estimate.high, high=-estimate.low)


def weights_of(each: NDArray[np.float64]) -> Weights:
    """Resample pairs, then streams, which are the same in all pairs."""
    return _weights(*each.shape[:2])


def with_worlds(source: Source) -> Weights:
    """Resample pairs, streams and worlds; units are streams by worlds."""
    sizes = (len(np.unique(source[name])) for name in ("pair", "stream", "world"))
    return _weights_with_worlds(*sizes)


def _ratios(
    source: Source, points: NDArray[Any] | None = None, *, worlds: bool = False
) -> tuple[Ratio, Ratio]:
    """Crashes an episode, and metres a second."""
    labels = [source["pair"], _units(source) if worlds else source["stream"]]
    labels += [] if points is None else [points]
    return (
        ratio(source["crashes"], source["episodes"], *labels),
        ratio(source["speed_sum"], source["steps"], *labels),
    )


def _units(source: Source) -> NDArray[np.int64]:
    """Number each stream in each world."""
    worlds, at = np.unique(source["world"].astype(str), return_inverse=True)
    return source["stream"].astype(np.int64) * len(worlds) + at


@lru_cache(maxsize=2)
def _weights(pairs: int, streams: int) -> Weights:
    return hierarchical_weights(pairs, streams, stream(0, "claims", "gate"))


@lru_cache(maxsize=4)
def _weights_with_worlds(pairs: int, streams: int, worlds: int) -> Weights:
    plain = _weights(pairs, streams).counts
    rng = stream(0, "claims", "gate", "worlds", worlds)
    drawn = rng.multinomial(worlds, np.full(worlds, 1 / worlds), size=len(plain))
    counts = (plain[..., None] * drawn[:, None, None, :]).reshape(len(plain), pairs, -1)
    return Weights(counts=counts, groups=min(pairs, worlds))
