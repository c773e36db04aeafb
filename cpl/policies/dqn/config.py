"""The learner's settings, and the linear schedule of its exploration."""

from __future__ import annotations

import math
from dataclasses import dataclass

__all__ = ["LANES", "DQNConfig"]

LANES = 16
"""Numbers in a vector of the compiled learner: its layers and mini-batches are whole vectors."""


@dataclass(frozen=True, kw_only=True)
class DQNConfig:
    """Deep Q-learning as Stable-Baselines3 does it, with highway-env's documented settings.

    Paper: Section IV, Base Policies Training (200K steps, two layers of 256).

    Attributes:
        steps: Decisions taken on the road [-].
        hidden: Units of each hidden layer [-]; the compiled learner wants multiples of 16.
        learning_rate: Adam's step size [-].
        buffer_size: Transitions remembered [-].
        learning_starts: Decisions taken at random before the first update [-].
        batch_size: Transitions in an update [-]; the compiled learner wants a multiple of 16.
        gamma: Discount a decision [-], 0 to 1.
        train_freq: Decisions between updates [-].
        gradient_steps: Updates each time [-].
        target_update_interval: Decisions between copies to the target network [-].
        exploration_fraction: Share of the decisions over which exploration falls [-], (0, 1].
        exploration_initial: Probability of a random action at first [-].
        exploration_final: Probability of a random action at last [-].
        max_grad_norm: Longer gradients are scaled to this length [-].
        curve_every: Decisions in a row of the learning curve [-].

    Raises:
        ValueError: Naming the field and its value where learning would be impossible.

    Example:
        >>> round(DQNConfig(steps=1000).exploration(50), 3)
        0.525
        >>> DQNConfig(gamma=1.5)
        Traceback (most recent call last):
            ...
        ValueError: gamma must be a finite number in [0, 1], got 1.5
    """

    steps: int = 200_000
    hidden: tuple[int, ...] = (256, 256)
    learning_rate: float = 5e-4
    buffer_size: int = 15_000
    learning_starts: int = 200
    batch_size: int = 32
    gamma: float = 0.8
    train_freq: int = 1
    gradient_steps: int = 1
    target_update_interval: int = 50
    exploration_fraction: float = 0.1
    exploration_initial: float = 1.0
    exploration_final: float = 0.05
    max_grad_norm: float = 10.0
    curve_every: int = 1000

    def __post_init__(self) -> None:
        for name in _COUNTS:
            _check_count(name, getattr(self, name), least=int(name != "learning_starts"))
        if not self.hidden:
            raise ValueError(f"hidden must name at least one layer, got {self.hidden!r}")
        for units in self.hidden:
            _check_count("hidden", units, least=1)
        for name in ("gamma", "exploration_initial", "exploration_final"):
            _check_number(name, getattr(self, name), 0.0, 1.0)
        for name, top in (
            ("exploration_fraction", 1.0),
            ("learning_rate", math.inf),
            ("max_grad_norm", math.inf),
        ):
            value = getattr(self, name)
            _check_number(name, value, 0.0, top)
            if value == 0:
                raise ValueError(f"{name} must be positive, got {value!r}")

    def exploration(self, step: int) -> float:
        """Return the probability of a random action after so many decisions.

        Args:
            step: Decisions taken so far [-].

        Returns:
            The probability, falling linearly and then constant; Stable-Baselines3's arithmetic.
        """
        done = 1 - (1.0 - float(step) / float(self.steps))
        if done > self.exploration_fraction:
            return self.exploration_final
        fall = self.exploration_final - self.exploration_initial
        return self.exploration_initial + done * fall / self.exploration_fraction

    def check_vectors(self) -> None:
        """Refuse layers and batches that are not whole vectors of the compiled learner.

        Raises:
            ValueError: If one is no multiple of 16.
        """
        for name, values in (("hidden", self.hidden), ("batch_size", (self.batch_size,))):
            if any(value % LANES for value in values):
                raise ValueError(
                    f'{name} must be in multiples of {LANES} for learner="compiled", '
                    f"got {getattr(self, name)!r}"
                )


_COUNTS = (
    "steps",
    "buffer_size",
    "learning_starts",
    "batch_size",
    "train_freq",
    "gradient_steps",
    "target_update_interval",
    "curve_every",
)


def _check_count(name: str, value: object, least: int) -> None:
    if isinstance(value, bool) or not isinstance(value, int) or value < least:
        raise ValueError(f"{name} must be an integer >= {least}, got {value!r}")


def _check_number(name: str, value: object, low: float, high: float) -> None:
    number = value if isinstance(value, int | float) and not isinstance(value, bool) else math.nan
    if not (math.isfinite(number) and low <= number <= high):
        raise ValueError(f"{name} must be a finite number in [{low:g}, {high:g}], got {value!r}")
