"""Training as one stage: settings, a road and a seed in, a network and its learning curve out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, get_args

import pandas as pd

from cpl.highway import Config
from cpl.network import MLP
from cpl.policies.dqn.compiled import train_compiled
from cpl.policies.dqn.config import DQNConfig
from cpl.policies.dqn.task import Task, Wrapper

__all__ = ["LearnerName", "Trained", "train"]

LearnerName = Literal["compiled", "sb3"]


@dataclass(frozen=True, kw_only=True)
class Trained:
    """What a training leaves.

    Attributes:
        network: The value of each action for an observation.
        curve: The learning curve, see `cpl.policies.dqn.curve.Curve.table`.
    """

    network: MLP
    curve: pd.DataFrame


def train(
    config: DQNConfig,
    road: Config | Sequence[Config],
    *,
    seed: int,
    learner: LearnerName = "compiled",
    wrapper: Wrapper | None = None,
) -> Trained:
    """Train a driver with deep Q-learning.

    Both learners are the same algorithm with the same random numbers: they drive the same episodes
    until the last bits of their sums differ enough to turn a decision. "sb3" is the reference and
    needs torch and Stable-Baselines3; "compiled" is several times faster, and the same seed gives
    the same bytes.

    Args:
        config: The learner's settings.
        road: The road; or several, of which each episode draws one.
        seed: Seed of everything random, an integer in [0, 2**32).
        learner: "compiled" or "sb3".
        wrapper: What the learner sees and is paid in place of the road's own.

    Returns:
        The network and the learning curve.

    Raises:
        ValueError: If an argument is out of range.
        DivergedError: If a loss is not finite.

    Example:
        >>> quick = DQNConfig(steps=60, hidden=(16,), learning_starts=20, batch_size=16)
        >>> trained = train(quick, Config(vehicles_count=3), seed=0)
        >>> trained.network.sizes
        (25, 16, 5)
    """
    if learner not in get_args(LearnerName):
        raise ValueError(f"learner must be one of {get_args(LearnerName)}, got {learner!r}")
    if isinstance(seed, bool) or not isinstance(seed, int) or not 0 <= seed < 2**32:
        raise ValueError(f"seed must be an integer in [0, 2**32), got {seed!r}")
    task = Task((road,) if isinstance(road, Config) else tuple(road), wrapper, seed)
    if learner == "compiled":
        network, curve = train_compiled(config, task, seed)
    else:
        from cpl.policies.dqn.reference import train_reference

        network, curve = train_reference(config, task, seed)
    return Trained(network=network, curve=curve)
