r"""Bounds for the fixed step plus a saturated integrator (conformal PI control).

After `n` scores, with $E_n = \sum_{i\le n}(\mathrm{err}_i-\alpha)$ and $q_1 = 0$,

$$q_{n+1} = \eta E_n
  + K_I\tan\!\Bigl(\frac{E_{n-\mathrm{lag}}\,\log n}{C_{sat}\,n}\Bigr),$$

and $\pm\infty$ where the argument leaves $(-\pi/2,\pi/2)$. `lag=0` is the textbook
form; `lag=1` is what the public code of the conformal PID paper computes, and it obeys a weaker
bound: its integrator can still be empty when one more miss has already happened.

The bounds hold in real arithmetic; they contain a logarithm and an arctangent, so these functions
compute with floats.
"""

from __future__ import annotations

import math
from itertools import accumulate

from cpl.conformal.rational import Number, count, level, positive

__all__ = ["pi_envelope", "pi_error_range", "pi_turning_point"]


def pi_turning_point(n: int, *, eta: Number, B: Number, K_I: Number, C_sat: Number) -> float:
    r"""Return the excess of misses from which, after `n` scores, the next score is covered.

    $$m_n = \min\Bigl(C_{sat}\arctan\frac{B}{K_I}\cdot\frac{n}{\log n},\;
      \frac{B}{\eta}\Bigr),\qquad m_1 = \frac{B}{\eta}$$

    If $E_n\ge m_n$, the integrator alone or the fixed step alone lifts `q` to `B`.

    Args:
        n: number of scores seen [steps].
        eta: step size of the fixed-step part > 0 [score].
        B: largest score > 0 [score].
        K_I: gain of the integrator > 0 [score].
        C_sat: saturation constant > 0 [misses].

    Examples:
        By hand: log 1 = 0 empties the integrator, and B / eta = 10.

        >>> pi_turning_point(1, eta=0.1, B=1, K_I=1, C_sat=1)
        10.0
        >>> round(pi_turning_point(8, eta=0.1, B=1, K_I=1, C_sat=1), 3)  # pi/4 * 8 / log 8
        3.022
    """
    steps = float(positive(B, "B") / positive(eta, "eta"))
    gain, saturation = positive(K_I, "K_I"), positive(C_sat, "C_sat")
    if count(n, "n") == 1:
        return steps
    angle = math.atan(float(positive(B, "B") / gain))
    return min(float(saturation) * angle * n / math.log(n), steps)


def pi_envelope(
    T: int,
    *,
    alpha: Number,
    eta: Number,
    B: Number,
    K_I: Number,
    C_sat: Number,
    lag: int = 0,
) -> list[float]:
    r"""Return an upper bound on $E_n$ for every `n = 1, ..., T`, step by step.

    $$U_{n+1} = \max\bigl(U_n-\alpha,\ \min(U_n, m_n + (1-\alpha)\mathrm{lag}) + 1-\alpha
      \bigr),\qquad U_0 = 0$$

    Below the turning point one more miss is possible; above it the next score is covered. With one
    step of lag the turning point is passed one miss late.

    Paper: not in it. Angelopoulos, Candes and Tibshirani (2023) bound the rate for a general
    saturation function; this follows the constants.

    Args:
        T: number of scores [steps].
        alpha: miscoverage level in (0, 1).
        eta: step size of the fixed-step part > 0 [score].
        B: largest score > 0 [score].
        K_I: gain of the integrator > 0 [score].
        C_sat: saturation constant > 0 [misses].
        lag: 0 for the textbook form, 1 for the public code's.

    Returns:
        `T` numbers of misses; entry `n - 1` bounds the excess after `n` scores.

    Raises:
        ValueError: if `lag` is neither 0 nor 1, or another argument is out of range.

    Examples:
        By hand: at most one miss a step, .9 each, as long as nothing saturates.

        >>> [round(x, 1) for x in pi_envelope(4, alpha=0.1, eta=0.1, B=1, K_I=1, C_sat=5)]
        [0.9, 1.8, 2.7, 3.6]
    """
    a = float(level(alpha))
    slack = (1 - a) * _lag(lag)
    turning = [0.0] + [
        pi_turning_point(n, eta=eta, B=B, K_I=K_I, C_sat=C_sat) for n in range(1, count(T, "T"))
    ]

    def step(upper: float, turn: float) -> float:
        return max(upper - a, min(upper, turn + slack) + 1 - a)

    return list(accumulate(turning, step, initial=0.0))[1:]


def pi_error_range(
    T: int,
    *,
    alpha: Number,
    eta: Number,
    B: Number,
    K_I: Number,
    C_sat: Number,
    lag: int = 0,
) -> tuple[float, float]:
    r"""Return the range of $E_T = \sum_{i\le T}(\mathrm{err}_i-\alpha)$ in closed form.

    $$-(1+\mathrm{lag})\,\alpha \;\le\; E_T \;\le\;
      \max_{n<T} \min(m_n, n(1-\alpha)) + (1+\mathrm{lag})(1-\alpha)$$

    The `n (1 - alpha)` says that `n` scores cannot be missed more than `n` times. It matters only
    for the first few steps, where the integrator is switched off by `log 1 = 0`: without it a
    small `C_sat` makes the bound false (two scores can both be missed).

    Args:
        T: number of scores [steps].
        alpha: miscoverage level in (0, 1).
        eta: step size of the fixed-step part > 0 [score].
        B: largest score > 0 [score].
        K_I: gain of the integrator > 0 [score].
        C_sat: saturation constant > 0 [misses].
        lag: 0 for the textbook form, 1 for the public code's.

    Examples:
        By hand: after 2 scores at most 2 misses, 2 * .9 = 1.8.

        >>> pi_error_range(2, alpha=0.1, eta=0.1, B=1, K_I=1, C_sat=1)
        (-0.1, 1.8)
    """
    a, late = float(level(alpha)), 1 + _lag(lag)
    turning = (
        min(pi_turning_point(n, eta=eta, B=B, K_I=K_I, C_sat=C_sat), n * (1 - a))
        for n in range(1, count(T, "T"))
    )
    return -late * a, max(turning, default=0.0) + late * (1 - a)


def _lag(lag: int) -> int:
    if count(lag, "lag", least=0) > 1:
        msg = f"lag must be 0 or 1, got {lag!r}"
        raise ValueError(msg)
    return lag
