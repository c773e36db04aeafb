"""Somebody's own forecaster: its scores in; threshold, coverage and the bound that holds out."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from cpl.conformal import PI, Decaying, Fixed, Rule, RunningMax, StateRule, step_sizes, track
from cpl.conformal.bounds import max_errors_from_start, variable_step_bound

__all__ = ["Audit", "audit", "environment_scores"]


@dataclass(frozen=True, kw_only=True)
class Audit:
    """How a tracker fared on a sequence of scores.

    Attributes:
        table: One row a step: `t` (from 1), `score`, `q` (the threshold it met), `err`.
        alpha: Miscoverage aimed at [-].
        delay: Steps until a score is known [steps].
        bound: Most misses that this rule can make in as many steps, whatever the scores, as long
            as none exceeds `largest`; None where no bound is known.
        unbounded: Why no bound is known; empty where one is.
        largest: The largest score, to which the bound refers [score].
    """

    table: pd.DataFrame
    alpha: float
    delay: int
    bound: int | None
    unbounded: str
    largest: float

    @property
    def errors(self) -> int:
        """Scores that exceeded their threshold."""
        return int(np.count_nonzero(self.table["err"]))

    @property
    def coverage(self) -> float:
        """Share of scores that did not."""
        return 1.0 - self.errors / len(self.table)

    def windows(self, W: int) -> NDArray[np.float64]:
        """Return the coverage of every window of `W` steps, shape (T - W + 1,).

        Raises:
            ValueError: If there are fewer than `W` steps.
        """
        if not 1 <= W <= len(self.table):
            raise ValueError(f"W must lie in [1, {len(self.table)}], got {W!r}")
        missed = np.concatenate([[0], np.cumsum(self.table["err"].to_numpy())])
        return 1.0 - (missed[W:] - missed[:-W]) / W


def audit(scores: ArrayLike, rule: Rule, *, alpha: float, delay: int = 1) -> Audit:
    r"""Track a sequence of scores, and say what could have happened at worst.

    For a fixed step the bound is exact (Theorem 1, corrected, from the start at 0); for a running
    maximum without delay it is Abel's, $(B+H)V$ more misses than $\alpha T$. For a trailing
    maximum there is none: it can freeze (see the chapter "Stretching the theorem").

    Paper: Theorem 1 and the sentence after it.

    Args:
        scores: Finite scores in the order in which the forecasts were made, shape (T,), T >= 1.
        rule: How large the steps are.
        alpha: Miscoverage aimed at [-], in (0, 1).
        delay: After how many steps a score is known [steps]; the forecast's horizon.

    Raises:
        ValueError: If there is no score, one is not finite, or a setting is out of its range.

    Examples:
        >>> found = audit([0.0, 0.3, 0.3, 0.3], Fixed(eta=0.25), alpha=0.5)
        >>> found.table["q"].tolist(), found.errors, found.bound
        ([0.0, -0.125, 0.0, 0.125], 3, 3)
    """
    values = np.asarray(scores, dtype=np.float64)
    if values.ndim != 1 or not len(values):
        raise ValueError(f"scores must be one sequence of at least 1, got shape {values.shape}")
    if not np.isfinite(values).all():
        first = int(np.argmin(np.isfinite(values)))
        raise ValueError(f"scores must be finite, got {values[first]} at step {first + 1}")
    if delay > len(values):
        raise ValueError(
            f"delay must be at most the number of scores, got {delay!r} and {len(values)}: no "
            "score would ever be known"
        )
    tracked = track(values, rule, alpha=alpha, delay=delay)
    table = pd.DataFrame(
        {"t": np.arange(1, len(values) + 1), "score": values, "q": tracked.q, "err": tracked.err}
    )
    bound, unbounded = _bound(values, rule, alpha, delay)
    return Audit(
        table=table,
        alpha=alpha,
        delay=delay,
        bound=bound,
        unbounded=unbounded,
        largest=float(values.max()),
    )


def environment_scores(
    env: Any,  # noqa: ANN401 - a gymnasium.Env of any spaces
    target: Callable[[Any], float],
    *,
    horizon: int,
    steps: int,
    seed: int,
    policy: Callable[[Any], Any] | None = None,
    forecast: Callable[[Any], float] | None = None,
) -> NDArray[np.float64]:
    r"""Drive a Gymnasium environment and score a forecast of something in it.

    $$ s_t = \lvert y_{t+h} - \hat y_{t+h \mid t} \rvert $$

    An episode's last `horizon` forecasts are never checked and give no score.

    Args:
        env: A `gymnasium.Env`.
        target: What is forecast, y, from an observation.
        horizon: Steps ahead h [steps], >= 1.
        steps: Scores to collect.
        seed: Seed of the first episode; the next ones count on.
        policy: From an observation to an action; seeded random actions unless given.
        forecast: From an observation to the forecast of y, h steps later; persistence (y stays
            what it is) unless given.

    Returns:
        The scores, shape (steps,), one episode after the other.

    Raises:
        ValueError: If `horizon` or `steps` is below 1, a forecast or target is not finite, or the
            episodes are too short for a single score.
    """
    if horizon < 1 or steps < 1:
        raise ValueError(f"horizon and steps must be at least 1, got {horizon!r} and {steps!r}")
    guess = target if forecast is None else forecast
    env.action_space.seed(seed)
    scores: list[float] = []
    barren = 0
    for episode in range(10 * steps):
        before = len(scores)
        obs, _ = env.reset(seed=seed + episode)
        pending: deque[float] = deque([float(guess(obs))], maxlen=horizon)
        ended = False
        while not ended and len(scores) < steps:
            action = env.action_space.sample() if policy is None else policy(obs)
            obs, _, terminated, truncated, _ = env.step(action)
            ended = terminated or truncated
            if len(pending) == horizon:
                scores.append(abs(float(target(obs)) - pending[0]))
            pending.append(float(guess(obs)))
        if scores and not math.isfinite(scores[-1]):
            raise ValueError(
                f"target and forecast must be finite, got {scores[-1]} in episode {episode}"
            )
        if len(scores) >= steps:
            break
        barren = barren + 1 if len(scores) == before else 0
        if barren >= 20:
            raise ValueError(f"horizon must be shorter than some episode, got {horizon!r}")
    return np.array(scores[:steps])


def _bound(
    scores: NDArray[np.float64], rule: Rule, alpha: float, delay: int
) -> tuple[int | None, str]:
    """Return the most misses that are possible, or None and why that is not known."""
    largest, T = float(scores.max()), len(scores)
    if scores.min() < 0:
        return None, f"a score is negative ({scores.min():g}), and the theorem is about [0, B]"
    if largest <= 0:
        return None, "every score is 0"
    if isinstance(rule, Fixed):
        # A threshold summed in floats drifts by rounding, which is as if the scores did: where a
        # score meets its threshold exactly, that can decide a miss.
        drift = 4 * np.finfo(np.float64).eps * T * (largest + rule.eta)
        return max_errors_from_start(alpha, rule.eta, largest + drift, T, delay=delay), ""
    if isinstance(rule, StateRule):
        if delay > 1:
            return None, f"with a delay of {delay} none is known for this member of the family"
        most = rule.most_errors(alpha=alpha, B=largest, T=T)
        return most, "" if most is not None else "this member promises no count of errors"
    if isinstance(rule, Decaying | PI):
        return None, "this rule promises the long run, and no count of errors before"
    if not isinstance(rule, RunningMax):
        return None, "for this rule there is none: it can freeze"
    if delay > 1:
        return None, f"with a delay of {delay} none is known for steps that vary"
    etas = step_sizes(scores, rule)
    if etas.min() <= 0:
        return None, "the first score is 0, so that the first step is 0 and bounds nothing"
    more = float(variable_step_bound(etas.tolist(), largest))
    return (T if alpha * T + more >= T else math.floor(alpha * T + more)), ""
