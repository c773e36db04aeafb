"""Does the coverage of a frozen margin tell where adapting can pay?

One function, `cpl.stats.frozen.frozen_coverage`, on two kinds of logs: errors of the road's
look-ahead, where a calm beginning is followed by one of the worlds, and scores of the quadruped's
predictor (the shipped logs), where walks with usual gains are followed by walks out of them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from cpl.experiments.gate.streams import WORLDS, Roads, turns
from cpl.experiments.gate.study import values
from cpl.experiments.quadruped.quadruped_logs import digest
from cpl.experiments.run.spec import Experiment, Inputs, Need, Shard
from cpl.experiments.trained.pairs import Models
from cpl.experiments.trained.policies import need_policies
from cpl.highway import PAPER
from cpl.logs import read_runs
from cpl.policies.gate import Constant, Gate
from cpl.settings.ranges import Count, Settings
from cpl.stats.frozen import frozen_coverage
from cpl.store import data_path

__all__ = ["EXPERIMENT", "PROFILES", "Config"]


_SEED = 30_000_000  # environment seeds that nothing else uses
_STEPS = 40  # decisions of an episode
_FOLDER = "quadruped"
_POLICIES = ("paper", "no_quantile")

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True, kw_only=True)
class Config(Settings):
    """The logs, and how they are cut.

    Attributes:
        pairs: Policy pairs of the road, each a training seed.
        models: Profile of the experiment that trained them.
        worlds: Worlds that follow the calm beginning.
        episodes: Episodes of the calm beginning, and as many of the world.
        margin: The gate's constant margin while the log is made [m].
        alpha: Miscoverage that the margin is frozen to [-].
        windows: Windows that follow the road's beginning.
        sha256: First 12 characters of the digest of the quadruped's logs.
        alpha_quadruped: The same for the quadruped, the paper's value [-].
    """

    pairs: Count
    models: Models = "paper"
    worlds: tuple[str, ...] = tuple(WORLDS)
    episodes: Count
    margin: float = 3.0
    alpha: float = 0.05
    windows: int = 2
    sha256: str = "c37b1d3e925c"
    alpha_quadruped: float = 0.2


PROFILES = {
    "smoke": Config(pairs=1, models="smoke", worlds=("in", "noise"), episodes=6),
    "book": Config(pairs=1, episodes=24),
    "paper": Config(pairs=3, episodes=96),
}


def _shards(config: Config) -> list[Shard]:
    """One policy pair a shard, and the quadruped."""
    roads = [Shard(f"road-{pair}", {"pair": pair}) for pair in range(config.pairs)]
    return [*roads, Shard("quadruped", {"pair": -1})]


def _needs(config: Config, shard: Shard) -> list[Need]:
    """The pair's trained policies; none for the quadruped."""
    pair = shard.number("pair")
    return [] if pair < 0 else [need_policies(config.models, pair)]


def run_shard(config: Config, shard: Shard, inputs: Inputs | None = None) -> pd.DataFrame:
    """Freeze a margin in each log and follow it.

    Returns:
        One row a window: `log` ("road", or the quadruped's policy), `part` (the world, or what the
        window holds), `pair`, `window`, `coverage`, `low`, `high`, `nominal`, `margin`, `scores`.
    """
    pair = shard.number("pair")
    if pair < 0 or inputs is None:
        return _quadruped(config)
    return _road(config, pair, inputs)


EXPERIMENT = Experiment(
    run=run_shard,
    profiles=PROFILES,
    shards=_shards,
    needs=_needs,
    label="simulated",
)


def _road(config: Config, pair: int, inputs: Inputs) -> pd.DataFrame:
    speed = values(inputs, "speed", pair)
    calm = _errors(config, speed, "in", _SEED)
    rows = []
    for k, world in enumerate(config.worlds, 1):
        changed = _errors(config, speed, world, _SEED + k * config.episodes)
        found = frozen_coverage(
            np.concatenate([calm[0], changed[0]]),
            np.concatenate([calm[1], changed[1] + config.episodes]),
            alpha=config.alpha,
            calibration=len(np.unique(calm[1])),  # an early crash leaves no error to score
            windows=config.windows,
        )
        rows += [
            {
                "log": "road",
                "part": world,
                "pair": pair,
                "window": w,
                "coverage": float(found.coverage[w]),
                "low": float(found.low[w]),
                "high": float(found.high[w]),
                "nominal": found.nominal,
                "margin": found.margin,
                "scores": len(changed[0]),
            }
            for w in range(config.windows)
        ]
    return pd.DataFrame(rows)


def _errors(config: Config, speed, world: str, seed: int) -> tuple[Floats, Ints]:  # noqa: ANN001
    """Drive episodes with a constant margin; return the look-ahead's errors and their episodes."""
    n = config.episodes
    roads = Roads(np.full(n, world), seed + np.arange(n))
    gate = Gate(PAPER, n, Constant(config.margin, n))
    gate.begin(levels=roads.levels)
    errors, known = np.zeros((n, _STEPS)), np.zeros((n, _STEPS), np.bool_)

    def act(obs: NDArray[np.float32], active: NDArray[np.bool_]) -> Ints:
        return gate(obs, speed(obs), active)

    for t, _ in enumerate(turns(roads, act, _STEPS)):
        if gate.sight is not None:
            errors[:, t], known[:, t] = gate.sight.outcome.errors[:, -1], gate.sight.scored
    return errors[known], np.repeat(np.arange(n), known.sum(axis=1))


def _quadruped(config: Config) -> pd.DataFrame:
    if not digest(_FOLDER).startswith(config.sha256):
        raise ValueError(f"sha256 must be that of the logs, {digest(_FOLDER)}, got {config.sha256}")
    runs = read_runs(data_path("logs", _FOLDER))
    by = {name: rows["score"].dropna().to_numpy() for name, rows in runs.table.groupby("run")}
    rows = []
    for policy in _POLICIES:
        order = runs.summary[runs.summary["config.policy"] == policy].sort_values(  # pyright: ignore
            ["config.range", "config.repeat", "config.shape"]  # "in" before "out"
        )
        inside = int((order["config.range"] == "in").sum())  # pyright: ignore
        scores = [by[name] for name in order["run"]]
        found = frozen_coverage(
            np.concatenate(scores),
            np.repeat(np.arange(len(scores)), [len(part) for part in scores]),
            alpha=config.alpha_quadruped,
            calibration=inside // 2,
            windows=3,
        )
        rows += [
            {
                "log": f"quadruped, {policy}",
                "part": "usual gains" if first + inside // 2 <= inside else "larger gains",
                "pair": -1,
                "window": w,
                "coverage": float(found.coverage[w]),
                "low": float(found.low[w]),
                "high": float(found.high[w]),
                "nominal": found.nominal,
                "margin": found.margin,
                "scores": sum(len(part) for part in scores),
            }
            for w, first in enumerate(found.first.tolist())
        ]
    return pd.DataFrame(rows)
