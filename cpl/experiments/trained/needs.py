"""What experiments ask for that drive with a pair's policies and forecasters."""

from typing import Any

from cpl.experiments.run.spec import Need, Shard
from cpl.experiments.trained.forecasters import need_forecasters
from cpl.experiments.trained.policies import need_policies

__all__ = ["needs", "needs_of_pair"]


def needs(models: str, pair: int) -> list[Need]:
    """Ask for the base policies and the forecasters of a pair, be it one that nobody trained yet.

    Args:
        models: Profile of the experiments that trained them.
        pair: Which pair.

    Examples:
        >>> [(need.experiment, need.shards) for need in needs("paper", 11)]
        [('base_policies', ('safe-11', 'speed-11')), ('forecasts', ('pair-11',))]
    """
    return [need_policies(models, pair), need_forecasters(models, pair)]


def needs_of_pair(config: Any, shard: Shard) -> list[Need]:  # noqa: ANN401 - settings with `models`
    """Ask for the policies and the forecasters of a shard's pair."""
    return needs(config.models, shard.number("pair"))
