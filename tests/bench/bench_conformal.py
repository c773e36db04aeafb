"""Trackers: time a step, beside a plain Python loop and a public package on the same scores."""

import dataclasses
import math
import os
import subprocess
import sys
import tempfile
import time
from collections import deque
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from cpl.conformal import (
    PI,
    Decaying,
    Fixed,
    RunningMax,
    Tracker,
    TrailingMax,
    TrailingRange,
    track,
    track_exact,
    track_many,
)
from tests.bench.frame import Row, compare, fastest

PACKAGES = ("conformalopt",)

ALPHA = 0.1
ETA = 0.05
T = 1_000_000  # compiled
T_PLAIN = 200_000  # one score after the other in Python
T_PEER = 5_000  # the public package
WINDOW = 19  # what conformalopt's proportional step looks back
LOOP = "plain-Python loop"
PEER = "conformalopt"

SCORES = np.random.default_rng(0).random(T)
PLAIN = SCORES[:T_PLAIN].tolist()


def measure() -> Iterator[Row]:
    """Measure all rules whole and online, many streams, the import and the first call."""
    yield from fixed()
    yield from trailing_range()
    yield from integral()
    yield from others()
    yield from streams()
    yield from start()


def fixed() -> Iterator[Row]:
    """Measure the fixed step in all its forms; all of them must give the same thresholds."""
    rule = Fixed(eta=ETA)
    q = track(SCORES, rule, alpha=ALPHA).q
    assert loop_fixed(PLAIN)[0] == q[:T_PLAIN].tolist()
    assert np.array_equal(Tracker(rule, alpha=ALPHA).extend(PLAIN).q, q[:T_PLAIN])
    from_one = track(SCORES[:T_PEER], rule, alpha=ALPHA, q0=1.0).q
    assert np.allclose(public("fixed", ETA), from_one, rtol=0, atol=1e-9)
    subjects: dict[str, tuple[Callable[[], Any], int]] = {
        "track": (lambda: track(SCORES, rule, alpha=ALPHA), T),
        "track, delay=3": (lambda: track(SCORES, rule, alpha=ALPHA, delay=3), T),
        "track_exact": (lambda: track_exact(SCORES, rule, alpha=ALPHA), T),
        "Tracker.extend (plain Python)": (
            lambda: Tracker(rule, alpha=ALPHA).extend(SCORES[:T_PLAIN]),
            T_PLAIN,
        ),
        "Tracker.update (plain Python)": (lambda: online(rule), T_PLAIN),
        LOOP: (lambda: loop_fixed(PLAIN), T_PLAIN),
        PEER: (lambda: public("fixed", ETA), T_PEER),
    }
    limits = {"track": 5.0, "track, delay=3": 5.0, "Tracker.extend (plain Python)": 100.0,
              "Tracker.update (plain Python)": 100.0}  # fmt: skip
    yield from rows("conformal: fixed step", subjects, limits=limits)


def trailing_range() -> Iterator[Row]:
    """Measure a step from the trailing range; the public package has the same one."""
    rule = TrailingRange(lr=ETA, window=WINDOW)
    q = track(SCORES, rule, alpha=ALPHA).q
    assert loop_range(PLAIN) == q[:T_PLAIN].tolist()
    from_one = track(SCORES[:T_PEER], rule, alpha=ALPHA, q0=1.0).q
    assert np.allclose(public("proportional", ETA), from_one, rtol=0, atol=1e-9)
    wide = TrailingRange(lr=ETA, window=1000)
    subjects: dict[str, tuple[Callable[[], Any], int]] = {
        "track": (lambda: track(SCORES, rule, alpha=ALPHA), T),
        "track, window 1000": (lambda: track(SCORES, wide, alpha=ALPHA), T),
        "Tracker.update (plain Python)": (lambda: online(rule), T_PLAIN),
        LOOP: (lambda: loop_range(PLAIN), T_PLAIN),
        PEER: (lambda: public("proportional", ETA), T_PEER),
    }
    limits = {"track": 40.0, "track, window 1000": 40.0}
    yield from rows(f"conformal: trailing range, window {WINDOW}", subjects, limits=limits)


def integral() -> Iterator[Row]:
    """Measure PI: two more operations of the C library, a logarithm and a tangent, a step."""
    rule = PI(Fixed(eta=ETA), K_I=1.0, C_sat=5.0)
    assert loop_integral(PLAIN) == track(PLAIN, rule, alpha=ALPHA).q.tolist()
    ranged = PI(TrailingRange(lr=ETA, window=WINDOW), K_I=1.0, C_sat=5.0)
    subjects: dict[str, tuple[Callable[[], Any], int]] = {
        "track": (lambda: track(SCORES, rule, alpha=ALPHA), T),
        "track, on the trailing range": (lambda: track(SCORES, ranged, alpha=ALPHA), T),
        "Tracker.update (plain Python)": (lambda: online(rule), T_PLAIN),
        LOOP: (lambda: loop_integral(PLAIN), T_PLAIN),
    }
    yield from rows("conformal: PI", subjects, limits={"track": 40.0})


def others() -> Iterator[Row]:
    """Measure the remaining rules beside the fixed step."""
    rules = {
        "fixed": Fixed(eta=ETA),
        "running maximum": RunningMax(c=0.1),
        "trailing maximum": TrailingMax(c=0.1, window=100),
        "decaying": Decaying(c=1.0, power=0.6),
    }
    subjects: dict[str, tuple[Callable[[], Any], int]] = {
        name: (lambda rule=rule: track(SCORES, rule, alpha=ALPHA), T)
        for name, rule in rules.items()
    }
    yield from rows("conformal: the other rules, compiled", subjects, peer="fixed")


