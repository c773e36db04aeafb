"""All pieces of several experiments, and of those that they stand on, as one graph of tasks."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import pandas as pd

from cpl.experiments.run.costs import expected_seconds
from cpl.experiments.run.inputs import published_shards
from cpl.experiments.run.job import Job, experiment, job_of
from cpl.experiments.run.schedule import Piece, chains
from cpl.experiments.run.spec import Inputs, Need, Shard
from cpl.store import canonical_json, plain, rules_in_force
from cpl.sweep import Tables, Task

__all__ = ["Graph", "Place"]

_UNKNOWN_S = 1.0  # what a piece is taken for that was never timed

Place = tuple[str, str]
"""Which experiment with which settings, and which of its shards."""


@dataclass(frozen=True, kw_only=True)
class Graph:
    """What has to be run so that some jobs are done; what is published serves as an input.

    A shard that several jobs need, or that is a job's own and another one's input, is there once.

    Attributes:
        pieces: By place, the job and the shard that are run there.
        needs: By place, what it is computed from.
        given: Published tables by place.
    """

    pieces: dict[Place, tuple[Job, Shard]] = field(default_factory=dict[Place, "tuple[Job, Shard]"])
    needs: dict[Place, list[Need]] = field(default_factory=dict[Place, "list[Need]"])
    given: dict[Place, pd.DataFrame] = field(default_factory=dict[Place, pd.DataFrame])
    _jobs: dict[str, Job] = field(default_factory=dict[str, Job])

    def add(self, task: Job, shards: Sequence[str] | None = None) -> list[Place]:
        """Add pieces of a job, and before them what they need.

        Args:
            task: The job.
            shards: Which pieces; all unless given.

        Returns:
            Where they are.

        Raises:
            ValueError: If an experiment needs shards that another one does not have.
        """
        places = [_place(task, name) for name in (task.pieces if shards is None else shards)]
        for place in places:
            if place in self.pieces:
                continue
            self.pieces[place] = (task, task.pieces[place[1]])
            self.needs[place] = needs = task.needs(place[1])
            for need in needs:
                self._ask(need)
        return places

    def inputs_of(self, place: Place) -> list[Place]:
        """Return where the inputs of a piece are, in the order of its needs."""
        return [
            _place(self._job(need), shard) for need in self.needs[place] for shard in need.shards
        ]

    def costs(self) -> dict[Place, Piece]:
        """Return what the pieces should take, from what was noted when they were computed."""
        shards: dict[str, set[str]] = {}
        for task, shard in self.pieces.values():
            shards.setdefault(task.name, set()).add(shard.name)
        known = {name: expected_seconds(name, own) or {} for name, own in shards.items()}
        return {
            place: Piece(
                seconds=known[task.name].get(shard.name, _UNKNOWN_S),
                needs=tuple(one for one in self.inputs_of(place) if one not in self.given),
            )
            for place, (task, shard) in self.pieces.items()
        }

    def tasks(self) -> dict[Place, Task]:
        """Return what is to be swept, that at the head of the longest chain ranked first."""
        ranks, rules = chains(self.costs()), rules_in_force()
        return {
            place: Task(
                call=partial(_run_piece, task.name, task.config, shard, _shape(self.needs[place])),
                needs=tuple(self.inputs_of(place)),
                stage=task.name,
                name=shard.name,
                key=partial(_key, task, self.needs[place]),
                origin=task.origin,
                rank=ranks[place],
                description=_description(task),
                lasting={"rules": rules},
            )
            for place, (task, shard) in self.pieces.items()
        }

    def _ask(self, need: Need) -> None:
        """Add what a need names and nobody has published."""
        task = self._job(need)
        if unknown := [name for name in need.shards if name not in task.pieces]:
            msg = f"shards of {need.experiment!r} must be among its own, got {unknown}"
            raise ValueError(msg)
        open_ = [name for name in need.shards if _place(task, name) not in self.given]
        found = published_shards(need, task.spec) if open_ else {}
        self.given.update({_place(task, name): table for name, table in found.items()})
        self.add(task, [name for name in open_ if name not in found])

    def _job(self, need: Need) -> Job:
        key = canonical_json([need.experiment, plain(need.config)])
        if key not in self._jobs:
            self._jobs[key] = job_of(need.experiment, "+", need.config)
        return self._jobs[key]


def _place(task: Job, shard: str) -> Place:
    return task.place, shard


def _shape(needs: Sequence[Need]) -> list[tuple[str, tuple[str, ...]]]:
    return [(need.label, need.shards) for need in needs]


def _key(task: Job, needs: Sequence[Need], digests: Sequence[str]) -> str:
    names = [f"{need.label}/{shard}" for need in needs for shard in need.shards]
    return task.key(dict(zip(names, digests, strict=True)))


def _run_piece(
    name: str,
    config: Any,  # noqa: ANN401 - its own Config
    shard: Shard,
    shape: Sequence[tuple[str, tuple[str, ...]]],
    tables: Tables,
) -> pd.DataFrame:
    """Run one piece (in a worker)."""
    run: Callable[..., pd.DataFrame] = experiment(name).run
    left = iter(tables)
    inputs: Inputs = {label: {shard: next(left) for shard in shards} for label, shards in shape}
    return run(config, shard, inputs) if inputs else run(config, shard)


def _description(task: Job) -> Mapping[str, Any]:
    return {
        "experiment": task.name,
        "parameters": task.parameters,
        "modules": task.modules,
        "versions": task.versions,
        "shards": len(task.pieces),
    }
