"""How well does the paper's network foresee a SLAM error two steps ahead, on paths it has not seen?

Trained on the collected zig-zags: once on all of them, which is the network that the evaluations
walk with, and once with each fifth of the paths held out. Paper: Section V-B; it reports no such
number. Persistence, that an error now means an error in two steps, is what it has to beat.
"""

from dataclasses import dataclass

import numpy as np
import pandas as pd

from cpl.experiments.quadruped import quadruped_collect
from cpl.experiments.quadruped.lab import training_runs
from cpl.experiments.run.need import Inputs, Need
from cpl.experiments.run.shard import Shard
from cpl.quadruped import Predictor, TrainingConfig, auc, train
from cpl.quadruped.predictor import decode_predictor, encode_predictor

__all__ = [
    "EXTENT",
    "LABEL",
    "PROFILES",
    "Config",
    "fitted",
    "run_shard",
    "shards",
    "trained",
    "upstream",
]

LABEL = "simulated-kinematic"
RTOL = 1e-6
EXTENT = ("folds",)


@dataclass(frozen=True, kw_only=True)
class Config:
    """What is trained on what.

    Attributes:
        collect: Profile of the collection.
        folds: Into how many parts the paths are cut for the held-out numbers; 0 for none.
        positive_weight: Weight of a SLAM error in the loss [-].
        epochs: Passes over the data.
        seed: Draws the first weights and the order of the rows.
    """

    collect: str
    folds: int = 5
    positive_weight: float = 5.0
    epochs: int = 40
    seed: int = 0

    def __post_init__(self) -> None:
        if self.collect not in quadruped_collect.PROFILES:
            known = tuple(quadruped_collect.PROFILES)
            raise ValueError(f"collect must be of {known}, not {self.collect!r}")
        if self.folds < 0 or self.folds == 1:
            raise ValueError(f"folds must be 0 or at least 2, not {self.folds}")


PROFILES = {
    "smoke": Config(collect="smoke", folds=0, epochs=2),
    "book": Config(collect="book"),
    "paper": Config(collect="paper"),
}


def shards(config: Config) -> list[Shard]:
    """Return one shard for the network that is used, and one a fold."""
    folds = [Shard(f"fold-{k}", {"fold": k}) for k in range(config.folds)]
    return [Shard("all", {"fold": -1}), *folds]


def upstream(config: Config, shard: Shard) -> list[Need]:
    """Name what a shard needs: all collected trajectories."""
    del shard
    settings = quadruped_collect.PROFILES[config.collect]
    names = tuple(each.name for each in quadruped_collect.shards(settings))
    return [Need(experiment="quadruped_collect", config=settings, shards=names, name="log")]


def run_shard(config: Config, shard: Shard, inputs: Inputs) -> pd.DataFrame:
    """Train once.

    Returns:
        One row: `fold` (-1: nothing held out, so judged on its own training data),
        `training_rows`, `rows` and `errors` it is judged on, `auc`, `brier`, `auc_persistence`,
        `brier_persistence`, `brier_constant` (the training share of errors as the forecast), and
        `model`, the network of fold -1.
    """
    data = quadruped_collect.PROFILES[config.collect]
    return fitted(config, shard, inputs, seed=data.seed, keypoints=data.keypoints)


def fitted(
    config: Config, shard: Shard, inputs: Inputs, *, seed: int, keypoints: int
) -> pd.DataFrame:
    """Train once on a collection whose paths were drawn by `seed`; see `run_shard`."""
    rows = pd.concat(inputs["log"].values(), ignore_index=True)
    runs, fold = training_runs(rows, seed, keypoints), shard.number("fold")
    chosen = [run for k, run in enumerate(runs) if fold < 0 or k % config.folds != fold]
    judged = [run for k, run in enumerate(runs) if fold < 0 or k % config.folds == fold]
    training = TrainingConfig(positive_weight=config.positive_weight, epochs=config.epochs)
    net = train(chosen, training, config.seed)
    x, y = (np.concatenate(part) for part in zip(*judged, strict=True))
    now, share = x[:, -1], float(np.concatenate([label for _, label in chosen]).mean())
    row = {
        "fold": fold,
        "training_rows": sum(len(label) for _, label in chosen),
        "rows": len(y),
        "errors": int(y.sum()),
        "auc": auc(net(x), y),
        "brier": float(np.mean((net(x) - y) ** 2)),
        "auc_persistence": auc(now, y),
        "brier_persistence": float(np.mean((now - y) ** 2)),
        "brier_constant": float(np.mean((share - y) ** 2)),
        "model": encode_predictor(net, {"seed": config.seed}) if fold < 0 else b"",
    }
    return pd.DataFrame([row])


def trained(inputs: Inputs) -> Predictor:
    """Return the network among the inputs of a shard that needs it."""
    return decode_predictor(inputs["predictor"]["all"]["model"].iloc[0])[0]
