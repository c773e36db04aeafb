"""Play a policy that asks for a threshold: tracked, and with every control in its place."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from types import ModuleType
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from cpl.conformal import Rule, Tracker
from cpl.conformal.family import EWMA
from cpl.rng import stream

__all__ = ["Playable", "play"]

Floats = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Playable:
    """What a module has to define.

    Attributes:
        make: Returns a Gymnasium environment.
        act: From an observation and the threshold to an action.
        score: From the last observation, the action taken and the new observation to how wrong the
            forecast was; None where there is no score.
        harm: From the last `info` and whether the episode was terminated to whether it ended badly.
        pace: From a step's reward and `info` to what caution costs, more is faster.
    """

    make: Callable[[], Any]
    act: Callable[[Any, float], Any]
    score: Callable[[Any, Any, Any], float | None]
    harm: Callable[[dict[str, Any], bool], bool]
    pace: Callable[[float, dict[str, Any]], float]

    @classmethod
    def of(cls, module: ModuleType) -> Playable:
        """Return what a module defines.

        Raises:
            ValueError: If something is missing.
        """
        names = ("make", "act", "score", "harm", "pace")
        lacking = [name for name in names if not callable(getattr(module, name, None))]
        if lacking:
            raise ValueError(f"{module.__name__} must define functions {', '.join(lacking)}")
        return cls(**{name: getattr(module, name) for name in names})


def play(
    system: Playable,
    rule: Rule,
    *,
    alpha: float,
    streams: int = 20,
    episodes: int = 10,
    constants: int = 5,
    seed: int = 0,
) -> pd.DataFrame:
    """Play streams of episodes with the tracked threshold, then the same seeds with the controls.

    The tracked threshold is carried through a stream's episodes. The controls: its own values in
    random order, their mean over all streams, those that the next stream had at that time, a moving
    average tuned to nothing, and constants between the least and the greatest tenth of its values.

    Args:
        system: What is played.
        rule: What tracks.
        alpha: Miscoverage aimed at.
        streams: Independent streams, >= 2.
        episodes: Episodes of each, the same seeds for everybody.
        constants: How many constants, >= 2.
        seed: Of everything.

    Returns:
        One row a method and stream, as `judge` takes them.
    """
    if streams < 2 or episodes < 1 or constants < 2:
        raise ValueError(
            "streams and constants must be >= 2 and episodes >= 1, got "
            f"{streams!r}, {constants!r}, {episodes!r}"
        )
    runner = _Runner(system, streams, episodes, seed)
    rows, q = runner.all(lambda: Tracker(rule, alpha=alpha), "tracked")
    pooled = np.concatenate(q)
    pooled = pooled[np.isfinite(pooled)] if np.isfinite(pooled).any() else np.zeros(1)
    mean, (low, high) = float(pooled.mean()), np.quantile(pooled, [0.1, 0.9]).tolist()
    mixed = stream(seed, "matter", "shuffle").permutation(pooled)
    average = EWMA(memory=20.0, deviations=1.3)
    found = [rows, runner.all(lambda: Tracker(average, alpha=alpha), "EWMA")[0]]
    found.append(runner.fixed(lambda _, t: float(mixed[t % len(mixed)]), "shuffled"))
    found.append(runner.fixed(lambda _, __: mean, "mean"))
    found.append(runner.fixed(lambda s, t: _at(q[(s + 1) % streams], t), "donor"))
    spread = max(high - low, 0.1 * abs(mean), 1e-9)
    found.extend(
        runner.fixed(lambda _, __, c=value: c, "constant", value)
        for value in np.linspace(mean - spread, mean + spread, constants).tolist()
    )
    return pd.DataFrame([row for part in found for row in part])


def _at(values: Floats, t: int) -> float:
    return float(values[min(t, len(values) - 1)])


class _Runner:
    """The system with its seeds."""

    def __init__(self, system: Playable, streams: int, episodes: int, seed: int) -> None:
        self.system, self.streams, self.episodes, self.seed = system, streams, episodes, seed

    def all(
        self, make: Callable[[], Tracker], method: str
    ) -> tuple[list[dict[str, Any]], list[Floats]]:
        """Play with trackers; return the rows and each stream's thresholds."""
        rows, thresholds = [], []
        for s in range(self.streams):
            tracker, seen = make(), list[float]()

            def threshold(_: int, tracker: Tracker = tracker, seen: list[float] = seen) -> float:
                seen.append(tracker.q)
                return tracker.q

            rows.append(self._stream(s, threshold, tracker, method, 0.0))
            thresholds.append(np.array(seen))
        return rows, thresholds

    def fixed(
        self, threshold: Callable[[int, int], float], method: str, value: float = 0.0
    ) -> list[dict[str, Any]]:
        """Play with thresholds by stream and step of the stream."""
        return [
            self._stream(s, lambda t, s=s: threshold(s, t), None, method, value)
            for s in range(self.streams)
        ]

    def _stream(
        self,
        s: int,
        threshold: Callable[[int], float],
        tracker: Tracker | None,
        method: str,
        value: float,
    ) -> dict[str, Any]:
        env, step = self.system.make(), 0
        harms, pace = 0, 0.0
        for episode in range(self.episodes):
            obs, info = env.reset(seed=self.seed + s * self.episodes + episode)
            terminated = truncated = False
            while not (terminated or truncated):
                q = threshold(step)
                action = self.system.act(obs, q)
                before = obs
                obs, reward, terminated, truncated, info = env.step(action)
                score = self.system.score(before, action, obs)
                if tracker is not None and score is not None:
                    tracker.feedback(float(score), q)
                pace += float(self.system.pace(float(reward), info))
                step += 1
            harms += bool(self.system.harm(info, bool(terminated)))
        env.close()
        return {
            "method": method, "value": value, "group": 0, "unit": s,
            "harms": harms, "episodes": self.episodes, "pace": pace, "steps": step,
        }  # fmt: skip
