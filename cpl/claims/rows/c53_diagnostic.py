"""Row 53: the coverage of a frozen margin tells where the quantile makes a difference."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy import stats as sp

from cpl.claims.claim import Claim, Reader, Source
from cpl.claims.rows._gate import changing, decided, weights_of
from cpl.claims.verdict import Finding
from cpl.stats import interval, sums
from cpl.stats.matched import ratio

__all__ = ["CLAIM"]


def _decide(read: Reader) -> Finding:
    table, windows = changing(read("gate_stream")), read("gate_diagnostic")
    road = windows.where(windows["log"] == "road")
    worlds = sorted(set(table["world"]) & set(road["part"]))
    missing = np.array(
        [np.mean((road["nominal"] - road["coverage"])[road["part"] == name]) for name in worlds]
    )
    parts = [table.where(table["method"] == method) for method in ("frozen", "quantile")]
    frozen, tracked = (_crashes(part, worlds) for part in parts)
    weights = weights_of(frozen)
    (a, drawn_a), (b, drawn_b) = sums(frozen, weights), sums(tracked, weights)
    value = float(_rank(missing, (a - b)[None])[0])
    estimate = interval(value, _rank(missing, drawn_a - drawn_b), groups=weights.groups)
    estimate = replace(estimate, low=max(estimate.low, -1.0), high=min(estimate.high, 1.0))
    return decided(estimate, parts[1], wanted=1)


def _crashes(part: Source, worlds: list[str]) -> NDArray[np.float64]:
    """Crashes by pair, stream and world."""
    known = part.where(np.isin(part["world"], worlds))
    labels = (known[name] for name in ("pair", "stream", "world"))
    return ratio(known["crashes"], known["episodes"], *labels).over


def _rank(a: NDArray[np.floating], b: NDArray[np.floating]) -> NDArray[np.float64]:
    """Rank correlation of `a` with each row of `b`; 0 where one of the two does not vary."""
    first, rows = sp.rankdata(a), sp.rankdata(b, axis=1)
    return np.array(
        [
            np.corrcoef(first, row)[0, 1] if min(np.std(first), np.std(row)) > 0 else 0.0
            for row in rows
        ]
    )


CLAIM = Claim(
    row=53,
    claim="the coverage of a frozen margin tells where the quantile makes a difference",
    where="this book, Where the quantile earns its place",
    rule="rank correlation over the worlds of what a frozen margin fails to cover (other episodes) "
    "and of how much less often the quantile's gate crashes than the frozen one's; the "
    "interval must lie above 0",
    chapter="earns",
    ours=True,
    decide=_decide,
)
