"""What does one stream of episodes look like, under a constant margin and under the quantile?"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from cpl.experiments.gate.streams import WORLDS, Roads, turns
from cpl.experiments.gate.study import quantile, values
from cpl.experiments.run.spec import Experiment, Inputs, Need, Shard, whole
from cpl.experiments.trained.pairs import Models
from cpl.experiments.trained.policies import need_policies
from cpl.highway import PAPER
from cpl.policies.gate import Constant, Gate, Margin, Stacked
from cpl.settings.ranges import Choice, Count, Natural, Settings

__all__ = ["BASES", "EXPERIMENT", "PROFILES", "Config"]


BASES = ("pi_speed", "full throttle")
"""Who is behind the gate: the trained policy, or one that always wants to go faster."""

_THROTTLE = np.array([0.5, 0.2, 0.4, 1.0, 0.1])  # how much it likes each action
_STEPS = 40  # decisions of an episode
_SEED = 40_000_000  # environment seeds that nothing else uses


@dataclass(frozen=True, kw_only=True)
class Config(Settings):
    """The stream.

    Attributes:
        models: Profile of the experiment that trained the policy.
        pair: Which policy pair.
        base: Who is behind the gate, one of `BASES`.
        world: The world after the calm beginning.
        calm: Episodes in distribution before.
        episodes: Episodes in the world.
        margin: The constant [m].
        alpha: Miscoverage aimed at [-].
        eta: Step of the quantile, in scales.
        memory: Decisions that the scale remembers.
        seed: Of the stream.
    """

    models: Models = "paper"
    pair: Natural = 0
    base: Annotated[str, Choice(BASES)] = "pi_speed"
    world: Annotated[str, Choice(tuple(WORLDS))] = "noise"
    calm: Natural = 6
    episodes: Count = 8
    margin: float = 3.0
    alpha: float = 0.05
    eta: float = 0.3
    memory: float = 20.0
    seed: int = 0


PROFILES = {
    "smoke": Config(models="smoke", base="full throttle", calm=1, episodes=1),
    "book": Config(),
    "paper": Config(calm=8, episodes=16),
}


def _needs(config: Config, shard: Shard) -> list[Need]:
    """The trained policies, where one of them drives."""
    if config.base != "pi_speed":
        return []
    return [need_policies(config.models, config.pair)]


def run_shard(config: Config, shard: Shard, inputs: Inputs | None = None) -> pd.DataFrame:
    """Drive the stream twice, episode by episode with the same seeds.

    Returns:
        One row a decision and car: `method` ("constant" or "quantile"), `episode`, `world`, `step`,
        `car` (0 is the ego car, then the cars that are seen), `x_m` (relative to the ego car),
        `y_m`, `speed_mps`, `margin_m`, `error_m` (of the forecast of three decisions ago; NaN where
        none is known), `tolerated_m` (of the chosen action), `changed`, `crashed`.
    """
    names, margins = (
        ("constant", "quantile"),
        [
            Constant(config.margin, 1),
            quantile(1, alpha=config.alpha, eta=config.eta, memory=config.memory),
        ],
    )
    parts: list[Margin] = list(margins)
    gate = Gate(PAPER, 2, Stacked(parts, [1, 1]))
    worlds = ["in"] * config.calm + [config.world] * config.episodes
    rows: list[pd.DataFrame] = []
    for episode, world in enumerate(worlds):
        seed = _SEED + 1000 * config.seed + episode
        driven = _episode(config, gate, world, seed, inputs)
        rows += [table.assign(episode=episode, world=world) for table in driven]
    found = pd.concat(rows, ignore_index=True)
    found["method"] = np.array(names)[found["method"].to_numpy()]
    return found


EXPERIMENT = Experiment(
    run=run_shard,
    profiles=PROFILES,
    shards=whole,
    needs=_needs,
    label="simulated",
    rtol=1e-4,
)


def _episode(config: Config, gate: Gate, world: str, seed: int, inputs: Inputs | None):  # noqa: ANN202
    roads = Roads(np.array([world, world]), np.array([seed, seed]))
    gate.begin(levels=roads.levels)

    def act(obs: NDArray[np.float32], active: NDArray[np.bool_]) -> NDArray[np.integer]:
        return gate(obs, _liked(config, inputs, obs), active)

    for step, turn in enumerate(turns(roads, act, _STEPS)):
        yield _rows(gate, turn.obs_tm1, step, turn.active, turn.out.info.crashed)


def _liked(config: Config, inputs: Inputs | None, obs: NDArray[np.float32]) -> NDArray[np.floating]:
    if config.base == "pi_speed" and inputs is not None:
        return values(inputs, "speed", config.pair)(obs)
    return np.tile(_THROTTLE, (len(obs), 1))


def _rows(
    gate: Gate,
    obs: NDArray[np.float32],
    step: int,
    active: NDArray[np.bool_],
    crashed: NDArray[np.bool_],
) -> pd.DataFrame:
    sight = gate.sight
    if sight is None:
        raise ValueError("gate must have decided before its rows are asked for")
    scale = np.array([1.0, 200.0, 16.0, 80.0, 80.0])
    rows = []
    for k in np.flatnonzero(active).tolist():
        metres = obs[k] * scale
        known = bool(sight.scored[k])
        told = {
            "method": k,
            "step": step,
            "margin_m": sight.margin[k],
            "error_m": sight.outcome.errors[k, -1] if known else np.nan,
            "tolerated_m": min(sight.tolerated[k, sight.chosen[k]], 1e3),
            "changed": bool(sight.changed[k]),
            "crashed": bool(crashed[k]),
        }
        for car in np.flatnonzero(metres[:, 0] > 0.5).tolist():
            y = metres[0, 2] + (metres[car, 2] if car else 0.0)
            v = metres[0, 3] + (metres[car, 3] if car else 0.0)
            x = metres[car, 1] if car else 0.0
            rows.append({**told, "car": car, "x_m": x, "y_m": y, "speed_mps": v})
    return pd.DataFrame(rows)
