"""An experiment with its settings: found by name, checked before any work, and keyed."""

from collections.abc import Mapping
from dataclasses import dataclass
from importlib import import_module
from typing import Any, Protocol, cast

import pandas as pd

from cpl.experiments.run.found import module_of, names
from cpl.experiments.run.inputs import without_extent
from cpl.experiments.run.need import Inputs, Need
from cpl.experiments.run.settings import changed, unknown
from cpl.experiments.run.shard import Shard
from cpl.store import fingerprint, module_digests, plain, stage_key, versions_below

__all__ = ["Experiment", "Job", "experiment", "job", "job_of"]


class Experiment(Protocol):
    """What a module of `cpl.experiments` offers."""

    __doc__: str
    LABEL: str
    PROFILES: Mapping[str, Any]

    def shards(self, config: Any) -> list[Shard]:  # noqa: ANN401 - its own Config
        """Cut the experiment into pieces."""
        ...

    def run_shard(self, config: Any, shard: Shard, *inputs: Inputs) -> pd.DataFrame:  # noqa: ANN401
        """Compute one piece; `inputs` if the experiment has an `upstream`."""
        ...


@dataclass(frozen=True, kw_only=True)
class Job:
    """An experiment with its configuration, and what keys its shards.

    Attributes:
        name: The experiment's.
        profile: Where the settings come from; ``+`` behind it: with changes.
        module: The experiment.
        config: Its settings.
        pieces: Its shards by name.
        modules: Digest of each module below it.
        versions: Of the numerical packages below it.
    """

    name: str
    profile: str
    module: Experiment
    config: Any
    pieces: dict[str, Shard]
    modules: dict[str, str]
    versions: dict[str, str]

    @property
    def origin(self) -> str:
        """Dotted name of the module that computes."""
        return module_of(self.name)

    def needs(self, shard: str) -> list[Need]:
        """Return what a shard is computed from."""
        upstream = getattr(self.module, "upstream", None)
        return [] if upstream is None else list(upstream(self.config, self.pieces[shard]))

    def key(self, inputs: Mapping[str, str]) -> str:
        """Return the key of shards with these inputs (``need/shard`` -> digest)."""
        parameters = without_extent(self.module, plain(self.config))
        return stage_key(
            self.name,
            parameters,
            upstream=[f"{name}={digest}" for name, digest in sorted(inputs.items())],
            fingerprint=fingerprint(self.origin),
            versions=self.versions,
        )


def experiment(name: str) -> Experiment:
    """Import an experiment by name.

    Raises:
        ValueError: If there is none of that name.
    """
    known = names()
    if name not in known:
        raise ValueError(unknown("experiment", name, known))
    return cast("Experiment", import_module(module_of(name)))


def job(name: str, profile: str, changes: Mapping[str, object] | None = None) -> Job:
    """Check everything that was asked for, before any work.

    Raises:
        ValueError: If there is no such experiment, profile or setting, or a value does not fit.
    """
    module = experiment(name)
    if profile not in module.PROFILES:
        raise ValueError(unknown(f"profile of {name}", profile, module.PROFILES))
    config = changed(module.PROFILES[profile], changes or {})
    same = config == module.PROFILES[profile]
    return job_of(name, profile if same else f"{profile}+", config)


def job_of(name: str, profile: str, config: Any) -> Job:  # noqa: ANN401 - its own Config
    """Return the job of a configuration that is known to be right."""
    module, origin = experiment(name), module_of(name)
    return Job(
        name=name,
        profile=profile,
        module=module,
        config=config,
        pieces={shard.name: shard for shard in module.shards(config)},
        modules=module_digests(origin),
        versions=versions_below(origin),
    )
