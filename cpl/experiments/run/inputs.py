"""Where inputs come from: what was published serves first."""

import os
from collections.abc import Iterable
from functools import lru_cache

import pandas as pd

from cpl.experiments.run.spec import Experiment, Need
from cpl.store import Manifest, data_path, plain, read_manifest, read_published

__all__ = ["fresh", "published_shards"]


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
