"""An experiment with its settings: found by name, checked before any work, and keyed."""

import sys
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from importlib import import_module
from typing import Any, cast

from cpl.experiments.run.found import module_of, names
from cpl.experiments.run.settings import changed, unknown
from cpl.experiments.run.spec import Experiment, Need, Shard
from cpl.store import (
    canonical_json,
    fingerprint,
    module_digests,
    plain,
    stage_key,
    versions_below,
)

__all__ = ["Job", "experiment", "job", "job_of", "question"]


@dataclass(frozen=True, kw_only=True)
class Job:
    """An experiment with its configuration, and what keys its shards.

    Attributes:
        name: The experiment's.
        profile: Where the settings come from; ``+`` behind it: with changes.
        spec: The experiment.
        config: Its settings.
        pieces: Its shards by name.
        modules: Digest of each module below it.
        versions: Of the numerical packages below it.
    """

    name: str
    profile: str
    spec: Experiment
    config: Any
    pieces: dict[str, Shard]
    modules: dict[str, str]
    versions: dict[str, str]

    @cached_property
    def place(self) -> str:
        """What tells jobs apart that have shards in common: their name and `parameters`."""
        return canonical_json([self.name, self.parameters])

    @property
    def origin(self) -> str:
        """Dotted name of the module that computes."""
        return module_of(self.name)

    @cached_property
    def parameters(self) -> dict[str, Any]:
        """The settings that a shard depends on: all but those that count shards."""
        return self.spec.without_extent(plain(self.config))

    def needs(self, shard: str) -> list[Need]:
        """Return what a shard is computed from."""
        return self.spec.needs(self.config, self.pieces[shard])

    def key(self, inputs: Mapping[str, str]) -> str:
        """Return the key of shards with these inputs (``need/shard`` -> digest)."""
        return stage_key(
            self.name,
            self.parameters,
            upstream=[f"{name}={digest}" for name, digest in sorted(inputs.items())],
            fingerprint=self._code,
            versions=self.versions,
        )

    @cached_property
    def _code(self) -> str:
        return fingerprint(self.origin)


def experiment(name: str) -> Experiment:
    """Import an experiment by name.

    Raises:
        ValueError: If there is none of that name.
    """
    known = names()
    if name not in known:
        raise ValueError(unknown("experiment", name, known))
    return cast("Experiment", import_module(module_of(name)).EXPERIMENT)


def question(name: str) -> str:
    """Return what an experiment asks: the first line of its module's docstring."""
    experiment(name)
    return (sys.modules[module_of(name)].__doc__ or "").partition("\n")[0]


def job(name: str, profile: str, changes: Mapping[str, object] | None = None) -> Job:
    """Check everything that was asked for, before any work.

    Raises:
        ValueError: If there is no such experiment, profile or setting, or a value does not fit.
    """
    profiles = experiment(name).profiles
    if profile not in profiles:
        raise ValueError(unknown(f"profile of {name}", profile, profiles))
    config = changed(profiles[profile], changes or {})
    same = config == profiles[profile]
    return job_of(name, profile if same else f"{profile}+", config)


def job_of(name: str, profile: str, config: Any) -> Job:  # noqa: ANN401 - its own Config
    """Return the job of a configuration that is known to be right."""
    spec, origin = experiment(name), module_of(name)
    return Job(
        name=name,
        profile=profile,
        spec=spec,
        config=config,
        pieces={shard.name: shard for shard in spec.shards(config)},
        modules=module_digests(origin),
        versions=versions_below(origin),
    )
