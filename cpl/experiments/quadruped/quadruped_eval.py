"""Does the quantile help the robot? Three shapes, two gain ranges, five policies, paired by seed.

Paper: Section V-C: triangle, rectangle and hexagon, kp in [1.2, 1.8] (in distribution) and in
[0.8, 4] (out of it), pi_switch against No Quantile, three repeats. Beside them: the switch without
its false-positive rule (`corrected`), a constant gain, an oracle that knows the true future label,
and every policy with the supervisor between it and the robot.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated, Any

import pandas as pd

from cpl.conformal import RunningMax
from cpl.experiments.quadruped.lab import KINEMATIC, POLICIES, RANGES, policy, run_seed
from cpl.experiments.quadruped.quadruped_collect import PROFILES as COLLECTED
from cpl.experiments.quadruped.quadruped_predictor import need_predictor, trained
from cpl.experiments.run.spec import Experiment, Inputs, Shard, grid
from cpl.experiments.trained.pairs import Models
from cpl.quadruped import (
    SHAPES,
    GainLimits,
    Limits,
    Path,
    PolicyConfig,
    Predictor,
    RunConfig,
    SupervisorConfig,
    World,
    run,
    shape,
    summary,
)
from cpl.settings.ranges import Choice, Count, Settings

__all__ = ["EXPERIMENT", "PROFILES", "Config", "Walk", "walks"]

SUPERVISION = ("without", "with")


@dataclass(frozen=True, kw_only=True)
class Config(Settings):
    """What is compared.

    Attributes:
        collect: Profile of `quadruped_collect` that the predictor is trained on and the hall is
            taken from.
        policies: Names from `paper`, `no_quantile`, `corrected`, `constant`, `oracle`.
        supervision: `without`, `with` or both.
        shapes: Names from `triangle`, `rectangle`, `hexagon`.
        ranges: `in`, `out` or both.
        repeats: Runs a cell; the paper's 3.
        alpha: Miscoverage aimed at [-].
        q_safe: The switch's threshold [score].
        positive_weight: Weight of a SLAM error in the predictor's loss [-].
        epochs: Passes over the training data.
        max_s: A run longer than this is given up [s].
        seed: Draws the runs' noise and the predictor's first weights.
    """

    collect: Models
    policies: Annotated[tuple[str, ...], Choice(POLICIES)]
    supervision: Annotated[tuple[str, ...], Choice(SUPERVISION)] = ("without",)
    shapes: Annotated[tuple[str, ...], Choice(tuple(SHAPES))] = tuple(SHAPES)
    ranges: Annotated[tuple[str, ...], Choice(tuple(RANGES))] = tuple(RANGES)
    repeats: Count
    alpha: float = 0.2
    q_safe: float = 0.8
    positive_weight: float = 5.0
    epochs: int = 40
    max_s: float = 60.0
    seed: int = 0


PROFILES = {
    "smoke": Config(
        collect="smoke", policies=("paper",), shapes=("triangle",), repeats=1, epochs=2, max_s=2.0
    ),
    "book": Config(collect="book", policies=("paper", "no_quantile"), repeats=3),
    "paper": Config(collect="paper", policies=POLICIES, supervision=SUPERVISION, repeats=4),
}


def run_shard(config: Config, shard: Shard, inputs: Inputs) -> pd.DataFrame:
    """Run every policy once.

    Returns:
        One row a run: `shape`, `range`, `repeat`, `policy`, `supervision` and the numbers of
        `cpl.quadruped.summary`.
    """
    world = KINEMATIC.world(COLLECTED[config.collect])
    half_width_m = world.config.room.floor_half_width_m
    rows = [
        dict(shard.values)
        | {"policy": walk.policy, "supervision": walk.supervision}
        | summary(walk.rows, walk.path, floor_half_width_m=half_width_m)
        for walk in walks(world, KINEMATIC.limits, config, shard, trained(inputs))
    ]
    return pd.DataFrame(rows)


EXPERIMENT = Experiment(
    run=run_shard,
    profiles=PROFILES,
    shards=grid("{shape}-{range}-{repeat}", shape="shapes", range="ranges", repeat="repeats"),
    needs=lambda config, _: need_predictor(config),
    label=KINEMATIC.label,
    rtol=1e-6,
)


@dataclass(frozen=True, kw_only=True)
class Walk:
    """One run and how it came about.

    Attributes:
        policy: Its policy's name.
        supervision: `without` or `with`.
        path: The path it followed.
        rows: The log.
    """

    policy: str
    supervision: str
    path: Path
    rows: list[dict[str, Any]]


def walks(
    world: World, limits: Limits, config: Config, shard: Shard, net: Predictor
) -> Iterator[Walk]:
    """Walk a shard's runs, one a policy and kind of supervision.

    Args:
        world: Where.
        limits: What the robot may be asked for.
        config: How.
        shard: Which shape, range and repeat.
        net: The network.
    """
    path, (kp_min, kp_max) = shape(shard.text("shape")), RANGES[shard.text("range")]
    gains = GainLimits(kp_min=kp_min, kp_max=kp_max, q_safe=config.q_safe)
    tracking = PolicyConfig(alpha=config.alpha, rule=RunningMax(c=0.1))
    seed = run_seed(config.seed, "eval", path.name, shard.number("repeat"))
    conduct = RunConfig(max_s=config.max_s, limits=limits)
    for supervision in config.supervision:
        supervisor = SupervisorConfig() if supervision == "with" else None
        for name in config.policies:
            chosen = policy(name, gains, tracking, net)
            rows = list(run(world, path, chosen, supervisor, seed, conduct))
            yield Walk(policy=name, supervision=supervision, path=path, rows=rows)