def streams() -> Iterator[Row]:
    """Measure a thousand streams of a thousand steps, beside numpy across the streams."""
    rule = Fixed(eta=ETA)
    scores = SCORES.reshape(1000, 1000)
    across = "numpy, a loop over time"
    assert np.array_equal(loop_streams(scores), track_many(scores, rule, alpha=ALPHA).q)
    subjects: dict[str, tuple[Callable[[], Any], int]] = {
        "track_many": (lambda: track_many(scores, rule, alpha=ALPHA), T),
        "track_many, delay=3": (lambda: track_many(scores, rule, alpha=ALPHA, delay=3), T),
        "track, row by row": (lambda: [track(row, rule, alpha=ALPHA) for row in scores], T),
        across: (lambda: loop_streams(scores), T),
    }
    yield from rows("conformal: 1000 streams of 1000 steps", subjects, peer=across,
                    limits={"track_many": 2.0})  # fmt: skip


def start() -> Iterator[Row]:
    """Measure a new process: the import, and the first call with nothing compiled before."""
    call = "track_many([[1.0] * 9] * 5, Fixed(eta=1.0), alpha=0.1)"
    with tempfile.TemporaryDirectory() as folder:
        cold = _process(f"from cpl.conformal import *; {call}", NUMBA_CACHE_DIR=folder)
    commands = {
        "import cpl.conformal": ("import cpl.conformal", 1.0),
        "import and first call, compiled before": (f"from cpl.conformal import *; {call}", None),
        "import numba": ("import numba", None),
    }
    seconds = fastest({name: (lambda code=code: _process(code)) for name, (code, _) in
                       commands.items()}, rounds=3, clock=time.perf_counter)  # fmt: skip
    for name, (_, limit) in commands.items():
        yield Row(bench="conformal: a new process", subject=name, value=seconds[name], unit="s",
                  limit=limit)  # fmt: skip
    yield Row(bench="conformal: a new process", subject="import and first call, to be compiled",
              value=cold, unit="s")  # fmt: skip


def rows(
    bench: str,
    subjects: dict[str, tuple[Callable[[], Any], int]],
    *,
    limits: dict[str, float] | None = None,
    peer: str = LOOP,
) -> list[Row]:
    """Time the subjects in turns, compare all with the peer, and the first with the package."""
    seconds = fastest({name: call for name, (call, _) in subjects.items()})
    per = {name: steps for name, (_, steps) in subjects.items()}
    found = compare(bench, seconds, per=per, unit="ns/step", scale=1e9, peer=peer, limits=limits)
    for package in [row for row in found if row.subject == PEER]:
        ratio = package.value / found[0].value
        found.append(dataclasses.replace(found[0], peer=PEER, ratio=ratio))
    return found


def online(rule: Any) -> None:
    """Feed one tracker, one score after the other."""
    update = Tracker(rule, alpha=ALPHA).update
    for score in PLAIN:
        update(score)


def public(lr_type: str, lr: float) -> list[float]:
    """Run the public package over the first scores and return its thresholds."""
    from conformalopt import ConformalPredictor  # only `make bench` installs it

    predictor = ConformalPredictor(ALPHA, lr_type, "scalar", hypers={"lr": lr})
    predictor.init_active_fields()
    for score in SCORES[:T_PEER].tolist():
        predictor.step(predictor.predict(), score)
    return predictor.past_predictions


def loop_fixed(scores: list[float]) -> tuple[list[float], list[bool]]:
    """Track with a fixed step as one writes it down, keeping thresholds and errors."""
    q, up, down = 0.0, ETA * (1 - ALPHA), ETA * ALPHA
    thresholds, errors = [], []
    for score in scores:
        err = score > q
        thresholds.append(q)
        errors.append(err)
        q = q + up if err else q - down
    return thresholds, errors


def loop_range(scores: list[float]) -> list[float]:
    """Track with a step from the trailing range, as one writes it down."""
    q, step = 0.0, ETA
    thresholds, seen = [], deque(maxlen=WINDOW)
    for score in scores:
        if seen:
            step = ETA * (max(seen) - min(seen))
        thresholds.append(q)
        q = q + step * (1 - ALPHA) if score > q else q - step * ALPHA
        seen.append(score)
    return thresholds


def loop_integral(scores: list[float]) -> list[float]:
    """Track with the fixed step and the integral, as one writes it down."""
    p = q = 0.0
    misses = 0
    thresholds = []
    log, tan = math.log, math.tan
    for t, score in enumerate(scores):
        err = score > q
        thresholds.append(q)
        p = p + ETA * (1 - ALPHA) if err else p - ETA * ALPHA
        q = p + tan((misses - t * ALPHA) * log(t + 1) / (5.0 * (t + 1)))
        misses += err
    return thresholds


def loop_streams(scores: np.ndarray) -> np.ndarray:
    """Track many streams with numpy: a loop over time, arrays across the streams."""
    q = np.zeros(len(scores))
    thresholds = np.empty_like(scores)
    for t in range(scores.shape[1]):
        thresholds[:, t] = q
        q = np.where(scores[:, t] > q, q + ETA * (1 - ALPHA), q - ETA * ALPHA)
    return thresholds


def _process(code: str, **environment: str) -> float:
    """Return the seconds a new interpreter takes for ``code``, its own start taken off."""
    timed = f"import time; t = time.perf_counter(); {code.replace('; ', chr(10))}"
    script = f"{timed}\nprint(time.perf_counter() - t)"
    done = subprocess.run([sys.executable, "-c", script], env=os.environ | environment,
                          capture_output=True, text=True, check=True)  # fmt: skip
    return float(done.stdout)
