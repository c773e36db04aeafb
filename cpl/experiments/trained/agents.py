"""Trained agents by name: those of Table I, and those that were trained otherwise."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from cpl.experiments.run.spec import Inputs, Need, Shard
from cpl.experiments.trained import agents_beyond, agents_why, listeners
from cpl.experiments.trained.forecasters import forecaster
from cpl.experiments.trained.listening import AGENTS, decoded, hearing_of
from cpl.experiments.trained.needs import needs
from cpl.experiments.trained.pairs import with_pair
from cpl.experiments.trained.recipes import RECIPES, Training
from cpl.experiments.trained.recipes import hearing_of as hearing_of_recipe
from cpl.network import MLP
from cpl.policies.listen import Hearing

__all__ = ["KNOWN", "Agent", "agent", "need_agents", "needs_with_agents"]

KNOWN = (*AGENTS, *RECIPES)
"""The names."""


@dataclass(frozen=True, kw_only=True)
class Agent:
    """A trained agent: what it hears, and its values of what it then sees."""

    hearing: Hearing
    network: MLP


def need_agents(models: str, names: Iterable[str], pair: int) -> list[Need]:
    """Ask for some agents of a pair.

    Args:
        models: Profile of the experiments that trained them.
        names: Of `KNOWN`.
        pair: Which pair.

    Returns:
        One need an experiment that trained some; the pair's policies and forecasters have to be
        asked for beside them.

    Raises:
        ValueError: If a name is unknown.

    Example:
        >>> [need.experiment for need in need_agents("paper", ["rl", "gate"], 0)]
        ['listeners', 'agents_beyond']
    """
    asked: dict[str, list[str]] = {}
    for name in names:
        asked.setdefault(_trainer(name), []).append(f"{name}-{pair}")
    return [
        Need(experiment=trainer, config=_trained(trainer, models, pair), shards=tuple(shards))
        for trainer, shards in asked.items()
    ]


def needs_with_agents(config: Any, shard: Shard) -> list[Need]:  # noqa: ANN401 - with `agents`
    """Ask for the policies, the forecasters and the agents of a shard's pair."""
    pair = shard.number("pair")
    return [*needs(config.models, pair), *need_agents(config.models, config.agents, pair)]


def agent(inputs: Inputs, models: str, name: str, pair: int) -> Agent:
    """Return a trained agent.

    Args:
        inputs: What `run_shard` was given: the pair's policies, forecasters and agents.
        models: Profile of the experiments that trained them.
        name: One of `KNOWN`.
        pair: Which pair.

    Raises:
        ValueError: If it is unknown, or was not asked for.
        cpl.store.DamagedModelError: If its model is damaged.
    """
    trainer = _trainer(name)
    trained = _trained(trainer, models, pair)
    if isinstance(trained, Training):
        hearing = hearing_of_recipe(trained, name, pair, inputs)
    else:
        forecast = forecaster(inputs, "conformal", pair, calibrated=False)
        hearing = hearing_of(name, forecast, trained.tracking)
    return Agent(hearing=hearing, network=decoded(inputs, trainer, f"{name}-{pair}"))


def _trainer(name: str) -> str:
    if name in AGENTS:
        return "listeners"
    for trainer, module in (("agents_why", agents_why), ("agents_beyond", agents_beyond)):
        if name in module.PROFILES["paper"].recipes:
            return trainer
    raise ValueError(f"name must be one of {KNOWN}, got {name!r}")


def _trained(trainer: str, models: str, pair: int) -> Training | listeners.Config:
    """Return the configuration of the trainings, of this pair too."""
    if trainer == "listeners":
        return with_pair(listeners.PROFILES[models], pair)
    module = agents_why if trainer == "agents_why" else agents_beyond
    return with_pair(module.PROFILES[models], pair)
