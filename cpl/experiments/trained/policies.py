"""The trained base policies, for experiments that stand on them."""

from collections.abc import Iterable

from cpl.experiments.run.need import Inputs, Need
from cpl.experiments.trained.base_policies import KINDS, Config
from cpl.network import decode_networks
from cpl.policies.greedy import Greedy

__all__ = ["base_policy", "need_base_policies"]


def need_base_policies(config: Config, pairs: Iterable[int]) -> Need:
    """Ask for both policies of some pairs.

    Args:
        config: How they are trained.
        pairs: Which pairs.

    Returns:
        What an experiment's `upstream` lists.

    Example:
        >>> need_base_policies(Config(pairs=3), [2]).shards
        ('safe-2', 'speed-2')
    """
    names = tuple(f"{kind}-{pair}" for pair in pairs for kind in KINDS)
    return Need(experiment="base_policies", config=config, shards=names)


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
