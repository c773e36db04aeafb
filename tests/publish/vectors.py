"""Inputs of the tracker and its bounds with the answers of `cpl.conformal`, for other languages."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import asdict
from typing import Any

import numpy as np

from cpl.conformal import (
    PI,
    Decaying,
    Fixed,
    Rule,
    RunningMax,
    StateRule,
    TrailingMax,
    TrailingRange,
    adversary,
    bounds,
    reference,
    step_sizes,
    track,
)
from cpl.conformal.family import ACI, ECI, MEMBERS, PID, Rolling
from cpl.rng import stream

__all__ = ["tracker_vectors"]

_EXACT, _ROUNDED = 0.0, 1e-9  # pow, log and tan differ in the last bit between libraries


def tracker_vectors() -> dict[str, list[dict[str, Any]]]:
    """Return inputs of the tracker and its bounds with the answers of `cpl.conformal`.

    Whoever writes the tracker in another language can compare; `_static/live/tracker.js` does.

    Returns:
        Lists `tracks`, `exact`, `bounds`, `varying` and `adversaries`, of mappings that say what
        went in and what came out. Infinite thresholds are the texts `Infinity` and `-Infinity`.

    Examples:
        >>> sorted(tracker_vectors())
        ['adversaries', 'bounds', 'exact', 'tracks', 'varying']
    """
    return {
        "tracks": list(_tracks()),
        "exact": list(_exact()),
        "bounds": list(_bounds()),
        "varying": list(_varying()),
        "adversaries": list(_adversaries()),
    }


def _tracks() -> Iterator[dict[str, Any]]:
    rng = stream(1, "live", "tracks")
    for rule, tolerance in (*_RULES, *_FAMILY):
        for alpha, delay, q0 in _WAYS:
            scores = rng.uniform(0, 1, 60) * np.where(np.arange(60) < 30, 0.3, 1.0)
            scores[rng.integers(0, 60, 6)] = rng.choice([0.0, 1.0], 6)
            q, err = track(scores, rule, alpha=alpha, delay=delay, q0=q0)
            yield {
                "rule": _named(rule),
                "alpha": alpha,
                "delay": delay,
                "q0": q0,
                "tolerance": tolerance,
                "scores": scores.tolist(),
                "q": [_number(x) for x in q.tolist()],
                "err": err.astype(int).tolist(),
            }


def _exact() -> Iterator[dict[str, Any]]:
    rng = stream(1, "live", "exact")
    for alpha, eta, delay in ((0.1, 0.1, 1), (0.25, 0.5, 1), (0.01, 1.0, 4), (0.37, 0.07, 3)):
        # Thresholds are multiples of alpha eta: so are these scores, and some tie.
        unit = alpha * eta
        scores = [round(round(float(s) / unit) * unit, 6) for s in rng.uniform(0, 1, 80)]
        path = reference.follow(scores, alpha=alpha, eta=eta, delay=delay)
        yield {
            "alpha": alpha,
            "eta": eta,
            "delay": delay,
            "scores": scores,
            "q": [float(q) for q in path.q[: len(scores)]],
            "err": [int(e) for e in path.err],
        }


def _bounds() -> Iterator[dict[str, Any]]:
    for alpha, eta, B in ((0.1, 0.1, 1), (0.2, 0.1, 1), (0.07, 0.03, 1), (0.5, 2.5, 1.7)):
        for W in (1, 5, 13, 40, 200):
            for delay in (1, 3):
                walls = bounds.quantile_range(alpha, eta, B, delay=delay)
                yield {
                    "alpha": alpha,
                    "eta": eta,
                    "B": B,
                    "W": W,
                    "delay": delay,
                    "most": bounds.max_errors(alpha, eta, B, W, delay=delay),
                    "fewest": bounds.min_errors(alpha, eta, B, W, delay=delay),
                    "rate": bounds.error_rate_bound(alpha, eta, B, W, delay=delay),
                    "low": walls.low,
                    "high": walls.high,
                    "informative": bounds.smallest_informative_window(alpha, eta, B, delay=delay),
                }


def _varying() -> Iterator[dict[str, Any]]:
    scores = stream(1, "live", "varying").uniform(0.1, 1, 60)
    for rule in (Fixed(eta=0.1), RunningMax(c=0.1), Decaying(c=1.0, power=0.6)):
        etas = step_sizes(scores, rule)
        window, largest = etas[20:50].tolist(), float(etas[:50].max())
        deviation = bounds.variable_step_bound(window, 1.0, largest_eta=largest)
        yield {"etas": window, "largest": largest, "B": 1, "deviation": deviation}


def _adversaries() -> Iterator[dict[str, Any]]:
    for alpha, eta, W, delay in ((0.1, 0.1, 40, 1), (0.1, 0.1, 40, 3), (0.3, 0.25, 25, 2)):
        worst = adversary.upper_worst_case(alpha, eta, 1, W, delay=delay)
        scores = [float(s) for s in worst.scores]
        yield {"alpha": alpha, "eta": eta, "B": 1, "W": W, "delay": delay, "scores": scores}


def _named(rule: Rule) -> Mapping[str, Any]:
    """Return a rule as the scripts write it."""
    match rule:
        case StateRule():
            return {"kind": _KINDS[type(rule)], **asdict(rule)}
        case PI():
            inner, gains = _named(rule.rule), (rule.K_I, rule.C_sat, rule.lag)
            return {
                "kind": "pi",
                "rule": inner,
                **dict(zip(("K_I", "C_sat", "lag"), gains, strict=True)),
            }
        case TrailingMax():
            return {"kind": "trailing-max", "c": rule.c, "window": rule.window}
        case TrailingRange():
            return {"kind": "trailing-range", "lr": rule.lr, "window": rule.window}
        case RunningMax():
            return {"kind": "running-max", "c": rule.c}
        case Decaying():
            return {"kind": "decaying", "c": rule.c, "power": rule.power}
        case Fixed():
            return {"kind": "fixed", "eta": rule.eta}
    msg = f"rule must be one that the scripts know, got {rule!r}"
    raise ValueError(msg)


def _number(value: float) -> float | str:
    """Return a number, or the name that JavaScript has for one that JSON cannot write."""
    return value if math.isfinite(value) else "Infinity" if value > 0 else "-Infinity"


_RULES: tuple[tuple[Rule, float], ...] = (
    (Fixed(eta=0.1), _EXACT),
    (Fixed(eta=0.037), _EXACT),
    (RunningMax(c=0.1), _EXACT),
    (TrailingMax(c=0.2, window=5), _EXACT),
    (TrailingRange(lr=0.2, window=10), _EXACT),
    (Decaying(c=0.5, power=0.6), _ROUNDED),
    (PI(Fixed(eta=0.05), K_I=0.2, C_sat=0.15), _ROUNDED),
    (PI(Fixed(eta=0.05), K_I=0.2, C_sat=0.15, lag=0), _ROUNDED),
)
_FAMILY: tuple[tuple[Rule, float], ...] = (
    *((member.make(0.5), _ROUNDED) for member in MEMBERS.values()),
    (ACI(gamma=0.2, window=5, quantile="corrected"), _ROUNDED),
    (ACI(gamma=0.2, window=5, quantile="linear", clip=True), _ROUNDED),
    (Rolling(window=7, quantile="higher"), _ROUNDED),
    (ECI(eta=0.3, window=5, form="accumulated", cutoff=True), _ROUNDED),
    (ECI(eta=0.3, window=0, decay=0.9), _ROUNDED),
    (PID(eta=0.1, K_I=1.0, C_sat=0.05, level=0.5, trend=0.3), _ROUNDED),
)
_KINDS = {type(member.make(1.0)): name for name, member in MEMBERS.items()}
_WAYS = ((0.1, 1, 0.0), (0.1, 3, 0.25), (0.31, 2, 0.0))
