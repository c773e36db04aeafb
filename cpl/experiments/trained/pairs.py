"""Pairs: a training seed has its own base policies, forecasters and agents."""

from dataclasses import replace
from typing import Annotated, Protocol, TypeVar

from cpl.settings.ranges import Choice

__all__ = ["Models", "with_pair"]

Models = Annotated[str, Choice(("smoke", "book", "paper"))]
"""The profile of the experiments that trained what another one takes."""


class _Trainings(Protocol):
    @property
    def pairs(self) -> int: ...


T = TypeVar("T", bound=_Trainings)


def with_pair(trainings: T, pair: int) -> T:
    """Return the settings of trainings that a pair is among, be it one that nobody trained yet.

    Args:
        trainings: Settings of an experiment that trains.
        pair: Number of the pair, from 0.

    Examples:
        >>> from cpl.experiments.trained.base_policies import PROFILES
        >>> with_pair(PROFILES["paper"], 3).pairs, with_pair(PROFILES["paper"], 11).pairs
        (10, 12)
    """
    return replace(trainings, pairs=max(trainings.pairs, pair + 1))  # pyright: ignore[reportArgumentType]
