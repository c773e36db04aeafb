"""The book's own three claims, about the look-ahead: rows 51 to 53, decided like the paper's.

What is said here was written down before the test seeds of `gate_stream` were looked at.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import stats as sp

from cpl.claims._reading import Reader, Source
from cpl.claims._statements import Claim
from cpl.claims._verdicts import Finding, Verdict
from cpl.rng import stream
from cpl.stats import Estimate, Weights, hierarchical_weights, interval, sums
from cpl.stats.matched import beside_curve, ratio

__all__ = ["CLAIMS", "RULES"]

CLAIMS: tuple[Claim, ...] = (
    Claim(
        51,
        "looking ahead with the ego car's own model pays, without any quantile",
        "this book, Where the quantile earns its place",
        None,
        "crash rate of the gate with a constant margin of 3 m over the changing stream, minus that "
        "of pi_speed under a speed cap at the same pooled mean speed; the interval must lie below "
        "0",
        "earns",
    ),
    Claim(
        52,
        "the tracked quantile of the look-ahead's error pays where the world changes unnoticed",
        "this book, Where the quantile earns its place",
        None,
        "crash rate of the gate with the quantile over the changing stream, minus that of the best "
        "constant margin at the same pooled mean speed; the interval must lie below 0",
        "earns",
    ),
    Claim(
        53,
        "the coverage of a frozen margin tells where the quantile makes a difference",
        "this book, Where the quantile earns its place",
        None,
        "rank correlation over the worlds of what a frozen margin fails to cover (other episodes) "
        "and of how much less often the quantile's gate crashes than the frozen one's; the "
        "interval must lie above 0",
        "earns",
    ),
)

_CONSTANT = 3.0  # [m]


def _gate(read: Reader) -> Finding:
    table = _changing(read("gate_controls"))
    own = table.where((table["method"] == "constant") & (table["value"] == _CONSTANT))
    caps = table.where(np.isin(table["method"], ["speed cap", "pi_speed"]))
    # Without a cap is a cap that nobody reaches.
    points = np.where(caps["method"] == "speed cap", caps["value"], np.inf)
    return _decided(_beside(own, caps, points), own)


def _quantile(read: Reader) -> Finding:
    table = _changing(read("gate_stream"))
    own = table.where(table["method"] == "quantile")
    constants = table.where(table["method"] == "constant")
    found = _decided(_beside(own, constants, constants["value"]), own)
    mixed = _beside(own, constants, constants["value"], mixtures=True)
    if found.verdict is Verdict.HOLDS and mixed.high >= 0:
        return replace(found, flags=("not beside mixtures of constants",))
    return found


def _diagnostic(read: Reader) -> Finding:
    table, windows = _changing(read("gate_stream")), read("gate_diagnostic")
    road = windows.where(windows["log"] == "road")
    worlds = sorted(set(table["world"]) & set(road["part"]))
    missing = np.array(
        [np.mean((road["nominal"] - road["coverage"])[road["part"] == name]) for name in worlds]
    )
    parts = [table.where(table["method"] == method) for method in ("frozen", "quantile")]
    frozen, tracked = (_crashes(part, worlds) for part in parts)
    weights = _weights(frozen)
    (a, drawn_a), (b, drawn_b) = sums(frozen, weights), sums(tracked, weights)
    drawn = np.array([_rank(missing, row) for row in drawn_a - drawn_b])
    estimate = interval(_rank(missing, a - b), drawn, groups=weights.groups)
    estimate = replace(estimate, low=max(estimate.low, -1.0), high=min(estimate.high, 1.0))
    return _decided(estimate, parts[1], wanted=1)


def _crashes(part: Source, worlds: list[str]) -> NDArray[np.float64]:
    """Crashes by pair, stream and world."""
    known = part.where(np.isin(part["world"], worlds))
    labels = (known[name] for name in ("pair", "stream", "world"))
    return ratio(known["crashes"], known["episodes"], *labels).over


def _rank(a: NDArray[np.floating], b: NDArray[np.floating]) -> float:
    """Rank correlation; 0 where one of the two does not vary."""
    ranked = sp.rankdata(a), sp.rankdata(b)
    if min(np.std(part) for part in ranked) == 0:
        return 0.0
    return float(np.corrcoef(*ranked)[0, 1])


def _changing(source: Source) -> Source:
    return source.where(source["setting"] == "changing")


def _beside(
    own: Source, curve: Source, points: NDArray[Any], *, mixtures: bool = False
) -> Estimate:
    mine, theirs = (own["pair"], own["stream"]), (curve["pair"], curve["stream"], points)
    crashes = ratio(own["crashes"], own["episodes"], *mine)
    return beside_curve(
        crashes,
        ratio(own["speed_sum"], own["steps"], *mine),
        ratio(curve["crashes"], curve["episodes"], *theirs),
        ratio(curve["speed_sum"], curve["steps"], *theirs),
        _weights(crashes.over),
        mixtures=mixtures,
    )


def _weights(each: NDArray[np.float64]) -> Weights:
    """Resample pairs, then streams, which are the same in all pairs."""
    pairs, streams = each.shape[:2]
    return hierarchical_weights(pairs, streams, stream(0, "claims", "gate"))


def _decided(estimate: Estimate, own: Source, wanted: int = -1) -> Finding:
    """Decide by the sign of an interval; `wanted` is the sign that was claimed."""
    low, high = sorted((wanted * estimate.low, wanted * estimate.high))
    verdict = Verdict.HOLDS if low > 0 else Verdict.FAILS if high <= 0 else Verdict.UNDECIDED
    return Finding(
        verdict=verdict,
        value=estimate.value,
        low=estimate.low,
        high=estimate.high,
        n=own.total("episodes"),
        n_seeds=len(np.unique(own["pair"])),
    )


RULES: dict[int, Callable[[Reader], Finding]] = {51: _gate, 52: _quantile, 53: _diagnostic}
"""The rules by row."""
