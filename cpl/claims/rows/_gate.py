"""What the book's own claims about the look-ahead share: rows 51 to 53, decided like the paper's.

What is claimed was written down before the test seeds of `gate_stream` were looked at.
"""

from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cpl.claims.claim import Source
from cpl.claims.verdict import Finding, Verdict
from cpl.rng import stream
from cpl.stats import Estimate, Weights, hierarchical_weights
from cpl.stats.matched import beside_curve, ratio

__all__ = ["beside", "changing", "decided", "weights_of"]


def changing(source: Source) -> Source:
    """Return the rows on the stream whose world changes."""
    return source.where(source["setting"] == "changing")


def beside(own: Source, curve: Source, points: NDArray[Any], *, mixtures: bool = False) -> Estimate:
    """Compare crashes with those of a curve of other methods, at its own mean speed."""
    mine, theirs = (own["pair"], own["stream"]), (curve["pair"], curve["stream"], points)
    crashes = ratio(own["crashes"], own["episodes"], *mine)
    return beside_curve(
        crashes,
        ratio(own["speed_sum"], own["steps"], *mine),
        ratio(curve["crashes"], curve["episodes"], *theirs),
        ratio(curve["speed_sum"], curve["steps"], *theirs),
        weights_of(crashes.over),
        mixtures=mixtures,
    )


def weights_of(each: NDArray[np.float64]) -> Weights:
    """Resample pairs, then streams, which are the same in all pairs."""
    return _weights(*each.shape[:2])


@lru_cache(maxsize=2)
def _weights(pairs: int, streams: int) -> Weights:
    return hierarchical_weights(pairs, streams, stream(0, "claims", "gate"))


def decided(estimate: Estimate, own: Source, wanted: int = -1) -> Finding:
    """Decide by the sign of an interval; `wanted` is the sign that was claimed."""
    low, high = sorted((wanted * estimate.low, wanted * estimate.high))
    verdict = Verdict.HOLDS if low > 0 else Verdict.FAILS if high <= 0 else Verdict.UNDECIDED
    found = Finding.of(verdict, estimate, n=own.total("episodes"))
    return replace(found, n_seeds=len(np.unique(own["pair"])))
