"""What the gate asks for: constants, tracked quantiles, and rules without a guarantee.

A margin is issued at every decision and learns from errors that become known later. What it needs
to remember of a decision until then it issues along: the gate keeps the queue.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cpl.conformal import BatchTracker, Rule

__all__ = [
    "Adaptive",
    "Averaged",
    "Bools",
    "Constant",
    "Costly",
    "Decision",
    "Floats",
    "Margin",
    "Outcome",
    "Recorded",
    "Stacked",
    "Tracked",
]

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]


@dataclass(frozen=True, kw_only=True, eq=False)
class Outcome:
    """What became known before a decision on n roads.

    Attributes:
        errors: Error of the forecast made h decisions ago for now, h = 1 ... horizon [m],
            (n, horizon).
        known: Whether there is one, (n, horizon).
        clearance: Clearance of the nearest car seen now [m], (n,).
        active: Roads that count, (n,).
    """

    errors: Floats
    known: Bools
    clearance: Floats
    active: Bools


class Margin(Protocol):
    """What the gate asks for on n roads."""

    width: int
    """Numbers that are issued for each road; the first is the margin."""

    def issue(self) -> Floats:
        """Return the margin [m] and what `learn` will want to know of this moment, (n, width)."""
        ...

    def learn(self, outcome: Outcome, issued: Floats) -> None:
        """Take in what became known; `issued` is by road and h - 1, (n, horizon, width)."""
        ...


class Constant:
    """The same margin always, one a road.

    Args:
        value: The margin [m], a number or (n,).
        n: Roads.
    """

    width = 1

    def __init__(self, value: ArrayLike, n: int) -> None:
        self.value = np.broadcast_to(np.asarray(value, np.float64), (n,))[:, None]

    def issue(self) -> Floats:
        """Return the constants."""
        return self.value

    def learn(self, outcome: Outcome, issued: Floats) -> None:
        """Learn nothing."""


class Recorded:
    """Margins that were recorded elsewhere: another stream's, or a schedule's.

    Args:
        margins: One row a decision, (decisions, n) [m]; `step` says which is next.
    """

    width = 1

    def __init__(self, margins: Floats) -> None:
        self.margins, self.step = margins, 0

    def issue(self) -> Floats:
        """Return the next row."""
        row = self.margins[self.step]
        self.step += 1
        return row[:, None]

    def learn(self, outcome: Outcome, issued: Floats) -> None:
        """Learn nothing."""


class Tracked:
    r"""The tracked quantile of the forecasts' error, plain or in units of a running scale.

    $$ q_{t+1} = q_t + \eta (1\{s_{t-h} / \sigma_{t-h} > q_{t-h}\} - \alpha), \qquad
       m_t = \sigma_t q_t $$

    Paper: eq. (4), corrected, with the delay h of the look-ahead's horizon. The scale is an
    exponentially weighted mean of the error's size; without one it is 1.

    Args:
        rule: How large the steps are.
        n: Roads.
        alpha: Share of errors that may exceed the margin.
        q0: The first threshold.
        memory: Decisions that the scale remembers; None for the plain quantile.
        scale0: The first scale [m].
        least: The smallest scale [m].
        at: Which of the horizon's errors is scored, counted from 1; None for the last.
        top: The largest margin asked for [m]; what an infinite threshold stands for. None for no
            limit. The threshold itself is not limited.
    """

    def __init__(
        self,
        rule: Rule,
        n: int,
        *,
        alpha: float,
        q0: float,
        memory: float | None = None,
        scale0: float = 1.0,
        least: float = 0.3,
        at: int | None = None,
        top: float | None = None,
    ) -> None:
        self.tracker = BatchTracker(rule, n, alpha=alpha, q0=q0)
        self.rate = 0.0 if memory is None else 1.0 / memory
        self.scale = np.full(n, 1.0 if memory is None else scale0)
        self.least = least
        self.top = np.inf if top is None else top
        self.at = -1 if at is None else at - 1
        self.width = 3
        self.missed = np.zeros(n, np.bool_)
        self.scored = np.zeros(n, np.bool_)

    def issue(self) -> Floats:
        """Return the margin, the threshold and the scale."""
        q = self.tracker.q
        asked = np.clip(q * self.scale, -self.top, self.top)
        return np.stack([asked, q, self.scale], axis=1)

    def learn(self, outcome: Outcome, issued: Floats) -> None:
        """Move threshold and scale where an error became known."""
        known, errors = outcome.known[:, self.at], outcome.errors[:, self.at]
        q, scale = issued[:, self.at, 1], issued[:, self.at, 2]
        safe = np.where(scale > 0, scale, 1.0)
        self.missed = self.tracker.feedback(errors / safe, q, known)
        self.scored = known
        if self.rate:
            moved = self.scale + self.rate * (np.abs(errors) - self.scale)
            self.scale = np.where(known, np.maximum(moved, self.least), self.scale)


class Averaged:
    """An exponentially weighted mean of the error plus some standard deviations: no guarantee.

    Args:
        n: Roads.
        memory: Decisions that are remembered.
        deviations: How many standard deviations are added.
        start: The first mean and standard deviation [m].
    """

    width = 1

    def __init__(
        self, n: int, *, memory: float, deviations: float, start: tuple[float, float]
    ) -> None:
        self.rate, self.deviations = 1.0 / memory, deviations
        self.mean = np.full(n, start[0])
        self.square = np.full(n, start[1] ** 2 + start[0] ** 2)

    def issue(self) -> Floats:
        """Return mean + deviations x standard deviation."""
        spread = np.sqrt(np.maximum(self.square - self.mean**2, 0.0))
        return (self.mean + self.deviations * spread)[:, None]

    def learn(self, outcome: Outcome, issued: Floats) -> None:
        """Move both means where an error became known."""
        known, errors = outcome.known[:, -1], outcome.errors[:, -1]
        self.mean = np.where(known, self.mean + self.rate * (errors - self.mean), self.mean)
        moved = self.square + self.rate * (errors**2 - self.square)
        self.square = np.where(known, moved, self.square)


class Adaptive:
    r"""Adaptive conformal inference: the level moves, the quantile is that of a window of errors.

    $$ \alpha_{t+1} = \alpha_t + \gamma (\alpha - \mathrm{err}_t) $$

    Gibbs and Candes (2021), with a window in place of all past errors, and delayed feedback.

    Args:
        n: Roads.
        alpha: Share of errors that may exceed the margin.
        gamma: Step of the level.
        window: Errors that count.
        start: The margin until the first error is known [m].
        top: The margin that stands for the infinite set [m].
    """

    width = 1

    def __init__(
        self, n: int, *, alpha: float, gamma: float, window: int, start: float, top: float
    ) -> None:
        self.alpha, self.gamma, self.top = alpha, gamma, top
        self.level = np.full(n, alpha)
        self.errors = np.full((n, window), np.nan)
        self.count = np.zeros(n, np.int64)
        self.margin = np.full(n, start)

    def issue(self) -> Floats:
        """Return the margin."""
        return self.margin[:, None]

    def learn(self, outcome: Outcome, issued: Floats) -> None:
        """Move the level, remember the error and read the margin off the window anew."""
        rows = np.flatnonzero(outcome.known[:, -1])
        errors = outcome.errors[rows, -1]
        missed = errors > issued[rows, -1, 0]
        self.level[rows] += self.gamma * (self.alpha - missed)
        window = self.errors.shape[1]
        self.errors[rows, self.count[rows] % window] = errors
        self.count[rows] += 1
        ordered = np.sort(self.errors[rows], axis=1)  # NaN, the unused, come last
        held = np.minimum(self.count[rows], window)
        rank = np.ceil((1.0 - self.level[rows]) * (held + 1)).astype(np.int64)
        inside = np.take_along_axis(ordered, np.clip(rank - 1, 0, held - 1)[:, None], 1)[:, 0]
        self.margin[rows] = np.where(rank > held, self.top, np.where(rank < 1, 0.0, inside))


class Decision:
    r"""Conformal decision theory: the margin itself answers to a loss, a near miss.

    $$ m_{t+1} = m_t + \eta (1\{c_t < c^*\} - \varepsilon) $$

    Lekeufack et al. (2024). c is the clearance that is seen, not the error of a forecast.

    Args:
        n: Roads.
        eta: Step [m].
        epsilon: Share of near misses that is aimed at.
        near: Clearance below which it was one [m].
        start: The first margin [m].
    """

    width = 1

    def __init__(self, n: int, *, eta: float, epsilon: float, near: float, start: float) -> None:
        self.eta, self.epsilon, self.near = eta, epsilon, near
        self.margin = np.full(n, start)

    def issue(self) -> Floats:
        """Return the margin."""
        return self.margin[:, None]

    def learn(self, outcome: Outcome, issued: Floats) -> None:
        """Move the margin by whether this was a near miss."""
        loss = outcome.clearance < self.near
        moved = self.margin + self.eta * (loss - self.epsilon)
        self.margin = np.where(outcome.active, moved, self.margin)


class Costly:
    r"""Cost-aware tracking: an error counts for more when a near miss is seen with it.

    $$ m_{t+1} = m_t + \eta (c_t\,\mathrm{err}_t - \alpha), \qquad
       c_t = 1 + C\,1\{\text{clearance} < c^*\} $$

    After Xue, Pan, Ong and Wu (2026), with a near miss for the violation.

    Args:
        n: Roads.
        eta: Step [m].
        alpha: Share of errors, weighted, that is aimed at.
        cost: C, what an error with a near miss costs more than one without.
        near: Clearance below which it was one [m].
        start: The first margin [m].
    """

    width = 1

    def __init__(
        self, n: int, *, eta: float, alpha: float, cost: float, near: float, start: float
    ) -> None:
        self.eta, self.alpha, self.cost, self.near = eta, alpha, cost, near
        self.margin = np.full(n, start)

    def issue(self) -> Floats:
        """Return the margin."""
        return self.margin[:, None]

    def learn(self, outcome: Outcome, issued: Floats) -> None:
        """Move the margin by an error that became known, and by what it cost."""
        known, missed = outcome.known[:, -1], outcome.errors[:, -1] > issued[:, -1, 0]
        loss = missed * (1.0 + self.cost * (outcome.clearance < self.near))
        self.margin = np.where(known, self.margin + self.eta * (loss - self.alpha), self.margin)


class Stacked:
    """Several margins side by side, each for its own roads.

    Args:
        parts: Margins in the order of their roads.
        sizes: Roads of each.
    """

    def __init__(self, parts: list[Margin], sizes: list[int]) -> None:
        self.parts = parts
        ends = np.cumsum([0, *sizes]).tolist()
        self.places = [slice(a, b) for a, b in itertools.pairwise(ends)]
        self.width = max(part.width for part in parts)

    def issue(self) -> Floats:
        """Return all parts' margins; what a part does not use is zero."""
        issued = np.zeros((self.places[-1].stop, self.width))
        for part, place in zip(self.parts, self.places, strict=True):
            issued[place, : part.width] = part.issue()
        return issued

    def learn(self, outcome: Outcome, issued: Floats) -> None:
        """Let each part learn from its own roads."""
        for part, place in zip(self.parts, self.places, strict=True):
            own = Outcome(
                errors=outcome.errors[place],
                known=outcome.known[place],
                clearance=outcome.clearance[place],
                active=outcome.active[place],
            )
            part.learn(own, issued[place, :, : part.width])
