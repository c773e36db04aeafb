"""Which gain now? Prediction, quantile and gain rule put together: pi_switch and its controls.

At step t the policy learns whether step t had a SLAM error; that is the outcome of what it
predicted at t - 2, so feedback is two steps old (contradiction 9). The score of a binary label is
not given in the paper; implied is

    s_t = | l_t - l_hat_t |,   B = 1

(contradiction 6), held against the threshold that was in force when the prediction was made.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from cpl.conformal import RunningMax, Tracker
from cpl.conformal.rules import Rule
from cpl.quadruped.features import HORIZON
from cpl.quadruped.gains import GainLimits, GainRule

__all__ = ["Decision", "Policy", "PolicyConfig"]

Forecast = Callable[[NDArray[np.float64]], float | NDArray[np.float64]]
Peek = Callable[[], float]


@dataclass(frozen=True, kw_only=True)
class PolicyConfig:
    """What all policies share.

    Args:
        alpha: Miscoverage aimed at [-]; the paper's 0.2.
        rule: The tracker's step; the paper's 0.1 times a maximum of the scores, here the running
            one, for which the guarantee holds (contradiction 11).
        q0: First threshold [score]; the paper states none.
        kp0: First gain [1/s], clipped into the range; that of the training runs.
    """

    alpha: float = 0.2
    rule: Rule = field(default_factory=lambda: RunningMax(c=0.1))
    q0: float = 0.0
    kp0: float = 1.5


@dataclass(frozen=True, kw_only=True)
class Decision:
    """What was decided at a step, and why.

    Args:
        kp: The gain to use now [1/s].
        l_hat: Predicted probability of an error at t + 2 [-]; NaN without a predictor.
        q: The threshold in force for this prediction [score].
        score: |l - l_hat| of the prediction made at t - 2, known only now; NaN before.
        err: Whether that score was above the threshold it met; None before.
    """

    kp: float
    l_hat: float
    q: float
    score: float
    err: bool | None


class Policy:
    """One run's policy; make a new one for each run.

    Args:
        rule: From (kp, l_hat, q, limits) to the next gain, one of `gains.GAIN_RULES`.
        limits: The gain's range and the threshold.
        config: Tracker and first gain.
        forecast: From the 47 features to a probability; None for a policy without prediction, or
            for the oracle.
        oracle: Whether the prediction is the true label, looked up in the world's own future.

    Raises:
        ValueError: Both a forecast and an oracle.

    >>> limits = GainLimits(kp_min=0.8, kp_max=4.0)
    >>> from cpl.quadruped.gains import corrected_gain
    >>> policy = Policy(corrected_gain, limits, PolicyConfig(), forecast=lambda x: 0.5)
    >>> [round(policy.decide(np.zeros(47), error).kp, 3) for error in (False, False, True, True)]
    [1.65, 1.815, 1.997, 2.196]
    """

    def __init__(
        self,
        rule: GainRule,
        limits: GainLimits,
        config: PolicyConfig,
        *,
        forecast: Forecast | None = None,
        oracle: bool = False,
    ) -> None:
        if oracle and forecast is not None:
            raise ValueError(f"oracle must be False with a forecast, not {oracle}")
        self.oracle = oracle
        self._rule, self._limits, self._forecast = rule, limits, forecast
        self._kp = min(max(config.kp0, limits.kp_min), limits.kp_max)
        self._tracker = Tracker(config.rule, alpha=config.alpha, q0=config.q0)
        self._issued: deque[tuple[float, float]] = deque()

    @property
    def kp(self) -> float:
        """The gain now [1/s]."""
        return self._kp

    def decide(
        self, features: NDArray[np.float64], slam_error: bool, peek: Peek | None = None
    ) -> Decision:
        """Take what is known at step t and choose the gain.

        Args:
            features: The 47 numbers of `features.History`.
            slam_error: Whether this step had an error.
            peek: Returns the true label of this step; needed by the oracle alone.

        Returns:
            The decision.

        Raises:
            ValueError: An oracle without a way to look into the future.
        """
        score, err = math.nan, None
        if len(self._issued) == HORIZON:
            l_hat, met = self._issued.popleft()
            score = abs(float(slam_error) - l_hat)
            err = self._tracker.feedback(score, met)
        l_hat, q = self._predict(features, peek), self._tracker.q
        if not math.isnan(l_hat):
            self._issued.append((l_hat, q))
        self._kp = self._rule(self._kp, l_hat, q, self._limits)
        return Decision(kp=self._kp, l_hat=l_hat, q=q, score=score, err=err)

    def _predict(self, features: NDArray[np.float64], peek: Peek | None) -> float:
        if self.oracle:
            if peek is None:
                raise ValueError("peek must be given to an oracle, not None")
            return float(peek())
        return math.nan if self._forecast is None else float(self._forecast(features))
