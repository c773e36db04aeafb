"""Does the quantile help the robot? Three shapes, two gain ranges, five policies, paired by seed.

Paper: Section V-C: triangle, rectangle and hexagon, kp in [1.2, 1.8] (in distribution) and in
[0.8, 4] (out of it), pi_switch against No Quantile, three repeats. Beside them: the switch without
its false-positive rule (`corrected`), a constant gain, an oracle that knows the true future label,
and every policy with the supervisor between it and the robot.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import pandas as pd

from cpl.conformal import RunningMax
from cpl.experiments.quadruped import quadruped_predictor
from cpl.experiments.quadruped.lab import POLICIES, RANGES, lab, policy, run_seed
from cpl.experiments.quadruped.quadruped_collect import PROFILES as COLLECT_PROFILES
from cpl.experiments.quadruped.quadruped_predictor import trained
from cpl.experiments.run.need import Inputs, Need
from cpl.experiments.run.shard import Shard
from cpl.quadruped import (
    SHAPES,
    GainLimits,
    Path,
    PolicyConfig,
    Predictor,
    RunConfig,
    SupervisorConfig,
    run,
    shape,
    summary,
)

__all__ = [
    "LABEL",
    "PROFILES",
    "Config",
    "Walk",
    "run_shard",
    "shards",
    "trained_need",
    "upstream",
    "walks",
]

LABEL = "simulated-kinematic"
RTOL = 1e-6
SUPERVISION = ("without", "with")


@dataclass(frozen=True, kw_only=True)
class Config:
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

    collect: str
    policies: tuple[str, ...]
    supervision: tuple[str, ...] = ("without",)
    shapes: tuple[str, ...] = tuple(SHAPES)
    ranges: tuple[str, ...] = tuple(RANGES)
    repeats: int
    alpha: float = 0.2
    q_safe: float = 0.8
    positive_weight: float = 5.0
    epochs: int = 40
    max_s: float = 60.0
    seed: int = 0

    def __post_init__(self) -> None:
        for name, known in (
            ("policies", POLICIES),
            ("supervision", SUPERVISION),
            ("shapes", tuple(SHAPES)),
            ("ranges", tuple(RANGES)),
        ):
            if unknown := set(getattr(self, name)) - set(known):
                raise ValueError(f"{name} must be of {known}, not {sorted(unknown)}")
        if self.collect not in COLLECT_PROFILES:
            raise ValueError(f"collect must be of {tuple(COLLECT_PROFILES)}, not {self.collect!r}")
        if self.repeats < 1:
            raise ValueError(f"repeats must be at least 1, not {self.repeats}")


PROFILES = {
    "smoke": Config(
        collect="smoke", policies=("paper",), shapes=("triangle",), repeats=1, epochs=2, max_s=2.0
    ),
    "book": Config(collect="book", policies=("paper", "no_quantile"), repeats=3),
    "paper": Config(collect="paper", policies=POLICIES, supervision=SUPERVISION, repeats=4),
}


def shards(config: Config) -> list[Shard]:
    """Return one shard a shape, range and repeat; it holds all policies, on the same noise."""
    return [
        Shard(f"{path}-{gains}-{repeat}", {"shape": path, "range": gains, "repeat": repeat})
        for path in config.shapes
        for gains in config.ranges
        for repeat in range(config.repeats)
    ]


def upstream(config: Config, shard: Shard) -> list[Need]:
    """Name what a shard needs: the trained predictor."""
    del shard  # the same for all
    return [trained_need(config)]


def run_shard(config: Config, shard: Shard, inputs: Inputs) -> pd.DataFrame:
    """Run every policy once.

    Returns:
        One row a run: `shape`, `range`, `repeat`, `policy`, `supervision` and the numbers of
        `cpl.quadruped.summary`.
    """
    rows = [
        dict(shard.values)
        | {"policy": walk.policy, "supervision": walk.supervision}
        | summary(walk.rows, walk.path, floor_half_width_m=walk.floor_half_width_m)
        for walk in walks(config, shard, trained(inputs))
    ]
    return pd.DataFrame(rows)


@dataclass(frozen=True, kw_only=True)
class Walk:
    """One run and how it came about.

    Attributes:
        policy: Its policy's name.
        supervision: `without` or `with`.
        path: The path it followed.
        limits: The range of its gain.
        floor_half_width_m: |x| and |y| of the floor that was meant to be used [m].
        seed: Of the world's noise; the same for all policies.
        rows: The log.
    """

    policy: str
    supervision: str
    path: Path
    limits: GainLimits
    floor_half_width_m: float
    seed: int
    rows: list[dict[str, Any]]


def trained_need(config: Config) -> Need:
    """Name the predictor that a configuration walks with."""
    settings = quadruped_predictor.Config(
        collect=config.collect,
        positive_weight=config.positive_weight,
        epochs=config.epochs,
        seed=config.seed,
    )
    return Need(
        experiment="quadruped_predictor", config=settings, shards=("all",), name="predictor"
    )


def walks(config: Config, shard: Shard, net: Predictor) -> Iterator[Walk]:
    """Walk a shard's runs, one a policy and kind of supervision."""
    data = COLLECT_PROFILES[config.collect]
    world = lab(data.light, data.richness, data.exposure_s, data.room_seed)
    path, (kp_min, kp_max) = shape(shard.text("shape")), RANGES[shard.text("range")]
    limits = GainLimits(kp_min=kp_min, kp_max=kp_max, q_safe=config.q_safe)
    tracking = PolicyConfig(alpha=config.alpha, rule=RunningMax(c=0.1))
    seed = run_seed(config.seed, "eval", path.name, shard.number("repeat"))
    for supervision in config.supervision:
        supervisor = SupervisorConfig() if supervision == "with" else None
        for name in config.policies:
            chosen = policy(name, limits, tracking, net)
            log = run(world, path, chosen, supervisor, seed, RunConfig(max_s=config.max_s))
            yield Walk(
                policy=name,
                supervision=supervision,
                path=path,
                limits=limits,
                floor_half_width_m=world.config.room.floor_half_width_m,
                seed=seed,
                rows=list(log),
            )
