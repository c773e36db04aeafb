"""What an experiment is: data, and one function that computes a piece of its table.

A module of a question's folder is an experiment if it binds

    EXPERIMENT = Experiment(
        run=run_shard,
        profiles=PROFILES,
        shards=grid("pair{pair}", pair="pairs"),
        needs=needs_of_pair,
        label="simulated",
        extent=("pairs",),
        rtol=1e-5,
    )

The first line of its docstring is its question; its settings are a frozen dataclass, `Config`. What
a piece is computed from it says itself, so `run_shard(config, shard, inputs)` stays a pure
function: it computes the same wherever it runs, and nothing is looked up behind its back.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, fields
from itertools import product
from typing import Any, cast

import pandas as pd

__all__ = ["Experiment", "Inputs", "Need", "Shard", "grid", "parts", "whole"]

LABELS = (
    "exact", "proved", "measured", "simulated", "simulated-kinematic", "simulated-legged",
)  # fmt: skip
"""Kinds of evidence."""

Value = int | float | str
Inputs = Mapping[str, Mapping[str, pd.DataFrame]]
"""By name of the need, then by name of the shard: the table."""


@dataclass(frozen=True)
class Shard:
    """The piece that is computed, kept and re-executed as a whole.

    Attributes:
        name: Unique within the experiment.
        values: What distinguishes this piece.

    Examples:
        >>> Shard("uniform-3", {"kind": "uniform", "part": 3})["part"]
        3
    """

    name: str
    values: Mapping[str, Value] = field(default_factory=dict[str, Value])

    def __getitem__(self, key: str) -> Value:
        return self.values[key]

    def number(self, key: str) -> int:
        """Return an integer value."""
        return int(self.values[key])

    def text(self, key: str) -> str:
        """Return a value as text."""
        return str(self.values[key])


@dataclass(frozen=True, kw_only=True)
class Need:
    """Some shards of another experiment, that a shard is computed from.

    Attributes:
        experiment: Its name.
        config: Its configuration.
        shards: Which of its shards.
        name: Under which name `run_shard` finds them; the experiment's unless given.
    """

    experiment: str
    config: Any
    shards: tuple[str, ...]
    name: str = ""

    @property
    def label(self) -> str:
        """The name that `run_shard` finds the tables under."""
        return self.name or self.experiment


@dataclass(frozen=True, kw_only=True)
class Experiment:
    """What is asked, with which settings, and how a piece of it is computed.

    Attributes:
        run: `run(config, shard)`, or `run(config, shard, inputs)` for a shard with needs: the
            piece's table. Pure.
        profiles: Settings by name: `smoke` (seconds, for tests), `book` (while you wait), `paper`
            (what is published).
        shards: The pieces that a configuration is cut into; see `grid`.
        needs: The shards of other experiments that a shard is computed from.
        label: What kind of evidence it gives; one of `LABELS`.
        extent: Settings that only say how many shards there are: a shard of ten seeds is the shard
            of one.
        rtol: How far the floats of a re-execution may be from the published ones, relatively; what
            is discrete must be equal.
    """

    run: Callable[..., pd.DataFrame]
    profiles: Mapping[str, Any]
    shards: Callable[[Any], list[Shard]]
    needs: Callable[[Any, Shard], list[Need]] = lambda config, shard: []
    label: str
    extent: tuple[str, ...] = ()
    rtol: float = 1e-9

    def __post_init__(self) -> None:
        if self.label not in LABELS:
            raise ValueError(f"label must be one of {LABELS}, got {self.label!r}")
        if not self.profiles:
            raise ValueError("profiles must have at least one, got none")
        if not self.rtol >= 0:
            raise ValueError(f"rtol must not be negative, got {self.rtol!r}")
        known = {one.name for config in self.profiles.values() for one in fields(config)}
        if wrong := set(self.extent) - known:
            raise ValueError(f"extent must name settings, got {sorted(wrong)}")

    def without_extent(self, parameters: Mapping[str, Any]) -> dict[str, Any]:
        """Leave out the settings that only say how many shards there are."""
        return {name: value for name, value in parameters.items() if name not in self.extent}


def grid(
    name: str, **axes: str | Iterable[Value] | Callable[[Any], Iterable[Value]]
) -> Callable[[Any], list[Shard]]:
    """Cut an experiment into a shard for each combination of values, the last axis fastest.

    Args:
        name: Names a shard by its values, as in `"{kind}-{pair}"`; spaces become hyphens.
        axes: By the value's name: the values; or the name of a setting, which holds them or, an
            integer, counts them from 0; or a function of the configuration.

    Returns:
        What `Experiment.shards` is.

    Examples:
        >>> from types import SimpleNamespace as Config
        >>> cut = grid("{kind}-{pair}", pair="pairs", kind=("safe", "speed"))
        >>> [shard.name for shard in cut(Config(pairs=2))]
        ['safe-0', 'speed-0', 'safe-1', 'speed-1']
    """

    def cut(config: Any) -> list[Shard]:  # noqa: ANN401 - some Config
        values = [tuple(_values(axis, config)) for axis in axes.values()]
        combinations = [dict(zip(axes, members, strict=True)) for members in product(*values)]
        return [Shard(name.format(**one).replace(" ", "-"), one) for one in combinations]

    return cut


def whole(config: Any) -> list[Shard]:  # noqa: ANN401 - some Config
    """Leave an experiment in one piece."""
    del config
    return [Shard("all")]


def parts(total: int, size: int) -> Iterator[tuple[int, int]]:
    """Cut a number of things into parts of at most a size: part number and its own size.

    Examples:
        >>> list(parts(25, 10))
        [(0, 10), (1, 10), (2, 5)]
    """
    for part, first in enumerate(range(0, total, size)):
        yield part, min(size, total - first)


def _values(axis: Any, config: Any) -> Iterable[Value]:  # noqa: ANN401 - see `grid`
    if callable(axis):
        return cast("Iterable[Value]", axis(config))
    values: Any = getattr(config, axis) if isinstance(axis, str) else axis
    return range(values) if isinstance(values, int) else cast("Iterable[Value]", values)
