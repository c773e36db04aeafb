"""How do pi_safe and pi_speed learn to drive?

The paper's two base policies (Section IV, Base Policies Training): the same learner on the same
road, one paid only for not crashing, the other for speed as well. Everything the switch is about
begins with these networks, and the paper has one of each; the pairs here are trainings that differ
in their seed only.
"""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
import pandas as pd

from cpl.experiments.run.spec import Experiment, Shard, grid
from cpl.highway import Config as Road
from cpl.network import encode_networks
from cpl.policies.dqn import DQNConfig, train
from cpl.policies.dqn.training import LearnerName
from cpl.rng import stream
from cpl.settings.ranges import Choice, Count, Settings, interval
from cpl.store import plain

__all__ = ["EXPERIMENT", "KINDS", "PROFILES", "Config", "road"]


KINDS = ("safe", "speed")

_SEEDS = 10_000_000  # training seeds lie below; validation and test seeds above


@dataclass(frozen=True, kw_only=True)
class Config(Settings):
    """The trainings.

    Attributes:
        pairs: Trainings of each of the two policies.
        steps: Decisions a training.
        learner: "compiled", or "sb3" for the reference.
        low_speed_mps: Lower end of the speed range [m/s].
        top_speed_mps: Upper end of it [m/s].
        levels: Speed levels, evenly spaced.
        collision_reward: Paid for a crash, to both.
        high_speed_reward: Paid at 30 m/s, and in proportion from 20 m/s on, to pi_speed only.
        right_lane_reward: Paid in the rightmost lane, to both.
        normalize_reward: Whether the sum is mapped to [0, 1].
        observed_rows: Rows of the observation, the ego car's included.
        lanes_count: Lanes.
        vehicles_count: Other cars.
        duration_s: An episode ends after this time [s], or with a crash.
        hidden: Units of each hidden layer.
    """

    pairs: Count
    steps: int = 200_000
    learner: Annotated[str, Choice(("compiled", "sb3"))] = "compiled"
    low_speed_mps: float = 20.0
    top_speed_mps: float = 30.0
    levels: Annotated[int, interval("[2, inf)")] = 3
    collision_reward: float = -1.0
    high_speed_reward: float = 0.5
    right_lane_reward: float = 0.0
    normalize_reward: bool = False
    observed_rows: int = 5
    lanes_count: int = 4
    vehicles_count: int = 50
    duration_s: float = 40.0
    hidden: tuple[int, ...] = (256, 256)

    def __post_init__(self) -> None:
        super().__post_init__()
        road(self, "safe")  # refuses what no road can be
        DQNConfig(steps=self.steps, hidden=self.hidden)


def road(config: Config, kind: str) -> Road:
    """Return the road that a policy is trained on.

    Args:
        config: The trainings.
        kind: "safe" or "speed".

    Raises:
        ValueError: If the kind is another, or the road impossible.
    """
    if kind not in KINDS:
        raise ValueError(f"kind must be one of {KINDS}, got {kind!r}")
    speeds = np.linspace(config.low_speed_mps, config.top_speed_mps, config.levels)
    return Road(
        target_speeds=tuple(speeds.tolist()),
        collision_reward=config.collision_reward,
        high_speed_reward=config.high_speed_reward if kind == "speed" else 0.0,
        right_lane_reward=config.right_lane_reward,
        normalize_reward=config.normalize_reward,
        observation_vehicles_count=config.observed_rows,
        lanes_count=config.lanes_count,
        vehicles_count=config.vehicles_count,
        duration=config.duration_s,
    )


PROFILES = {
    "smoke": Config(pairs=1, steps=1_500, vehicles_count=8, hidden=(64, 64)),
    "book": Config(pairs=1, steps=30_000),
    "paper": Config(pairs=10),
}


def run_shard(config: Config, shard: Shard) -> pd.DataFrame:
    """Train one policy.

    Returns:
        Its learning curve, see `cpl.policies.dqn.curve.Curve.table`, after the columns `kind`,
        `pair` and `seed`; the last row's `model` holds the network "q" with its settings, the
        others' are empty.
    """
    kind, pair = shard.text("kind"), shard.number("pair")
    seed = int(stream(pair, "base_policies", kind).integers(_SEEDS))
    settings = DQNConfig(
        steps=config.steps, hidden=config.hidden, curve_every=max(1, min(1000, config.steps // 10))
    )
    learner: LearnerName = "compiled" if config.learner == "compiled" else "sb3"
    trained = train(settings, road(config, kind), seed=seed, learner=learner)
    table = trained.curve
    for place, (name, value) in enumerate({"kind": kind, "pair": pair, "seed": seed}.items()):
        table.insert(place, name, value)
    how = EXPERIMENT.without_extent(plain(config))
    told = {"kind": kind, "pair": pair, "seed": seed, "parameters": how}
    table["model"] = b""
    table.loc[len(table) - 1, "model"] = encode_networks({"q": trained.network}, told)
    return table


EXPERIMENT = Experiment(
    run=run_shard,
    profiles=PROFILES,
    shards=grid("{kind}-{pair}", pair="pairs", kind=KINDS),
    label="simulated",
    extent=("pairs",),
    rtol=1e-6,  # of the learning curve's means; models agree bit for bit
)
