r"""Score sequences that attain the worst case: the bounds of `cpl.conformal.bounds` are not slack.

An adversary sees everything and plays two moves: the score `B`, which is missed whenever `q < B`,
and the score 0, which is covered whenever `q >= 0`. Without delay the two extremes are simple. To
miss as much as possible: one zero (which puts `q` at its lowest point, `-alpha eta`), then `B` for
ever. To miss as little as possible: `B` until `q` stands at the right point of its top band, then
zeros for ever.

With delay `h` the adversary steers the virtual quantile `p`, which knows the errors under way. To
gain the most it holds `p` just below `B`, so that `q` is below `B` too, and misses in the last `h`
steps, whose effect comes after the window. This needs room: `B >= h (1 - alpha) eta`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from cpl.conformal.rational import Number, count, level, positive
from cpl.conformal.reference import ExactPath, follow

__all__ = [
    "Adversary",
    "lower_worst_case",
    "lower_worst_case_from_start",
    "upper_worst_case",
    "upper_worst_case_from_start",
]


@dataclass(frozen=True, kw_only=True)
class Adversary:
    """A sequence of scores, and the window in which it does its work."""

    alpha: Fraction
    """Miscoverage level."""
    eta: Fraction
    """Step size [score]."""
    B: Fraction
    """Largest score [score]."""
    delay: int
    """Feedback delay [steps]."""
    scores: tuple[Fraction, ...]
    """Scores, each 0 or `B`."""
    start: int
    """First time of the window (0-based; the paper's T0 is one more)."""
    W: int
    """Window length [steps]; the window ends with the sequence."""

    @property
    def errors(self) -> int:
        """Number of misses in the window, counted by running the tracker exactly."""
        return self.path().errors(self.start, self.W)

    def path(self) -> ExactPath:
        """Run the tracker on the scores, in fractions."""
        return follow(self.scores, alpha=self.alpha, eta=self.eta, delay=self.delay)

    def as_floats(self) -> NDArray[np.float64]:
        """Return the scores as an array for `cpl.conformal.track`."""
        return np.array([float(s) for s in self.scores])


def upper_worst_case(alpha: Number, eta: Number, B: Number, W: int, *, delay: int = 1) -> Adversary:
    """Return a sequence with `max_errors(alpha, eta, B, W, delay=delay)` misses in its last `W`.

    Attained always for `delay=1`, and for `B >= delay (1 - alpha) eta`; otherwise the sequence is
    as bad as this strategy can make it.

    Args:
        alpha: miscoverage level in (0, 1).
        eta: step size > 0 [score].
        B: largest score > 0 [score].
        W: window length [steps].
        delay: feedback delay >= 1 [steps].

    Examples:
        >>> worst = upper_worst_case(0.1, 0.1, 1, W=40)
        >>> worst.errors, worst.start, [int(s) for s in worst.scores[:4]]
        (14, 1, [0, 1, 1, 1])
        >>> upper_worst_case(0.1, 0.1, 1, W=40, delay=3).errors
        16
    """
    game = _Game(alpha, eta, B, delay)
    game.cover(delay)
    game.climb(count(W, "W") - delay)
    game.miss(min(delay, W))
    return game.adversary(start=delay)


def upper_worst_case_from_start(
    alpha: Number, eta: Number, B: Number, W: int, *, delay: int = 1
) -> Adversary:
    """Return `W` scores with `max_errors_from_start` misses, counted from the first step.

    Examples:
        >>> upper_worst_case_from_start(0.1, 0.1, 1, W=31).errors
        13
    """
    game = _Game(alpha, eta, B, delay)
    game.climb(count(W, "W") - delay)
    game.miss(min(delay, W))
    return game.adversary(start=0)


def lower_worst_case(alpha: Number, eta: Number, B: Number, W: int, *, delay: int = 1) -> Adversary:
    r"""Return a sequence with `min_errors(alpha, eta, B, W, delay=delay)` misses in its last `W`.

    Attained always for `delay=1`, and for $B \ge h\max(\alpha,1-\alpha)\eta$. The window must
    start at or above the virtual quantile $(\alpha(W-h) - n)\,\eta$, where `n` is the number of
    misses to be attained; on the way there `p` goes round its top band as on a circle, in steps
    of `alpha`, and so comes as close to any point as one likes, and for rational `alpha` to it.

    Examples:
        >>> best = lower_worst_case(0.1, 0.1, 1, W=120)
        >>> best.errors, best.start
        (2, 11)
    """
    game = _Game(alpha, eta, B, delay)
    length, h = count(W, "W"), game.delay
    gain = (1 - game.alpha) * game.eta
    fewest = (game.alpha * length - game.B / game.eta).__floor__() - h + 1
    target = (game.alpha * (length - h) - fewest) * game.eta - (h * gain if h > 1 else 0)
    game.approach(target)
    game.miss(h if h > 1 else 0)
    start = len(game.scores)
    game.descend(length - h)
    game.cover(min(h, length))
    return game.adversary(start=start)


def lower_worst_case_from_start(
    alpha: Number, eta: Number, B: Number, W: int, *, delay: int = 1
) -> Adversary:
    """Return `W` scores with `min_errors_from_start` misses, counted from the first step.

    Examples:
        >>> lower_worst_case_from_start(0.1, 0.1, 1, W=41).errors
        4
    """
    game = _Game(alpha, eta, B, delay)
    game.descend(count(W, "W") - delay)
    game.cover(min(delay, W))
    return game.adversary(start=0)


class _Game:
    """The adversary's seat: it sees `q` and the virtual quantile `p`, and plays `B` or 0."""

    def __init__(self, alpha: Number, eta: Number, B: Number, delay: int) -> None:
        self.alpha, self.eta, self.B = level(alpha), positive(eta, "eta"), positive(B, "B")
        self.delay = count(delay, "delay")
        self.scores: list[Fraction] = []
        self.p = [Fraction(0)]  # the virtual quantile before each step

    @property
    def q(self) -> Fraction:
        """The threshold that the next score meets: the virtual quantile of `delay - 1` ago."""
        return self.p[max(len(self.p) - self.delay, 0)]

    def play(self, score: Fraction) -> None:
        self.scores.append(score)
        self.p.append(self.p[-1] + self.eta * ((score > self.q) - self.alpha))

    def miss(self, steps: int) -> None:
        for _ in range(steps):
            self.play(self.B)

    def cover(self, steps: int) -> None:
        for _ in range(steps):
            self.play(Fraction(0))

    def climb(self, steps: int) -> None:
        """Miss as long as `p` stays below `B`: `p` then moves in `[B - eta, B)`."""
        self._steer(steps, lambda p: p + (1 - self.alpha) * self.eta < self.B)

    def descend(self, steps: int) -> None:
        """Cover as long as `p` stays at or above 0: `p` then moves in `[0, eta)`."""
        self._steer(steps, lambda p: p - self.alpha * self.eta < 0)

    def approach(self, target: Fraction) -> None:
        """Go round the top band until `p` has reached a point of it."""
        # Prompt feedback may overshoot B; with delay the overshoot is kept for the final misses.
        ceiling = self.B if self.delay == 1 else self.B - (1 - self.alpha) * self.eta
        for _ in range(self._patience()):
            if self.p[-1] >= target:
                break
            self.play(self.B if self.p[-1] < ceiling else Fraction(0))

    def adversary(self, *, start: int) -> Adversary:
        return Adversary(
            alpha=self.alpha,
            eta=self.eta,
            B=self.B,
            delay=self.delay,
            scores=tuple(self.scores),
            start=start,
            W=len(self.scores) - start,
        )

    def _steer(self, steps: int, wants_miss: Callable[[Fraction], bool]) -> None:
        for _ in range(steps):
            self.play(self.B if wants_miss(self.p[-1]) else Fraction(0))

    def _patience(self) -> int:
        """Return how many steps visit every point of the band, if the steering works at all."""
        climb = self.B / self.eta / (1 - self.alpha) + self.delay
        return climb.__ceil__() + self.alpha.denominator + 1
