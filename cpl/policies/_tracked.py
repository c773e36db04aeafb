"""Forecasts on a batch of roads, their scores when these become known, and their quantile."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cpl.conformal import BatchTracker, Rule
from cpl.forecast.history import History
from cpl.highway import Config, Engine
from cpl.highway.distances import nearest_proximities
from cpl.policies.switch import Bools, Floats, Ints

__all__ = ["Forecast", "TrackedForecast", "Tracking"]

Forecast = Callable[[NDArray[np.float32]], tuple[NDArray[np.floating], NDArray[np.floating] | None]]
"""From histories (n, length * width) to l_hat (n,) and an uncertainty (n,), or None."""


@dataclass(frozen=True, kw_only=True)
class Tracking:
    """How the quantile of the forecast's error is tracked on every road.

    Attributes:
        rule: How large the steps are.
        alpha: Miscoverage aimed at [-].
        delay: Steps after which a score is known [steps], >= the forecast's horizon.
        carry: Whether an episode begins with the threshold that the one before ended with.
        streams: With `carry`: how many streams the episodes of a setting are dealt to.
        signed: Whether the score is l_tilde - l_hat; else its magnitude.
        issued: Whether a score is compared with the threshold of the time of its forecast; else
            with the present one, as if there were no delay (the paper's theorem knows none).
    """

    rule: Rule
    alpha: float
    delay: int = 3
    carry: bool = False
    streams: int = 10
    signed: bool = False
    issued: bool = True


class TrackedForecast:
    """Histories, forecasts that wait for their outcome, and the thresholds they met."""

    def __init__(
        self,
        n: int,
        forecast: Forecast | None,
        tracking: Tracking | None,
        *,
        horizon: int,
        length: int,
        road: Config,
    ) -> None:
        self._forecast, self._tracking = forecast, tracking
        self._horizon, self._length = horizon, length
        width = road.observation_vehicles_count * len(road.features)
        self._history = History(n, length=length, width=width)
        self._trackers = None
        if tracking is not None:
            self._trackers = BatchTracker(tracking.rule, n, alpha=tracking.alpha)
        self._delay = tracking.delay if tracking else horizon
        self._size = self._delay + 1
        self._all, self._nothing = np.arange(n), np.zeros(n)
        # Rings over time: what was forecast and met at step t stands at t modulo the size.
        self._l_hat = np.zeros((n, self._size))
        self._met = np.zeros((n, self._size))
        self._truth = np.zeros((n, self._size))
        self.l_tilde: Floats = np.zeros(n)

    def see(self, obs: NDArray[np.float32], engine: Engine, step: Ints) -> None:
        """Take the observations at the present decisions in; `step` 0 begins an episode."""
        self._history.push(obs)
        begun = step == 0
        if begun.any():
            self.l_tilde = np.where(begun, nearest_proximities(engine), self.l_tilde)

    def guess(self, step: Ints) -> tuple[Floats, Floats, Bools]:
        """Forecast, and say what is added to the forecast and where there is one."""
        l_hat, u = self._nothing, self._nothing
        if self._forecast is not None:
            guessed, own = self._forecast(self._history.flat)
            l_hat = np.asarray(guessed, np.float64)
            u = u if own is None else np.asarray(own, np.float64)
        if self._trackers is not None:
            u = self._trackers.q
        at = step % self._size
        self._l_hat[self._all, at], self._met[self._all, at] = l_hat, u
        return l_hat, u, self._history.ready

    def learn(self, engine: Engine, step: Ints, active: Bools) -> tuple[Bools, Bools]:
        """Feed back the scores that are known now; return which roads had one and who missed."""
        self.l_tilde = nearest_proximities(engine)
        self._truth[self._all, step % self._size] = self.l_tilde
        made = step - self._delay
        known = active & (made >= self._length - 1)
        if self._forecast is None:
            known = np.zeros_like(known)
        seen = self._truth[self._all, (made + self._horizon) % self._size]
        scores = seen - self._l_hat[self._all, made % self._size]
        if self._tracking is None or not self._tracking.signed:
            scores = np.abs(scores)
        met = self._met[self._all, made % self._size]
        if self._trackers is None:
            return known, known & (scores > met)
        if self._tracking is not None and not self._tracking.issued:
            met = self._trackers.q
        return known, self._trackers.feedback(scores, met, known)

    def forget(self, ended: Bools) -> None:
        """End episodes: histories always, thresholds unless they are carried on."""
        self._history.reset(ended)
        if self._trackers is not None and self._tracking is not None and not self._tracking.carry:
            self._trackers.reset(ended)
