"""The trained base policies, for experiments that stand on them."""

from typing import Any

from cpl.experiments.run.spec import Inputs, Need, Shard
from cpl.experiments.trained.base_policies import KINDS, PROFILES
from cpl.experiments.trained.pairs import with_pair
from cpl.network import decode_networks
from cpl.policies.greedy import Greedy

__all__ = ["base_policy", "need_policies", "need_policies_of_pair"]


def need_policies(models: str, pair: int) -> Need:
    """Ask for both policies of a pair.

    Args:
        models: Profile that trained them.
        pair: Which pair.

    Examples:
        >>> need_policies("paper", 2).shards
        ('safe-2', 'speed-2')
    """
    names = tuple(f"{kind}-{pair}" for kind in KINDS)
    return Need(experiment="base_policies", config=with_pair(PROFILES[models], pair), shards=names)


def need_policies_of_pair(config: Any, shard: Shard) -> list[Need]:  # noqa: ANN401 - with `models`
    """Ask for the policies of a shard's pair."""
    return [need_policies(config.models, shard.number("pair"))]


def base_policy(inputs: Inputs, kind: str, pair: int) -> Greedy:
    """Return a trained policy.

    Args:
        inputs: What `run_shard` was given.
        kind: "safe" or "speed".
        pair: Which pair.

    Raises:
        ValueError: If it was not asked for.
        cpl.store.DamagedModelError: If its model is damaged.
    """
    tables, name = inputs["base_policies"], f"{kind}-{pair}"
    if name not in tables:
        raise ValueError(f"kind and pair must be among {sorted(tables)}, got {name!r}")
    return Greedy(decode_networks(tables[name]["model"].iloc[-1]).network("q"))
