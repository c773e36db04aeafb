"""Episodes with a forecast, its quantile and a log: what `drive` and `ride` have in common."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from cpl.highway import Config, Decision, Engine, Plan, Turn, episodes
from cpl.policies._log import Log, Rides
from cpl.policies._tracked import Forecast, TrackedForecast, Tracking
from cpl.policies.switch import Bools, Floats, Ints, Moment

__all__ = ["Decide", "Driving"]

Decide = Callable[[Moment, Bools], tuple[Bools, Ints]]
"""From a moment and where an episode begins to who drives safely (n,), and the actions (n,)."""


class Driving:
    """One episode for each setting and seed; the arguments are those of `drive`.

    Raises:
        ValueError: If there is nothing to drive, or a score is wanted before it can be known.
    """

    def __init__(
        self,
        road: Config,
        seeds: Sequence[int] | NDArray[np.integer],
        *,
        settings: int,
        forecast: Forecast | None,
        tracking: Tracking | None,
        horizon: int,
        length: int,
        n_envs: int,
        record: bool,
        path: str | None = None,
    ) -> None:
        self.seeds = np.asarray(seeds, dtype=np.int64)
        if self.seeds.ndim != 1 or self.seeds.size == 0 or settings < 1 or n_envs < 1:
            raise ValueError(
                f"seeds, settings and n_envs must be at least one, got {self.seeds.size},"
                f" {settings!r} and {n_envs!r}"
            )
        if tracking is not None and (forecast is None or tracking.delay < horizon):
            raise ValueError(
                f"tracking must have a forecast and a delay >= the horizon {horizon}, got"
                f" {tracking!r}"
            )
        streams = tracking.streams if tracking is not None and tracking.carry else None
        self.plan = Plan(len(self.seeds), n_envs, settings=settings, streams=streams)
        self.engine = Engine(road, self.plan.roads, path=path)
        self._log = Log(settings, self.seeds, self.plan.roads, record)
        self._tracked = TrackedForecast(
            self.plan.roads, forecast, tracking, horizon=horizon, length=length, road=road
        )

    @property
    def l_tilde(self) -> Floats:
        """Squashed distance to the nearest car on every road now [-], (n,)."""
        return self._tracked.l_tilde

    def turns(self, decide: Decide) -> Iterator[Turn]:
        """Drive; each turn is written down before it is yielded."""
        plan, engine, log, tracked = self.plan, self.engine, self._log, self._tracked
        start_x = np.zeros(plan.roads)

        def act(now: Decision) -> Ints:
            nonlocal start_x
            if now.began.any():
                start_x = np.where(now.began, engine.state().x[:, 0], start_x)
                log.begin(now.began)
            tracked.see(now.obs, engine, now.step)
            l_hat, u, ready = tracked.guess(now.step)
            moment = Moment(
                setting=plan.setting, episode=plan.episode, step=now.step, obs=now.obs,
                l_hat=l_hat, u=u, ready=ready, engine=engine,
            )  # fmt: skip
            safe, action = decide(moment, now.began)
            log.decide(plan, moment, safe, tracked.l_tilde)
            return action

        for turn in episodes(engine, act, self.seeds, plan):
            info, ended = turn.out.info, turn.ended
            log.score(*tracked.learn(engine, turn.step, turn.active))
            log.speeds(info.speed)
            if ended.any():
                x = engine.state().x
                log.end(plan, ended, turn.step, info.crashed, x, start_x, tracked.l_tilde)
            tracked.forget(ended)
            yield turn

    def rides(self) -> Rides:
        """Return what was written down."""
        return self._log.rides()
