"""Drive many episodes with two policies and a chooser, forecast and tracker in the loop.

One call drives every setting of a chooser (every threshold, say) over the same environment seeds.
The episodes of all settings share one batch of roads: when one ends, its road begins the next.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cpl.highway import Config, Engine, Policy
from cpl.policies._ahead import Ahead, Forecast, Tracking
from cpl.policies._log import Log, Plan, Rides
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
    numbers = np.asarray(seeds, dtype=np.int64)
    if numbers.ndim != 1 or numbers.size == 0 or settings < 1 or n_envs < 1:
        raise ValueError(
            f"seeds, settings and n_envs must be at least one, got {numbers.size},"
            f" {settings!r} and {n_envs!r}"
        )
    if tracking is not None and (forecast is None or tracking.delay < horizon):
        raise ValueError(
            f"tracking must have a forecast and a delay >= the horizon {horizon}, got {tracking!r}"
        )
    streams = tracking.streams if tracking is not None and tracking.carry else None
    plan = Plan(settings, len(numbers), n_envs, streams)
    engine = Engine(road, plan.roads, path=path)
    log = Log(settings, numbers, plan.roads, record)
    ahead = Ahead(plan.roads, forecast, tracking, horizon=horizon, length=length, road=road)
    obs = engine.reset(numbers[plan.episode])
    start_x = engine.state().x[:, 0]
    step = np.zeros(plan.roads, dtype=np.int64)
    ahead.see(obs, engine, step)
    while plan.active.any():
        l_hat, u, ready = ahead.guess(step)
        moment = Moment(
            setting=plan.setting,
            episode=plan.episode,
            step=step,
            obs=obs,
            l_hat=l_hat,
            u=u,
            ready=ready,
            engine=engine,
        )
        safe = chooser(moment)
        log.decide(plan, moment, safe, ahead.l_tilde)
        out = engine.step(_actions(drivers, safe, obs))
        obs, step = out.obs, step + plan.active  # a road without an episode stands still
        log.score(*ahead.learn(engine, step, plan.active))
        log.speeds(out.info.speed)
        ended = (out.terminated | out.truncated) & plan.active
        if ended.any():
            x = engine.state().x
            log.end(plan, ended, step, out.info.crashed, x, start_x, ahead.l_tilde)
            again = plan.next(ended)
            if again.any():
                first = engine.reset(np.where(again, numbers[plan.episode], 0), again)
                obs = np.where(again[:, None, None], first, obs)
                start_x = np.where(again, engine.state().x[:, 0], start_x)
                step = np.where(again, 0, step)
                log.begin(again)
        ahead.forget(ended)
        ahead.see(obs, engine, step)
    return log.rides()


def _actions(drivers: Drivers, safe: Bools, obs: NDArray[np.float32]) -> Ints:
    """Ask each policy about the roads that it drives."""
    actions = np.empty(len(obs), dtype=np.int64)
    for chosen, policy in ((safe, drivers.safe), (~safe, drivers.speed)):
        if chosen.any():
            actions[chosen] = policy(obs[chosen])
    return actions
