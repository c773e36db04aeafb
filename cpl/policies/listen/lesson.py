"""The training environment of an agent that hears: forecast and tracker run inside it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from cpl.conformal import Tracker
from cpl.forecast.history import History
from cpl.highway import Config, Engine, nearest_distances
from cpl.highway.proximity import proximity
from cpl.policies.listen.hearing import Hearing, Penalty
from cpl.rng import stream

__all__ = ["Listening"]


class Listening:
    """The wrapper (`cpl.policies.dqn.Wrapper`) between one road and a learner that hears.

    At each decision it forecasts, feeds back the score of the forecast of `delay` decisions ago,
    and shows the learner what its view shows; `ride` computes the same numbers for many roads.

    Args:
        road: The road, for the size of its observations.
        hearing: Forecast, tracker, view, and what the learner chooses between.
        penalty: What is taken off the reward.
        blur: Standard deviations of noise on the forecast [-]; each episode draws one of them.
        seed: Of that noise.

    Example:
        >>> from cpl.conformal import RunningMax
        >>> from cpl.policies.evaluate import Tracking
        >>> half = lambda flat: (np.full(len(flat), 0.5, np.float32), None)
        >>> hears = Hearing(forecast=half, tracking=Tracking(rule=RunningMax(c=0.1), alpha=0.1))
        >>> Listening(Config(), hears).size
        27
    """

    def __init__(
        self,
        road: Config,
        hearing: Hearing,
        *,
        penalty: Penalty | None = None,
        blur: Sequence[float] = (0.0,),
        seed: int = 0,
    ) -> None:
        if not blur or not all(sigma >= 0 for sigma in blur):
            raise ValueError(f"blur must name at least one deviation >= 0, got {blur!r}")
        self.hearing, self.penalty = hearing, penalty or Penalty()
        self.size, self.actions = hearing.size(road), hearing.choices
        self._width = hearing.width(road)
        self._history = History(1, length=hearing.length, width=self._width)
        tracking = hearing.tracking
        self._tracker = Tracker(tracking.rule, alpha=tracking.alpha)
        self._blur, self._sigma = tuple(blur), 0.0
        self._rng = stream(seed, "listen", "blur")
        self._obs = np.empty(0, np.float32)
        self._step = 0
        # By step of the episode: what was forecast, the threshold then, and what came.
        self._l_hat: list[float] = []
        self._met: list[float] = []
        self._truth: list[float] = []
        self._shown = np.zeros((1, hearing.view.quantiles))
        self._heard: list[tuple[float, float, float]] = []

    def reset(self, engine: Engine, obs: NDArray[np.float32]) -> NDArray[np.float32]:
        """Begin an episode: without a history, and with q anew unless it is carried on."""
        if not self.hearing.tracking.carry:
            self._tracker.reset()
        self._history.reset()
        self._sigma = self._blur[0]
        if len(self._blur) > 1:
            self._sigma = self._blur[int(self._rng.integers(len(self._blur)))]
        self._step = 0
        self._l_hat, self._met, self._truth = [], [], [_near(engine)]
        self._shown[:] = self._tracker.q
        return self._see(obs)

    def action(self, choice: int) -> int:
        """Return the road's action: the choice itself, or what the chosen policy does."""
        l_hat = self._l_hat[-1] if self._step >= self.hearing.length - 1 else np.nan
        self._heard.append((l_hat, self._tracker.q, self._truth[-1]))
        if not self.hearing.policies:
            return choice
        return int(self.hearing.policies[choice](self._obs[None])[0])

    def step(
        self, engine: Engine, obs: NDArray[np.float32], reward: float
    ) -> tuple[NDArray[np.float32], float]:
        """Score what is known now, forecast anew, and take the penalty off the reward."""
        self._step += 1
        self._truth.append(_near(engine))
        self._learn()
        seen = self._see(obs)
        return seen, reward - self.penalty(self._l_hat[-1], self._tracker.q)

    @property
    def heard(self) -> pd.DataFrame:
        """One row a decision so far: `l_hat` (NaN before the first forecast), `q`, `l_tilde`."""
        return pd.DataFrame(self._heard, columns=["l_hat", "q", "l_tilde"])

    def _learn(self) -> None:
        hearing = self.hearing
        made = self._step - hearing.tracking.delay
        if made < hearing.length - 1:
            return
        score = self._truth[made + hearing.horizon] - self._l_hat[made]
        if not hearing.tracking.signed:
            score = abs(score)
        met = self._met[made] if hearing.tracking.issued else self._tracker.q
        self._tracker.feedback(score, met)

    def _see(self, obs: NDArray[np.float32]) -> NDArray[np.float32]:
        hearing = self.hearing
        self._obs = obs
        self._history.push(obs[None])
        flat, l_hat, q = self._history.flat, 0.0, self._tracker.q
        if self._step >= hearing.length - 1:
            l_hat = float(hearing.forecast(flat)[0][0])
            if self._sigma:
                l_hat = min(max(l_hat + self._sigma * self._rng.standard_normal(), 0.0), 1.0)
        self._l_hat.append(l_hat)
        self._met.append(q)
        if self._step:
            self._shown[:, :-1] = self._shown[:, 1:]
        self._shown[:, -1:] = q
        return hearing.seen(flat, self._width, np.array([l_hat]), self._shown)[0]


def _near(engine: Engine) -> float:
    return float(proximity(nearest_distances(engine))[0])  # pyright: ignore[reportIndexIssue]
