r"""DtACI: several ACI levels with steps of their own, weighted by how well they did."""

import math
from dataclasses import dataclass

import numpy as np

from cpl.conformal import _window
from cpl.conformal._validate import as_choice, as_integer, as_positive
from cpl.conformal.family._member import Member
from cpl.conformal.state import FloatArray, StateRule, feedback

__all__ = ["MEMBER", "DtACI"]

_EXPERTS = 1  # weights, then levels, then the window
_SETTINGS = 8  # before the steps


@feedback
def _update(state: FloatArray, numbers: FloatArray, score: float, met: float) -> None:
    alpha, count, window = numbers[0], int(numbers[1]), int(numbers[2])
    rate, mixed = numbers[3], numbers[4]
    weights, levels = _EXPERTS, _EXPERTS + count
    at = _EXPERTS + 2 * count
    known = _window.count(state, at)
    if known > numbers[7] and known > 0:
        # The level at which this score would just have been covered: the share not below it.
        below = _window.below(state, at, window, score)
        beta = (known - below) / known
        total = 0.0
        for k in range(count):
            off = beta - state[levels + k]
            loss = max(alpha * off, (alpha - 1.0) * off)
            state[weights + k] *= math.exp(-rate * loss)
            total += state[weights + k]
        summed = 0.0
        for k in range(count):
            state[weights + k] = (1.0 - mixed) * state[weights + k] / total + mixed / count
            summed += state[weights + k]
        for k in range(count):
            state[weights + k] /= summed
            missed = 1.0 if state[levels + k] > beta else 0.0
            level = state[levels + k] + numbers[_SETTINGS + k] * (alpha - missed)
            if numbers[6] > 0.0:
                level = min(max(level, 0.0), 1.0)
            state[levels + k] = level
    _window.push(state, at, window, score)
    played = 0.0
    for k in range(count):
        played += state[weights + k] * state[levels + k]
    state[0] = _window.quantile(state, at, window, 1.0 - played, numbers[5])


@dataclass(frozen=True, kw_only=True, slots=True)
class DtACI(StateRule):
    r"""Weigh ACI experts of several steps by the pinball loss of their levels.

    $$ w^k \propto (1 - \sigma)\, w^k e^{-\eta \ell(\beta_t, \alpha^k_t)} + \sigma / K, \qquad
       \alpha^k_{t+1} = \alpha^k_t + \gamma_k (\alpha - 1\{\alpha^k_t > \beta_t\}), \qquad
       q_{t+1} = \hat Q_t\bigl(1 - \textstyle\sum_k w^k \alpha^k_{t+1}\bigr) $$

    Gibbs and Candes (2024), algorithm 2 with the averaged level; beta_t is the share of the last
    scores that are not below the new one. The published rates for an interval I, over which regret
    is to be small, are sigma = 1 / (2 I) and

    $$ \eta = \sqrt{3 / I}\,\sqrt{(\log(I K) + 2)\,/\,
       [((1-\alpha)^2 \alpha^3 + \alpha^2 (1-\alpha)^3) / 3]} . $$

    Each expert has errors of its own, so late feedback is judged with what the experts hold when it
    comes. Public code waits for 1 / alpha scores (``wait``) and keeps the levels in [0, 1].

    Args:
        gammas: The experts' steps [-].
        window: Scores that count [steps], >= 1.
        interval: I [steps], >= 2.
        quantile: How a quantile is read off the window.
        clip: Whether levels are kept within [0, 1].
        wait: Levels and weights stand still until there are more scores than this.

    Examples:
        >>> DtACI(gammas=(0.01, 0.1), window=50, interval=100).numbers(0.1)[:3]
        array([ 0.1,  2. , 50. ])
    """

    gammas: tuple[float, ...]
    window: int
    interval: int
    quantile: str = "inverted_cdf"
    clip: bool = False
    wait: int = 0

    update = _update

    def __post_init__(self) -> None:
        if not self.gammas:
            raise ValueError(f"gammas must be at least one step, got {self.gammas!r}")
        gammas = tuple(as_positive(f"gammas[{k}]", g) for k, g in enumerate(self.gammas))
        object.__setattr__(self, "gammas", gammas)
        object.__setattr__(self, "window", as_integer("window", self.window, minimum=1))
        object.__setattr__(self, "interval", as_integer("interval", self.interval, minimum=2))
        object.__setattr__(self, "wait", as_integer("wait", self.wait, minimum=0))
        as_choice("quantile", self.quantile, _window.CONVENTIONS)

    def begin(self, alpha: float, q0: float) -> FloatArray:
        """Return the state: threshold, weights, levels, and the window."""
        count = len(self.gammas)
        state = np.zeros(_EXPERTS + 2 * count + _window.size(self.window))
        state[0] = q0
        state[_EXPERTS : _EXPERTS + count] = 1.0 / count
        state[_EXPERTS + count : _EXPERTS + 2 * count] = alpha
        return state

    def numbers(self, alpha: float) -> FloatArray:
        """Return the settings, the published rates among them."""
        count, span = len(self.gammas), self.interval
        mean = ((1 - alpha) ** 2 * alpha**3 + alpha**2 * (1 - alpha) ** 3) / 3
        rate = math.sqrt(3 / span) * math.sqrt((math.log(span * count) + 2) / mean)
        convention = _window.CONVENTIONS.index(self.quantile)
        mixed = 1 / (2 * span)
        settings = [alpha, count, self.window, rate, mixed, convention, self.clip, self.wait]
        return np.array([*settings, *self.gammas], np.float64)


MEMBER = Member(
    name="dtaci",
    title="DtACI",
    year=2024,
    paper="gibbs2024arbitrary",
    make=lambda scale: DtACI(gammas=(0.001, 0.004, 0.016, 0.064, 0.128), window=100, interval=100),
    guarantee="regret on every interval; the error only as far as its best step's",
    tuning="steps, interval, window",
    memory="2 window + 2 experts + 3",
    vectors="online-conformal 1.0.2",
)
