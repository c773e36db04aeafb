"""How well does the paper's network foresee a SLAM error two steps ahead, on paths it has not seen?

Trained on the collected zig-zags: once on all of them, which is the network that the evaluations
walk with, and once with each fifth of the paths held out. Paper: Section V-B; it reports no such
number. Persistence, that an error now means an error in two steps, is what it has to beat.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from cpl.experiments.quadruped import quadruped_collect
from cpl.experiments.quadruped.lab import training_runs
from cpl.experiments.run.spec import Experiment, Inputs, Need, Shard
from cpl.experiments.trained.pairs import Models
from cpl.quadruped import Predictor, TrainingConfig, auc, train
from cpl.quadruped.predictor import decode_predictor, encode_predictor
from cpl.quadruped.training import Run
from cpl.settings.ranges import Natural, Settings

__all__ = ["EXPERIMENT", "PROFILES", "Config", "need_predictor", "predicting", "trained"]


@dataclass(frozen=True, kw_only=True)
class Config(Settings):
    """What is trained on what.

    Attributes:
        collect: Profile of the collection.
        folds: Into how many parts the paths are cut for the held-out numbers; 0 for none.
        positive_weight: Weight of a SLAM error in the loss [-].
        epochs: Passes over the data.
        seed: Draws the first weights and the order of the rows.
    """

    collect: Models
    folds: Natural = 5
    positive_weight: float = 5.0
    epochs: int = 40
    seed: int = 0

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.folds == 1:
            raise ValueError(f"folds must be 0 or at least 2, got {self.folds!r}")


PROFILES = {
    "smoke": Config(collect="smoke", folds=0, epochs=2),
    "book": Config(collect="book"),
    "paper": Config(collect="paper"),
}


def _shards(config: Config) -> list[Shard]:
    """Return one shard for the network that is used, and one a fold."""
    folds = [Shard(f"fold-{k}", {"fold": k}) for k in range(config.folds)]
    return [Shard("all", {"fold": -1}), *folds]


def predicting(
    collection: str, collected: Experiment, profiles: Mapping[str, Config]
) -> Experiment:
    """Return the experiment that trains on a collection, by its name."""

    def needs(config: Config, shard: Shard) -> list[Need]:
        """Ask for all collected trajectories."""
        del shard
        settings = collected.profiles[config.collect]
        names = tuple(each.name for each in collected.shards(settings))
        return [Need(experiment=collection, config=settings, shards=names, name="log")]

    def run_shard(config: Config, shard: Shard, inputs: Inputs) -> pd.DataFrame:
        """Train once.

        Returns:
            One row: `fold` (-1: nothing held out, so judged on its own training data),
            `training_rows`, `rows` and `errors` it is judged on, `auc`, `brier`,
            `auc_persistence`, `brier_persistence`, `brier_constant` (the training share of errors
            as the forecast), and `model`, the network of fold -1.
        """
        data = collected.profiles[config.collect]
        rows = pd.concat(inputs["log"].values(), ignore_index=True)
        runs = training_runs(rows, data.seed, data.keypoints)
        return _fitted(config, shard.number("fold"), runs)

    return Experiment(
        run=run_shard,
        profiles=profiles,
        shards=_shards,
        needs=needs,
        label=collected.label,
        extent=("folds",),
        rtol=1e-6,
    )


EXPERIMENT = predicting("quadruped_collect", quadruped_collect.EXPERIMENT, PROFILES)


def need_predictor(config: Any, experiment: str = "quadruped_predictor") -> list[Need]:  # noqa: ANN401
    """Ask for the network that walks are made with.

    Args:
        config: Of the walks: how the network is trained.
        experiment: What trains it.
    """
    settings = Config(
        collect=config.collect,
        positive_weight=config.positive_weight,
        epochs=config.epochs,
        seed=config.seed,
    )
    return [Need(experiment=experiment, config=settings, shards=("all",), name="predictor")]


def trained(inputs: Inputs) -> Predictor:
    """Return the network among the inputs of a shard that needs it."""
    return decode_predictor(inputs["predictor"]["all"]["model"].iloc[0])[0]


def _fitted(config: Config, fold: int, runs: list[Run]) -> pd.DataFrame:
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
