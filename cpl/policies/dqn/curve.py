"""The learning curve: what happened, a row for every so many decisions."""

from __future__ import annotations

import math

import numpy as np
import pandas as pd

__all__ = ["Curve", "DivergedError"]


class DivergedError(ArithmeticError):
    """Learning produced a loss that is not a finite number."""


class Curve:
    """Collects what a learner reports.

    Args:
        every: Decisions in a row.
        policy_frequency: Decisions a second [Hz].

    Example:
        >>> curve = Curve(every=2, policy_frequency=1)
        >>> curve.add(reward=0.5, ended=False, crashed=False, speed=25.0)
        >>> curve.add(reward=-1.0, ended=True, crashed=True, speed=30.0)
        >>> curve.learned(0.25)
        >>> curve.close(exploration=0.9, q_mean=0.1)
        >>> curve.table().iloc[0].to_dict()["episode_return"]
        -0.5
    """

    def __init__(self, *, every: int, policy_frequency: int) -> None:
        self.every = every
        self._frequency = policy_frequency
        self._rows: list[dict[str, float]] = []
        self._step = self._length = 0
        self._return = 0.0
        self._clear()

    def add(self, *, reward: float, ended: bool, crashed: bool, speed: float) -> None:
        """Count a decision."""
        self._step += 1
        self._length += 1
        self._return += reward
        self._speeds.append(speed)
        if ended:
            self._episodes.append((self._return, self._length / self._frequency, crashed))
            self._length, self._return = 0, 0.0

    def learned(self, loss: float) -> None:
        """Count an update.

        Raises:
            DivergedError: If the loss is not finite.
        """
        if not math.isfinite(loss):
            raise DivergedError(
                f"the loss is {loss} after {self._step} decisions: learning has diverged; "
                "look at learning_rate and at the rewards"
            )
        self._losses.append(loss)

    @property
    def due(self) -> bool:
        """Whether a row is complete."""
        return self._step % self.every == 0

    def close(self, *, exploration: float, q_mean: float) -> None:
        """End a row.

        Args:
            exploration: Probability of a random action now.
            q_mean: Mean value of the best actions in recent observations.
        """
        returns, durations, crashes = (
            (np.mean(column) for column in zip(*self._episodes, strict=True))
            if self._episodes
            else (math.nan,) * 3
        )
        self._rows.append(
            {
                "step": self._step,
                "episodes": len(self._episodes),
                "episode_return": float(returns),
                "duration_s": float(durations),
                "crash_rate": float(crashes),
                "speed_mps": float(np.mean(self._speeds)),
                "loss": float(np.mean(self._losses)) if self._losses else math.nan,
                "q_mean": q_mean,
                "exploration": exploration,
            }
        )
        self._clear()

    def table(self) -> pd.DataFrame:
        """Return the rows.

        Returns:
            `step` (decisions so far), `episodes` (ended since the row before), their mean
            `episode_return`, `duration_s` and `crash_rate`, `speed_mps` and `loss` averaged over
            the row's decisions and updates, `q_mean`, `exploration`; NaN where nothing happened.
        """
        return pd.DataFrame(self._rows)

    def _clear(self) -> None:
        self._episodes: list[tuple[float, float, bool]] = []
        self._speeds: list[float] = []
        self._losses: list[float] = []
