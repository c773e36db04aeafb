"""What of the forecast and its quantile reaches an agent, in training and on the road alike."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cpl.highway import Config, Policy
from cpl.policies._tracked import Forecast, Tracking

__all__ = ["Hearing", "More", "Penalty", "View"]

Singles = NDArray[np.float32]
Floats = NDArray[np.float64]

More = Callable[[Singles], Singles]
"""From histories (n, length * width) to further inputs (n, k): a crash classifier, say."""


@dataclass(frozen=True, kw_only=True)
class View:
    """What an agent sees, in this order.

    Paper: Section IV, Conformal Policies: pi_RL(x, l_hat, q) sees the default, rl_nq no q, and
    pi_speed neither.

    Attributes:
        observations: How many observations, oldest first, the present one last [steps]; before
            the episode's beginning they are zeros.
        l_hat: Whether the forecast follows.
        quantiles: How many quantiles follow, oldest first, the present one last [steps]; before
            the episode's beginning they are what the first one is.
        q_scale: What quantiles are multiplied with [-].

    Examples:
        >>> View().size(25), View(quantiles=0).size(25), View(observations=5).size(25)
        (27, 26, 127)
    """

    observations: int = 1
    l_hat: bool = True
    quantiles: int = 1
    q_scale: float = 1.0

    def __post_init__(self) -> None:
        for name in ("observations", "quantiles"):
            if getattr(self, name) < 0:
                raise ValueError(f"{name} must not be negative, got {getattr(self, name)!r}")
        if self.size(1) == 0:
            raise ValueError(f"view must show something, got {self!r}")
        if not math.isfinite(self.q_scale):
            raise ValueError(f"q_scale must be finite, got {self.q_scale!r}")

    def size(self, width: int) -> int:
        """Return how many numbers are seen, for observations of a width."""
        return self.observations * width + int(self.l_hat) + self.quantiles

    def seen(self, flat: Singles, width: int, l_hat: Floats, q: Floats) -> Singles:
        """Put together what is seen.

        Args:
            flat: Histories, (n, length * width), the present observation last.
            width: Numbers in an observation.
            l_hat: Forecasts [-], (n,).
            q: The last quantiles [-], (n, quantiles), the present one last.

        Returns:
            Shape (n, size).
        """
        first = flat.shape[1] - self.observations * width
        forecast = l_hat[:, None][:, : int(self.l_hat)]
        parts = (flat[:, first:], forecast, self.q_scale * q)
        return np.concatenate(parts, axis=1, dtype=np.float32)


@dataclass(frozen=True, kw_only=True)
class Penalty:
    r"""What is taken off the reward of a decision, by the state that it leads to.

    $$ r - w_q |q| - w_{ql}\, q\, \hat l $$

    Paper: Section IV, Baselines: rl_1 has the first term, rl_2 the second, rl_3 both. The paper
    does not say whether the penalty belongs to the state before the decision or to the one after;
    only the latter depends on the decision. Where there is no forecast yet, l_hat is 0.

    Attributes:
        q: Weight of the norm of q [-].
        product: Weight of q l_hat [-].

    Examples:
        >>> round(Penalty(q=2.0, product=10.0)(0.25, 0.1), 9)
        0.45
    """

    q: float = 0.0
    product: float = 0.0

    def __post_init__(self) -> None:
        for name in ("q", "product"):
            if not math.isfinite(getattr(self, name)):
                raise ValueError(f"{name} must be finite, got {getattr(self, name)!r}")

    def __call__(self, l_hat: float, q: float) -> float:
        """Return the penalty [-] for a forecast and a quantile."""
        return self.q * abs(q) + self.product * q * l_hat


@dataclass(frozen=True, kw_only=True)
class Hearing:
    """Forecast, tracker and view of an agent; the same in training and on the road.

    Attributes:
        forecast: The forecaster.
        tracking: How the quantile of its error is tracked.
        view: What the agent sees of them.
        policies: The agent's choices, if they are policies; else it chooses actions.
        more: Further inputs, appended to what is seen.
        horizon: How far the forecast looks [steps].
        length: Observations in a history [steps].

    Raises:
        ValueError: If more observations are seen than a history holds, or a score is wanted before
            it can be known.
    """

    forecast: Forecast
    tracking: Tracking
    view: View = View()
    policies: tuple[Policy, ...] = ()
    more: More | None = None
    horizon: int = 3
    length: int = 5

    def __post_init__(self) -> None:
        if self.view.observations > self.length:
            raise ValueError(
                f"view must show at most {self.length} observations, got {self.view.observations}"
            )
        if self.tracking.delay < self.horizon:
            raise ValueError(
                f"tracking must have a delay >= the horizon {self.horizon}, got {self.tracking!r}"
            )

    @property
    def choices(self) -> int:
        """How many choices the agent has."""
        return len(self.policies) or 5

    def width(self, road: Config) -> int:
        """Return how many numbers are in one observation of a road."""
        return road.observation_vehicles_count * len(road.features)

    def size(self, road: Config) -> int:
        """Return how many numbers an agent sees on a road."""
        width = self.width(road)
        size = self.view.size(width)
        if self.more is not None:
            size += self.more(np.zeros((1, self.length * width), np.float32)).shape[1]
        return size

    def seen(self, flat: Singles, width: int, l_hat: Floats, q: Floats) -> Singles:
        """Put together what is seen; see `View.seen`."""
        shown = self.view.seen(flat, width, l_hat, q)
        if self.more is None:
            return shown
        return np.concatenate([shown, self.more(flat)], axis=1, dtype=np.float32)

    def actions(self, choice: NDArray[np.int64], obs: Singles) -> NDArray[np.int64]:
        """Turn choices (n,) into actions (n,); policies are asked about their own roads only."""
        if not self.policies:
            return choice
        found = np.empty(len(choice), np.int64)
        for number, policy in enumerate(self.policies):
            chosen = choice == number
            if chosen.any():
                found[chosen] = policy(obs[chosen])
        return found
