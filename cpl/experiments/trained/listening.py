"""The agents that hear the forecast: what they hear, how they learn, how they are read back."""

from dataclasses import dataclass
from functools import partial

import numpy as np
import pandas as pd

from cpl.conformal import RunningMax
from cpl.experiments.run.spec import Inputs
from cpl.experiments.trained import base_policies
from cpl.experiments.trained.pairs import Models
from cpl.highway import Config as Road
from cpl.network import MLP, decode_networks
from cpl.policies.dqn import DQNConfig, train
from cpl.policies.evaluate import Forecast, Tracking
from cpl.policies.listen import Hearing, Listening, Penalty, View
from cpl.settings.ranges import Count, Probability, Settings

__all__ = [
    "AGENTS",
    "Lessons",
    "decoded",
    "hearing_of",
    "learn",
    "penalty_of",
    "training_road",
]

AGENTS = ("rl_nq", "rl", "rl_1", "rl_2", "rl_3")
"""Table I's: the forecast only; forecast and quantile; with penalties on q, on q l_hat, on both."""


@dataclass(frozen=True, kw_only=True)
class Lessons(Settings):
    """How an agent is trained, whatever its penalties.

    Attributes:
        pairs: Pairs of base policies, each with its own forecaster and agents.
        models: Profile of the experiments that trained policies and forecasters.
        steps: Decisions a training.
        gamma: Discount a decision [-].
        hidden: Units of each hidden layer.
        alpha: Miscoverage that the quantile aims at [-].
        share: The tracker's step as a share of the greatest score so far [-].
        delay: Steps after which a score is known [steps].
        carry: Whether an episode begins with the threshold that the one before ended with.
    """

    pairs: Count
    models: Models = "paper"
    steps: int = 200_000
    gamma: float = 0.8
    hidden: tuple[int, ...] = (256, 256)
    alpha: Probability = 0.1
    share: float = 0.1
    delay: int = 3
    carry: bool = False

    def __post_init__(self) -> None:
        super().__post_init__()
        DQNConfig(steps=self.steps, gamma=self.gamma, hidden=self.hidden)
        hearing_of("rl", lambda flat: (flat[:, 0], None), self.tracking)  # refuses the delay

    @property
    def learner(self) -> DQNConfig:
        """The learner's settings."""
        return DQNConfig(
            steps=self.steps,
            gamma=self.gamma,
            hidden=self.hidden,
            curve_every=max(1, min(1000, self.steps // 10)),
        )

    @property
    def tracking(self) -> Tracking:
        """The tracker's settings."""
        rule = RunningMax(c=self.share)
        return Tracking(rule=rule, alpha=self.alpha, delay=self.delay, carry=self.carry)


def hearing_of(agent: str, forecast: Forecast, tracking: Tracking) -> Hearing:
    """Return what an agent of Table I hears.

    Args:
        agent: One of `AGENTS`.
        forecast: The forecaster.
        tracking: The tracker's settings.

    Raises:
        ValueError: If there is no such agent.
    """
    if agent not in AGENTS:
        raise ValueError(f"agent must be one of {AGENTS}, got {agent!r}")
    view = View(quantiles=0) if agent == "rl_nq" else View()
    return Hearing(forecast=forecast, tracking=tracking, view=view)


def penalty_of(agent: str, q: float, product: float) -> Penalty:
    """Return an agent's penalty.

    Args:
        agent: One of `AGENTS`.
        q: Weight of the norm of q, for those that have that term.
        product: Weight of q l_hat, for those that have that term.

    Examples:
        >>> penalty_of("rl_2", 1.0, 2.0)
        Penalty(q=0.0, product=2.0)
    """
    return Penalty(
        q=q if agent in ("rl_1", "rl_3") else 0.0,
        product=product if agent in ("rl_2", "rl_3") else 0.0,
    )


def training_road(models: str) -> Road:
    """Return the road that pi_speed was trained on, whose reward the agents share."""
    return base_policies.road(base_policies.PROFILES[models], "speed")


def decoded(inputs: Inputs, name: str, shard: str) -> MLP:
    """Return a trained agent's network.

    Args:
        inputs: What `run_shard` was given.
        name: Of the need.
        shard: Of the experiment that trained it.

    Raises:
        ValueError: If it was not asked for.
        cpl.store.DamagedModelError: If its model is damaged.
    """
    tables = inputs[name]
    if shard not in tables:
        raise ValueError(f"shard must be among {sorted(tables)}, got {shard!r}")
    return decode_networks(tables[shard]["model"].iloc[-1]).network("q")


def learn(
    config: Lessons, hears: Hearing, penalty: Penalty, *, seed: int
) -> tuple[MLP, pd.DataFrame]:
    """Train an agent on the road of pi_speed.

    Args:
        config: How.
        hears: What it hears.
        penalty: What is taken off its reward.
        seed: Of everything random.

    Returns:
        The network, and the learning curve (`cpl.policies.dqn.curve.Curve.table`) with `q_seen`,
        `q_seen_95` and `q_seen_max`: mean, 95 % quantile and maximum of the quantiles along these
        decisions (NaN without a forecast among them).
    """
    road = training_road(config.models)
    lesson = Listening(road, hears, penalty=penalty, seed=seed)
    trained = train(config.learner, road, seed=seed, wrapper=lesson)
    table = trained.curve.copy()
    q = np.where(lesson.heard["l_hat"].notna(), lesson.heard["q"], np.nan)
    windows = np.arange(len(q)) // config.learner.curve_every
    parts = [q[(windows == row) & ~np.isnan(q)] for row in range(len(table))]
    for name, value in (
        ("q_seen", np.mean),
        ("q_seen_95", partial(np.quantile, q=0.95)),
        ("q_seen_max", np.max),
    ):
        table[name] = [float(value(part)) if part.size else np.nan for part in parts]
    return trained.network, table
