"""Where inputs come from: published shards first, and what keys a shard that has inputs."""

import os
from collections.abc import Iterable, Sequence
from functools import lru_cache

import pandas as pd

from cpl.experiments.run.spec import Experiment, Inputs, Need
from cpl.store import Manifest, data_path, plain, read_manifest, read_published, table_digest

__all__ = ["digests", "fresh", "published_shards"]


def fresh() -> bool:
    """Say whether published results must not serve as inputs: ``CPL_FRESH=1`` recomputes all."""
    return os.environ.get("CPL_FRESH", "") not in ("", "0")


def published_shards(need: Need, spec: Experiment) -> dict[str, pd.DataFrame]:
    """Return those of the needed shards that were published with the same settings."""
    if fresh():
        return {}
    asked = spec.without_extent(plain(need.config))
    for profile in spec.profiles:
        try:
            manifest = read_manifest(need.experiment, profile)
        except FileNotFoundError:
            continue
        if spec.without_extent(manifest.parameters) != asked:
            continue
        here = {shard.name for shard in manifest.shards} & set(need.shards)
        if here:
            return _stretches(need.experiment, profile, manifest, here)
    return {}


def digests(needs: Sequence[Need], inputs: Inputs) -> dict[str, str]:
    """Say what the inputs of a shard are, for its key: ``name/shard`` -> digest of the table."""
    return {
        f"{need.label}/{shard}": table_digest(inputs[need.label][shard])
        for need in needs
        for shard in need.shards
    }


def _stretches(
    experiment: str, profile: str, manifest: Manifest, shards: Iterable[str]
) -> dict[str, pd.DataFrame]:
    stamp = data_path("results", experiment, f"{profile}.json").stat().st_mtime_ns
    table = _read(experiment, profile, stamp)
    wanted = set(shards)
    return {
        s.name: table.iloc[s.first_row : s.first_row + s.rows].reset_index(drop=True)
        for s in manifest.shards
        if s.name in wanted
    }


@lru_cache(maxsize=4)
def _read(experiment: str, profile: str, stamp: int) -> pd.DataFrame:
    """Read a published table once, and again when its manifest was written anew."""
    del stamp
    return read_published(experiment, profile)[0]
