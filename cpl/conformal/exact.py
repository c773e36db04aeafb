"""The fixed step without rounding that adds up: thresholds from integer counts."""

from fractions import Fraction
from numbers import Rational
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cpl.conformal import _kernels
from cpl.conformal._validate import (
    Bounds,
    as_bounds,
    as_integer,
    as_number,
    as_probability,
    as_scores,
)
from cpl.conformal.rules import Fixed

__all__ = ["ExactTrack", "track_exact"]

FloatArray: TypeAlias = NDArray[np.float64]
IntArray: TypeAlias = NDArray[np.int64]

_FINEST = 10**9  # the largest denominator of alpha: with 9e9 steps the counts fit into an int64


class ExactTrack(NamedTuple):
    """What the fixed-step tracker did, counted.

    Attributes:
        q: The thresholds [score], shape (T,), each correct to a few units in the last place.
        err: Whether each score was missed, shape (T,), bool.
        misses: The number of misses known when q[t] was formed, shape (T,), int64.
    """

    q: FloatArray
    err: NDArray[np.bool_]
    misses: IntArray


def track_exact(
    scores: ArrayLike,
    rule: Fixed,
    *,
    alpha: float | Fraction,
    delay: int = 1,
    q0: float = 0.0,
    bounds: Bounds | None = None,
) -> ExactTrack:
    r"""Follow the quantile with a fixed step by counting misses.

    $$q_t = q_0 + \eta\,(N_t - \alpha n_t), \qquad n_t = \max(t - h + 1, 0)$$

    where N_t is the number of misses among the first n_t scores, those known at time t. Paper:
    the telescoped sum of Theorem 1's proof. With alpha = a/m the bracket is
    (m N_t - a n_t) / m, an integer over an integer: no rounding is carried from step to step,
    whereas the sum in ``track`` drifts by about 1e-12 of a step in a million.

    Args:
        scores: Finite scores, shape (T,).
        rule: A fixed step.
        alpha: The miscoverage aimed at, in (0, 1). A float is read as the decimal number it is
            written as (0.1 is 1/10); what is no short decimal is given as a ``Fraction``.
        delay: The number of steps h >= 1 after which an error is known.
        q0: The first threshold [score].
        bounds: A declared range (low, high) of the scores.

    Returns:
        ``ExactTrack(q, err, misses)``.

    Raises:
        ValueError: If an argument is refused, naming it and its value; so is an alpha whose
            denominator exceeds 10**9.

    Examples:
        >>> q, err, misses = track_exact([2.0, 0.9, 0.5, 0.6], Fixed(eta=1.0), alpha=0.25)
        >>> q.tolist(), misses.tolist()
        ([0.0, 0.75, 1.5, 1.25], [0, 1, 2, 2])

        A cycle of one miss and nine covered scores comes back to where it was, exactly; the sum
        does not:

        >>> from cpl.conformal import track
        >>> scores = [1.0] + [0.0] * 9
        >>> float(track_exact(scores * 2, Fixed(eta=0.1), alpha=0.1).q[10])
        0.0
        >>> bool(abs(track(scores * 2, Fixed(eta=0.1), alpha=0.1).q[10]) > 0)
        True
    """
    if not isinstance(rule, Fixed):  # pyright: ignore[reportUnnecessaryIsInstance]
        msg = f"rule must be Fixed(eta=...), the only one with a count form, got {rule!r}"
        raise ValueError(msg)
    share = _as_fraction(alpha)
    late = as_integer("delay", delay, minimum=1)
    start = as_number("q0", q0) + 0.0
    checked = as_scores(scores, ndim=1, bounds=as_bounds(bounds))
    q = np.empty_like(checked)
    misses = np.empty(checked.size, dtype=np.int64)
    _kernels.follow_counts(
        checked,
        rule.eta,
        share.numerator,
        share.denominator,
        min(late, checked.size + 1),
        start,
        q,
        misses,
    )
    return ExactTrack(q, checked > q, misses)


def _as_fraction(alpha: float | Fraction) -> Fraction:
    """Return alpha as the fraction that is meant, not as the binary number next to it."""
    number = as_probability("alpha", alpha)
    share = Fraction(alpha) if isinstance(alpha, Rational) else Fraction(repr(number))
    if share.denominator > _FINEST:
        msg = f"alpha must be a fraction with a denominator of at most 10**9, got {alpha!r}"
        raise ValueError(msg)
    return share
