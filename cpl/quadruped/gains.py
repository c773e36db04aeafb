"""Faster or slower? One function a rule, each from (kp, l_hat, q) to the next gain.

The rules share the paper's steps: x 0.8 to slow down, x 1.1 to speed up, then clip. They differ in
when they slow down.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

__all__ = [
    "GAIN_RULES",
    "GainLimits",
    "GainRule",
    "constant_gain",
    "corrected_gain",
    "false_positive",
    "no_quantile_gain",
    "paper_gain",
]

SLOW_DOWN = 0.8  # [-] Section V-C
SPEED_UP = 1.1  # [-] Section V-C
FALSE_POSITIVE_SUM = 1.1  # [score] Section V-C


@dataclass(frozen=True, kw_only=True)
class GainLimits:
    """The range of the gain and the threshold.

    Args:
        kp_min: Least gain [1/s].
        kp_max: Largest gain [1/s].
        q_safe: Slow down from this sum of prediction and quantile on [score].
    """

    kp_min: float
    kp_max: float
    q_safe: float = 0.8

    def __post_init__(self) -> None:
        if not 0 < self.kp_min <= self.kp_max:
            raise ValueError(
                f"kp_min must be above 0 and at most kp_max, not {self.kp_min} with {self.kp_max}"
            )


GainRule = Callable[[float, float, float, GainLimits], float]


def false_positive(l_hat: float, q: float, *, q_safe: float = 0.8) -> bool:
    """Tell whether the paper takes an alarm for a false one.

        l_hat - q < 1 - q_safe   and   l_hat + q > 1.1

    Paper: Section V-C. At q_safe = 0.8 this needs q > 0.45, and at q = 1 it holds for every
    l_hat > 0.1: the less the prediction can be trusted, the surer the rule is (contradiction 7).

    Args:
        l_hat: Predicted probability of a SLAM error [-].
        q: The tracked quantile of |l - l_hat| [score].
        q_safe: The switch's threshold [score].

    >>> false_positive(0.6, 0.45), false_positive(0.6, 0.55), false_positive(0.11, 1.0)
    (False, True, True)
    """
    return l_hat - q < 1 - q_safe and l_hat + q > FALSE_POSITIVE_SUM


def paper_gain(kp: float, l_hat: float, q: float, limits: GainLimits) -> float:
    """Return the next gain of pi_switch as printed, with its false-positive rule.

    Paper: Section V-C. At equality of l_hat + q and q_safe the printed <= and >= overlap
    (contradiction 5); the ruling is to slow down.

    Args:
        kp: The gain now [1/s].
        l_hat: Predicted probability of a SLAM error [-].
        q: The tracked quantile [score].
        limits: Range and threshold.

    >>> wide = GainLimits(kp_min=0.8, kp_max=4.0)
    >>> round(paper_gain(1.0, 0.5, 0.3, wide), 3), round(paper_gain(1.0, 0.5, 0.9, wide), 3)
    (0.8, 1.1)
    """
    slow = l_hat + q >= limits.q_safe and not false_positive(l_hat, q, q_safe=limits.q_safe)
    return _step(kp, slow, limits)


def corrected_gain(kp: float, l_hat: float, q: float, limits: GainLimits) -> float:
    """Return the next gain without the false-positive rule: more risk or doubt never speeds up.

        slow down if and only if l_hat + q >= q_safe

    Args:
        kp: The gain now [1/s].
        l_hat: Predicted probability of a SLAM error [-].
        q: The tracked quantile [score].
        limits: Range and threshold.

    >>> wide = GainLimits(kp_min=0.8, kp_max=4.0)
    >>> round(corrected_gain(1.0, 0.5, 0.3, wide), 3), round(corrected_gain(1.0, 0.5, 0.9, wide), 3)
    (0.8, 0.8)
    """
    return _step(kp, l_hat + q >= limits.q_safe, limits)


def no_quantile_gain(kp: float, l_hat: float, q: float, limits: GainLimits) -> float:
    """Return the next gain of the baseline, which looks at the prediction alone.

    Paper: Section V-C, "No Quantile". `q` is taken and ignored, so that the rules are exchangeable.

    >>> narrow = GainLimits(kp_min=1.2, kp_max=1.8)
    >>> no_quantile_gain(1.5, 0.79, 1.0, narrow) > 1.5 > no_quantile_gain(1.5, 0.8, 0.0, narrow)
    True
    """
    del q
    return _step(kp, l_hat >= limits.q_safe, limits)


def constant_gain(kp: float, l_hat: float, q: float, limits: GainLimits) -> float:
    """Return the same gain, clipped: the control that looks at nothing.

    >>> constant_gain(1.5, 1.0, 1.0, GainLimits(kp_min=0.8, kp_max=4.0))
    1.5
    """
    del l_hat, q
    return min(max(kp, limits.kp_min), limits.kp_max)


GAIN_RULES: dict[str, GainRule] = {
    "paper": paper_gain,
    "corrected": corrected_gain,
    "no_quantile": no_quantile_gain,
    "constant": constant_gain,
}


def _step(kp: float, slow: bool, limits: GainLimits) -> float:
    return min(max(kp * (SLOW_DOWN if slow else SPEED_UP), limits.kp_min), limits.kp_max)
