"""Is the compiled learner Stable-Baselines3's DQN?

Both train the base policies from the same seeds and drive the same episodes afterwards, in the
range they were trained in and in a wider one, where trainings differ most. The two can differ only
as two seeds of one learner do. (pi_safe is the harder case: where nothing threatens, its actions
are worth the same, and what it does there is decided by the last updates.)

The `paper` profile compares pi_speed only, after half of the paper's steps, because the reference
takes six minutes a training for all of them. Every part of a learner (replay, target, exploration,
Adam) has been at work long before, and pi_speed in the wider range is where seeds differ most.
"""

from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
import pandas as pd

from cpl.experiments.run.spec import Experiment, Shard
from cpl.highway import PAPER, run_episodes
from cpl.policies.dqn import DQNConfig, train
from cpl.policies.dqn.training import LearnerName
from cpl.policies.greedy import Greedy
from cpl.rng import stream
from cpl.settings.ranges import Choice, Count, Settings

__all__ = ["EXPERIMENT", "PROFILES", "Config", "compare", "means"]


LEARNERS: tuple[LearnerName, ...] = ("compiled", "sb3")
METRICS = ("duration_s", "episode_mean_speed_mps", "crashed", "episode_return")

_SEEDS = 10_000_000  # training seeds lie below; validation seeds from here on


@dataclass(frozen=True, kw_only=True)
class Config(Settings):
    """The trainings and what they are judged by.

    Attributes:
        compiled_seeds: Trainings of each kind by the compiled learner.
        sb3_seeds: Trainings of each kind by Stable-Baselines3, from the first of the same seeds.
        kinds: "safe" and "speed", or one of them.
        steps: Decisions a training.
        episodes: Episodes each trained policy drives in each range.
        top_speeds_mps: Upper ends of those ranges [m/s]; training has 30 m/s.
        low_speed_mps: Lower end of all of them [m/s].
        vehicles_count: Other cars.
    """

    compiled_seeds: Count
    sb3_seeds: Count
    kinds: Annotated[tuple[str, ...], Choice(("safe", "speed"))] = ("safe", "speed")
    steps: int = 200_000
    episodes: Count = 500
    top_speeds_mps: tuple[float, ...] = (30.0, 40.0)
    low_speed_mps: float = 20.0
    vehicles_count: int = 50

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.kinds:
            raise ValueError("kinds must name at least one, got none")
        DQNConfig(steps=self.steps)


PROFILES = {
    "smoke": Config(
        compiled_seeds=2,
        sb3_seeds=2,
        kinds=("speed",),
        steps=300,
        episodes=4,
        vehicles_count=8,
    ),
    "book": Config(compiled_seeds=3, sb3_seeds=3, kinds=("speed",), steps=2_000, episodes=50),
    "paper": Config(compiled_seeds=8, sb3_seeds=4, kinds=("speed",), steps=100_000, episodes=250),
}


def _shards(config: Config) -> list[Shard]:
    """One training a shard."""
    counts = (config.compiled_seeds, config.sb3_seeds)
    return [
        Shard(f"{kind}-{learner}-{number}", {"kind": kind, "learner": learner, "training": number})
        for kind in config.kinds
        for learner, count in zip(LEARNERS, counts, strict=True)
        for number in range(count)
    ]


def run_shard(config: Config, shard: Shard) -> pd.DataFrame:
    """Train once and drive.

    Returns:
        One row an episode: `kind`, `learner`, `training`, `top_speed_mps`, and the columns of
        `cpl.highway.run_episodes`.
    """
    learner: LearnerName = "sb3" if shard.text("learner") == "sb3" else "compiled"
    kind, number = shard.text("kind"), shard.number("training")
    seed = int(stream(number, "learner_check").integers(_SEEDS))
    paid = PAPER.high_speed_reward if kind == "speed" else 0.0
    training = replace(PAPER, vehicles_count=config.vehicles_count, high_speed_reward=paid)
    settings = DQNConfig(steps=config.steps)
    driver = Greedy(train(settings, training, seed=seed, learner=learner).network)
    tables = []
    for top in config.top_speeds_mps:
        speeds = np.linspace(config.low_speed_mps, top, 3)
        road = replace(training, target_speeds=tuple(speeds.tolist()))
        table = run_episodes(road, driver, _SEEDS + np.arange(config.episodes))
        about = {"kind": kind, "learner": learner, "training": number, "top_speed_mps": top}
        for place, (name, value) in enumerate(about.items()):
            table.insert(place, name, value)
        tables.append(table)
    return pd.concat(tables, ignore_index=True)


EXPERIMENT = Experiment(
    run=run_shard,
    profiles=PROFILES,
    shards=_shards,
    label="simulated",
    extent=("compiled_seeds", "sb3_seeds", "kinds"),
    rtol=1e-6,
)


def means(table: pd.DataFrame) -> pd.DataFrame:
    """Average over the episodes of each training.

    Args:
        table: What this experiment returns.

    Returns:
        One row a training and range, with the means of `METRICS`.
    """
    keys = ["kind", "learner", "training", "top_speed_mps"]
    return table.groupby(keys, as_index=False).agg(dict.fromkeys(METRICS, "mean"))


def compare(table: pd.DataFrame) -> pd.DataFrame:
    """Compare the learners, a training's mean one observation each.

    The p-value is that of the exact permutation test: in how many ways of calling the same
    trainings compiled or reference do the two means differ by at least as much.

    Args:
        table: What this experiment returns.

    Returns:
        One row a kind, range and metric: `kind`, `top_speed_mps`, `metric`, the learners' means
        `compiled` and `sb3`, `spread` (standard deviation between trainings, pooled) and `p_value`.
    """
    rows: list[dict[str, object]] = []
    for _, part in means(table).groupby(["kind", "top_speed_mps"]):
        for metric in METRICS:
            a, b = (
                part.loc[part["learner"] == name, metric].to_numpy(dtype=np.float64)
                for name in LEARNERS
            )
            residuals = np.concatenate([a - a.mean(), b - b.mean()])
            rows.append(
                {
                    "kind": part["kind"].iloc[0],
                    "top_speed_mps": part["top_speed_mps"].iloc[0],
                    "metric": metric,
                    "compiled": a.mean(),
                    "sb3": b.mean(),
                    "spread": np.sqrt((residuals**2).sum() / max(len(residuals) - 2, 1)),
                    "p_value": _permutation(a, b),
                }
            )
    return pd.DataFrame(rows)


def _permutation(a: np.ndarray, b: np.ndarray) -> float:
    from scipy.stats import permutation_test

    def difference(x: np.ndarray, y: np.ndarray, axis: int) -> np.ndarray:
        return np.abs(x.mean(axis=axis) - y.mean(axis=axis))

    found = permutation_test(
        (a, b), difference, alternative="greater", n_resamples=100_000, vectorized=True
    )
    return float(found.pvalue)
