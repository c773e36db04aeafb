"""Agents that are trained otherwise than the paper's: what differs, their training, their use."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
import pandas as pd

from cpl.conformal import RunningMax
from cpl.experiments.run.spec import Experiment, Inputs, Shard, grid
from cpl.experiments.trained import base_policies
from cpl.experiments.trained.forecasters import forecaster
from cpl.experiments.trained.needs import needs_of_pair
from cpl.experiments.trained.pairs import Models
from cpl.experiments.trained.policies import base_policy
from cpl.highway import Config as Road
from cpl.network import encode_networks
from cpl.policies.dqn import DQNConfig, train
from cpl.policies.evaluate import Tracking
from cpl.policies.listen import Hearing, Listening, View
from cpl.rng import stream
from cpl.settings.ranges import Choice, Count, Settings
from cpl.store import plain

__all__ = [
    "RECIPES",
    "Recipe",
    "Training",
    "hearing_of",
    "retraining",
    "roads",
    "teach",
]

_PAPER = View()
_SEEDS = 10_000_000  # training seeds lie below; validation and test seeds above


@dataclass(frozen=True, kw_only=True)
class Recipe:
    """What differs from pi_RL(x, l_hat, q) of the paper; the defaults differ in nothing.

    Attributes:
        view: What the agent sees.
        tops_mps: Upper ends of the speed ranges that episodes are drawn from [m/s].
        densities: Densities of traffic that they are drawn from [-].
        blur: Standard deviations of noise on the forecast that they are drawn from [-].
        collision_reward: Paid for a crash [-].
        gamma: Discount a decision [-].
        gate: Whether it chooses between pi_safe and pi_speed, else between actions.
    """

    view: View = _PAPER
    tops_mps: tuple[float, ...] = (30.0,)
    densities: tuple[float, ...] = (1.0,)
    blur: tuple[float, ...] = (0.0,)
    collision_reward: float = -1.0
    gamma: float = 0.8
    gate: bool = False


_WIDE = Recipe(tops_mps=(30.0, 40.0, 50.0), densities=(0.8, 1.0, 1.2))
_GATE = replace(_WIDE, gate=True, collision_reward=-5.0)
_DEAF = View(quantiles=0)

RECIPES = {
    # Why: one thing is changed, the road stays that of the paper's training.
    "louder": Recipe(view=View(q_scale=5.0)),
    "farther": Recipe(gamma=0.95),
    "longer": Recipe(view=View(observations=5, quantiles=5)),
    "blurred": Recipe(blur=(0.0, 0.1, 0.2, 0.4)),
    # Beyond: the road varies, and q with it. "nq" sees everything but q.
    "wide": _WIDE,
    "wide_nq": replace(_WIDE, view=_DEAF),
    "gate": _GATE,
    "gate_nq": replace(_GATE, view=_DEAF),
}
"""By name."""


@dataclass(frozen=True, kw_only=True)
class Training(Settings):
    """Which agents are trained, and the tracker inside their training.

    Attributes:
        pairs: Training seeds: each has its own pair of base policies and its own forecaster.
        recipes: Which of `RECIPES`.
        models: Profile of the experiments that trained policies and forecasters.
        steps: Decisions a training; fewer than the paper's: the return of `base_policies` is
            level from here on.
        alpha: Miscoverage aimed at [-].
        share: The tracker's step as a share of the greatest score so far [-].
        delay: Decisions after which a score is known [steps].
    """

    pairs: Count
    recipes: Annotated[tuple[str, ...], Choice(tuple(RECIPES))]
    models: Models = "paper"
    steps: int = 80_000
    alpha: float = 0.1
    share: float = 0.1
    delay: int = 3

    def __post_init__(self) -> None:
        super().__post_init__()
        DQNConfig(steps=self.steps)
        _tracking(self)


def roads(recipe: Recipe, models: str) -> list[Road]:
    """Return the roads that episodes of a training are drawn from."""
    policies = base_policies.PROFILES[models]
    found = []
    for top in recipe.tops_mps:
        changes = {"top_speed_mps": top, "collision_reward": recipe.collision_reward}
        road = base_policies.road(replace(policies, **changes), "speed")
        found += [replace(road, vehicles_density=density) for density in recipe.densities]
    return found


def hearing_of(config: Training, name: str, pair: int, inputs: Inputs) -> Hearing:
    """Return what an agent hears, in training as on the road."""
    recipe = RECIPES[name]
    kinds = ("safe", "speed") if recipe.gate else ()
    return Hearing(
        forecast=forecaster(inputs, "conformal", pair, calibrated=False),
        tracking=_tracking(config),
        view=recipe.view,
        policies=tuple(base_policy(inputs, kind, pair) for kind in kinds),
    )


def teach(config: Training, name: str, pair: int, inputs: Inputs) -> pd.DataFrame:
    """Train one agent.

    Args:
        config: The trainings.
        name: Of the recipe.
        pair: The training seed.
        inputs: The pair's policies and forecasters.

    Returns:
        Its learning curve after the columns `recipe`, `pair` and `seed`, with `q_low`, `q_middle`
        and `q_high`: the 5th, 50th and 95th percentile of the tracked quantile in the row's
        decisions; the last row's `model` holds the network "q" with its settings.
    """
    recipe, policies = RECIPES[name], base_policies.PROFILES[config.models]
    # Twins share their seed, and with it the first roads.
    seed = int(stream(pair, "recipes", name.removesuffix("_nq")).integers(_SEEDS))
    every = max(1, min(1000, config.steps // 10))
    settings = DQNConfig(
        steps=config.steps, hidden=policies.hidden, gamma=recipe.gamma, curve_every=every
    )
    drawn = roads(recipe, config.models)
    hearing = hearing_of(config, name, pair, inputs)
    lesson = Listening(drawn[0], hearing, blur=recipe.blur, seed=seed)
    trained = train(settings, drawn, seed=seed, wrapper=lesson)
    table = trained.curve
    for place, (key, value) in enumerate({"recipe": name, "pair": pair, "seed": seed}.items()):
        table.insert(place, key, value)
    heard = lesson.heard["q"].to_numpy()[: len(table) * every].reshape(len(table), every)
    for key, share in (("q_low", 0.05), ("q_middle", 0.5), ("q_high", 0.95)):
        table[key] = np.quantile(heard, share, axis=1)
    table["model"] = b""
    told = {
        "recipe": name,
        "pair": pair,
        "seed": seed,
        "steps": config.steps,
        "what": plain(recipe),
    }
    table.loc[len(table) - 1, "model"] = encode_networks({"q": trained.network}, told)
    return table


def retraining(profiles: Mapping[str, Training]) -> Experiment:
    """Return the experiment of some trainings, one a shard."""

    def run_shard(config: Training, shard: Shard, inputs: Inputs) -> pd.DataFrame:
        return teach(config, shard.text("recipe"), shard.number("pair"), inputs)

    return Experiment(
        run=run_shard,
        profiles=profiles,
        shards=grid("{recipe}-{pair}", pair="pairs", recipe="recipes"),
        needs=needs_of_pair,
        label="simulated",
        extent=("pairs", "recipes"),
        rtol=1e-6,  # of the learning curve's means; models agree bit for bit
    )


def _tracking(config: Training) -> Tracking:
    return Tracking(rule=RunningMax(c=config.share), alpha=config.alpha, delay=config.delay)
