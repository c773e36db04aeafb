"""Drive many episodes with two policies and a chooser, forecast and tracker in the loop.

One call drives every setting of a chooser (every threshold, say) over the same environment seeds.
The episodes of all settings share one batch of roads: when one ends, its road begins the next.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cpl.highway import Config, Policy
from cpl.policies._driving import Driving
from cpl.policies._log import Rides
from cpl.policies._tracked import Forecast, Tracking
from cpl.policies.switch import Bools, Chooser, Ints, Moment

__all__ = ["Drivers", "Forecast", "Rides", "Tracking", "drive"]


@dataclass(frozen=True, kw_only=True)
class Drivers:
    """The two base policies, from observations (n, rows, features) to actions (n,)."""

    safe: Policy
    speed: Policy


def drive(
    road: Config,
    drivers: Drivers,
    chooser: Chooser,
    seeds: Sequence[int] | NDArray[np.integer],
    *,
    settings: int = 1,
    forecast: Forecast | None = None,
    tracking: Tracking | None = None,
    horizon: int = 3,
    length: int = 5,
    n_envs: int = 256,
    record: bool = False,
    path: str | None = None,
) -> Rides:
    """Drive one episode for each setting and seed.

    Args:
        road: The road.
        drivers: The two policies.
        chooser: Who drives.
        seeds: Environment seeds, the same in every setting.
        settings: How many settings the chooser has.
        forecast: The forecaster; without one nothing is forecast, and nothing scored.
        tracking: Adds the tracked quantile to the forecast in place of its own uncertainty.
        horizon: How far the forecast looks [steps].
        length: Observations in a history.
        n_envs: Roads driven at a time; with `carry` there is one a setting and stream.
        record: Whether every step is returned too.
        path: The engine's arithmetic; "own" for the same bits on every machine.

    Returns:
        The rides.

    Raises:
        ValueError: If there is nothing to drive, or a score is wanted before it can be known.
    """
    driving = Driving(
        road, seeds, settings=settings, forecast=forecast, tracking=tracking, horizon=horizon,
        length=length, n_envs=n_envs, record=record, path=path,
    )  # fmt: skip

    def decide(moment: Moment, _began: Bools) -> tuple[Bools, Ints]:
        safe = chooser(moment)
        return safe, _actions(drivers, safe, moment.obs)

    for _ in driving.turns(decide):
        pass
    return driving.rides()


def _actions(drivers: Drivers, safe: Bools, obs: NDArray[np.float32]) -> Ints:
    """Ask each policy about the roads that it drives."""
    actions = np.empty(len(obs), dtype=np.int64)
    for chosen, policy in ((safe, drivers.safe), (~safe, drivers.speed)):
        if chosen.any():
            actions[chosen] = policy(obs[chosen])
    return actions
